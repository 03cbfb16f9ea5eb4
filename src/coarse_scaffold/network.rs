//! The network of curves over the fine complex: which edges are curves and of which kind, which vertices are nodes, which facets
//! make a sheet. Topology only, but for the lengths of what may be contracted.
//!
//! 1. every edge that is not manifold is a curve edge: wire, rib or axial by its number of facets; seams are told;
//! 2. [`super::contract`] makes nodes of short seams, short curves and small sheets, [`super::hide`] takes curves out that are below
//!    the cut;
//! 3. nodes are the clusters, the vertices where other than two curve edges meet or two of different kind, and single points;
//! 4. curves are traced from node to node, then closed ones;
//! 5. sheets are the facets joined across edges that are not curves.

use super::contract::Cells;
use super::hypergraph::CurveKind;
use crate::fine_scaffold::FineScaffold;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::mesh::DisjointSets;
use crate::regularise::fins::{Along, lasting};
use crate::regularise::{Event, Regularised};
use std::collections::BTreeMap;

/// A curve as a chain of fine edges and vertices.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    pub kind: CurveKind,
    pub edges: Vec<u32>,
    /// One more than edges; first equals last when closed.
    pub vertices: Vec<u32>,
}

pub(crate) struct Network<'a> {
    pub fine: &'a FineScaffold,
    pub regularised: &'a Regularised,
    /// Alive facets at each edge.
    count: Vec<u8>,
    pub(super) seam: Vec<bool>,
    /// Edges and facets inside nodes, the nodes as sets of vertices, and the cells of each node by its root.
    pub(super) contracted: Vec<bool>,
    pub(super) contracted_facet: Vec<bool>,
    pub(super) clusters: DisjointSets,
    pub(super) in_cluster: Vec<bool>,
    /// Curve edges that the graph does not show.
    pub(super) hidden: Vec<bool>,
    /// Facets of flaps that the graph does not show.
    hidden_facet: Vec<bool>,
    /// Vertices where a rib is cut.
    pub(super) corner: Vec<bool>,
    pub(super) cells: BTreeMap<u32, Cells>,
    /// Contractions that were done or refused.
    pub transforms: Vec<Event>,
}

impl<'a> Network<'a> {
    pub fn new(fine: &'a FineScaffold, regularised: &'a Regularised) -> Self {
        let count = (0..fine.num_edges())
            .map(|e| {
                let alive = |f: &&u32| regularised.alive.facets[**f as usize];
                fine.facets_of_edge(e).iter().filter(alive).count() as u8
            })
            .collect();
        let mut seam = vec![false; fine.num_edges()];
        for &e in regularised.seams.iter().flatten() {
            seam[e as usize] = true;
        }
        Self {
            fine,
            regularised,
            count,
            seam,
            contracted: vec![false; fine.num_edges()],
            hidden: vec![false; fine.num_edges()],
            hidden_facet: vec![false; fine.num_facets()],
            corner: vec![false; fine.num_vertices()],
            contracted_facet: vec![false; fine.num_facets()],
            cells: BTreeMap::new(),
            clusters: DisjointSets::new(fine.num_vertices()),
            in_cluster: vec![false; fine.num_vertices()],
            transforms: Vec::new(),
        }
    }

    pub(super) fn edge_alive(&self, e: u32) -> bool {
        self.regularised.alive.edges[e as usize]
    }

    /// Kind of an edge; `None` for manifold edges and dead ones.
    pub fn kind(&self, e: u32) -> Option<CurveKind> {
        if !self.edge_alive(e) || self.hidden[e as usize] {
            return None;
        }
        match self.count[e as usize] {
            0 => Some(CurveKind::Wire),
            1 => Some(CurveKind::Rib),
            2 => self.seam[e as usize].then_some(CurveKind::Seam),
            _ => Some(CurveKind::Axial),
        }
    }

    /// Alive edges at a vertex.
    pub fn alive_edges(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.fine
            .edges_of_vertex(v as usize)
            .filter(|&e| self.edge_alive(e))
    }

    /// Third-highest erosion thickness at an axial edge, mm (three facets at most meet there).
    pub fn third_erosion(&self, e: u32) -> f64 {
        self.facets(e)
            .map(|f| self.regularised.erosion_mm[f as usize])
            .fold(f64::INFINITY, f64::min)
    }

    /// What a value of the edges of a curve is along the persistence length of the regularisation.
    pub fn along(&self, edges: &[u32], value: impl Fn(u32) -> f64) -> f64 {
        let values: Vec<Along> = edges
            .iter()
            .map(|&e| Along {
                value: value(e),
                length: self.length(&[e])
                    / self
                        .regularised
                        .tolerance_over(&self.fine.edge_vertices[e as usize]),
            })
            .collect();
        lasting(values, self.regularised.persistence_length)
    }

    /// The edge of largest third-highest erosion thickness of a chain, the first of equals.
    pub fn summit(&self, chain: &Chain) -> u32 {
        let highest = |a: u32, &b: &u32| {
            if self.third_erosion(b) > self.third_erosion(a) {
                b
            } else {
                a
            }
        };
        chain.edges.iter().fold(chain.edges[0], highest)
    }

    /// Alive facets at an edge that are shown.
    pub fn facets(&self, e: u32) -> impl Iterator<Item = u32> + '_ {
        let shown = |f: &u32| self.shows(*f);
        self.fine.facets_of_edge(e as usize).iter().copied().filter(shown)
    }

    /// Whether a facet is alive and shown.
    pub fn shows(&self, f: u32) -> bool {
        self.regularised.alive.facets[f as usize] && !self.hidden_facet[f as usize]
    }

    /// Alive facets at an edge that are shown, in number.
    pub fn count(&self, e: u32) -> u8 {
        self.count[e as usize]
    }

    /// Shows some facets no more, nor the edges that have no others.
    pub fn hide_facets(&mut self, facets: &[u32]) {
        for &f in facets {
            self.hidden_facet[f as usize] = true;
            for &e in self.fine.facet_edges(f as usize) {
                self.count[e as usize] -= 1;
                self.seam[e as usize] = false;
                self.hidden[e as usize] |= self.count[e as usize] == 0;
            }
        }
    }

    /// Length of a path of edges, mm.
    pub fn length(&self, edges: &[u32]) -> f64 {
        edges
            .iter()
            .map(|&e| {
                let [a, b] =
                    self.fine.edge_vertices[e as usize].map(|v| self.fine.vertex_position[v as usize]);
                a.distance(b)
            })
            .sum()
    }

    /// Curve edges of a vertex that are not contracted.
    fn curve_edges(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.fine
            .edges_of_vertex(v as usize)
            .filter(|&e| self.kind(e).is_some() && !self.contracted[e as usize])
    }

    /// Whether a vertex is (part of) a node.
    pub(super) fn is_node(&self, v: u32) -> bool {
        if self.in_cluster[v as usize] || self.corner[v as usize] {
            return true;
        }
        let mut kinds = self.curve_edges(v).map(|e| self.kind(e));
        match (kinds.next(), kinds.next(), kinds.next()) {
            (None, ..) => self.fine.edges_of_vertex(v as usize).all(|e| !self.edge_alive(e)),
            // A wire that pierces a sheet is two wires.
            (Some(a), Some(b), None) => {
                a != b
                    || a == Some(CurveKind::Wire) && self.alive_edges(v).any(|e| self.count[e as usize] > 0)
            }
            _ => true,
        }
    }

    /// Vertices that are nodes, as lists by cluster, in order of the smallest.
    pub fn nodes(&mut self) -> Vec<Vec<u32>> {
        let mut slot = vec![NONE; self.fine.num_vertices()];
        let mut nodes: Vec<Vec<u32>> = Vec::new();
        for v in 0..self.fine.num_vertices() as u32 {
            if !self.regularised.alive.vertices[v as usize] || !self.is_node(v) {
                continue;
            }
            let root = self.clusters.find(v) as usize;
            if slot[root] == NONE {
                slot[root] = nodes.len() as u32;
                nodes.push(Vec::new());
            }
            nodes[slot[root] as usize].push(v);
        }
        nodes
    }

    /// The curves: first those between nodes, in order of their smallest starting vertex, then closed ones.
    pub fn chains(&self) -> Vec<Chain> {
        let fine = self.fine;
        let mut used = self.contracted.clone();
        let mut chains = Vec::new();
        let alive = &self.regularised.alive.vertices;
        let starts = (0..fine.num_vertices() as u32).filter(|&v| alive[v as usize] && self.is_node(v));
        for start in starts {
            for first in fine.edges_of_vertex(start as usize) {
                if self.kind(first).is_some() && !used[first as usize] {
                    chains.extend(self.trace(start, first, &mut used));
                }
            }
        }
        for e in 0..fine.num_edges() as u32 {
            if !used[e as usize] && self.kind(e).is_some() {
                chains.extend(self.trace(fine.edge_vertices[e as usize][0], e, &mut used));
            }
        }
        chains
    }

    fn trace(&self, start: u32, first: u32, used: &mut [bool]) -> Option<Chain> {
        let kind = self.kind(first)?;
        let mut chain = Chain {
            kind,
            edges: Vec::new(),
            vertices: vec![start],
        };
        let (mut at, mut edge) = (start, first);
        loop {
            used[edge as usize] = true;
            at = self.fine.other_end(edge as usize, at);
            chain.edges.push(edge);
            chain.vertices.push(at);
            if at == start || self.is_node(at) {
                return Some(chain);
            }
            match self.curve_edges(at).find(|&e| !used[e as usize]) {
                Some(next) => edge = next,
                None => return Some(chain),
            }
        }
    }

    /// The sheets as lists of facets, in order of the smallest; facets inside nodes are in none.
    pub fn sheets(&self) -> Vec<Vec<u32>> {
        let fine = self.fine;
        let in_sheet = |f: u32| self.shows(f) && !self.contracted_facet[f as usize];
        let mut sets = DisjointSets::new(fine.num_facets());
        for e in 0..fine.num_edges() as u32 {
            if self.edge_alive(e) && self.kind(e).is_none() && !self.contracted[e as usize] {
                let mut here = self.facets(e).filter(|&f| in_sheet(f));
                if let Some(a) = here.next() {
                    for b in here {
                        sets.union(a, b);
                    }
                }
            }
        }
        let mut slot = vec![NONE; fine.num_facets()];
        let mut sheets: Vec<Vec<u32>> = Vec::new();
        for f in (0..fine.num_facets() as u32).filter(|&f| in_sheet(f)) {
            let root = sets.find(f) as usize;
            if slot[root] == NONE {
                slot[root] = sheets.len() as u32;
                sheets.push(Vec::new());
            }
            sheets[slot[root] as usize].push(f);
        }
        sheets
    }
}
