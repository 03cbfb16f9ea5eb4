//! The network of curves over the fine complex: which edges are curves and of which kind, which vertices are nodes, which facets
//! make a sheet. Topology only, but for the lengths of what may be contracted.
//!
//! 1. every edge that is not manifold is a curve edge: wire, rib or axial by its number of facets; seams are told;
//! 2. short seams and short axial curves are contracted: their vertices become one node. Contracting an arc, or any tree, keeps
//!    the homotopy type, because a tree is contractible and a subcomplex; a loop is never contracted;
//! 3. nodes are the clusters, the vertices where other than two curve edges meet or two of different kind, and single points;
//! 4. curves are traced from node to node, then closed ones;
//! 5. sheets are the facets joined across edges that are not curves.

use super::hypergraph::CurveKind;
use crate::fine_scaffold::FineScaffold;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::mesh::DisjointSets;
use crate::regularise::{Event, Kind, Regularised};

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
    seam: Vec<bool>,
    contracted: Vec<bool>,
    clusters: DisjointSets,
    in_cluster: Vec<bool>,
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
            clusters: DisjointSets::new(fine.num_vertices()),
            in_cluster: vec![false; fine.num_vertices()],
            transforms: Vec::new(),
        }
    }

    fn edge_alive(&self, e: u32) -> bool {
        self.regularised.alive.edges[e as usize]
    }

    /// Kind of an edge; `None` for manifold edges and dead ones.
    pub fn kind(&self, e: u32) -> Option<CurveKind> {
        if !self.edge_alive(e) {
            return None;
        }
        match self.count[e as usize] {
            0 => Some(CurveKind::Wire),
            1 => Some(CurveKind::Rib),
            2 => self.seam[e as usize].then_some(CurveKind::Seam),
            _ => Some(CurveKind::Axial),
        }
    }

    /// Alive facets at an edge.
    pub fn facets(&self, e: u32) -> impl Iterator<Item = u32> + '_ {
        let alive = |f: &u32| self.regularised.alive.facets[*f as usize];
        self.fine.facets_of_edge(e as usize).iter().copied().filter(alive)
    }

    fn length(&self, edges: &[u32]) -> f64 {
        edges
            .iter()
            .map(|&e| {
                let [a, b] =
                    self.fine.edge_vertices[e as usize].map(|v| self.fine.vertex_position[v as usize]);
                a.distance(b)
            })
            .sum()
    }

    /// Contracts seams up to `seam` long, then axial curves between two different nodes up to `axial` long, shortest first.
    pub fn contract(&mut self, seam: f64, axial: f64) {
        for path in &self.regularised.seams {
            if self.length(path) <= seam {
                self.contract_edges(Kind::Merge, path);
            }
        }
        let mut short: Vec<(f64, Chain)> = self
            .chains()
            .into_iter()
            .filter(|c| c.kind == CurveKind::Axial && c.vertices[0] != c.vertices[c.vertices.len() - 1])
            .map(|c| (self.length(&c.edges), c))
            .filter(|(length, _)| *length <= axial)
            .collect();
        short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.edges.cmp(&b.1.edges)));
        for (_, chain) in short {
            self.contract_edges(Kind::ContractCurve, &chain.edges);
        }
    }

    fn contract_edges(&mut self, kind: Kind, edges: &[u32]) {
        // A trial on a copy of the clusters touched: refused when the edges would close a loop.
        let mut trial = self.clusters.clone();
        let applied = edges.iter().all(|&e| {
            let [a, b] = self.fine.edge_vertices[e as usize];
            self.contracted[e as usize] || trial.union(a, b)
        });
        let place = self.fine.vertex_position[self.fine.edge_vertices[edges[0] as usize][0] as usize];
        let cost = self.length(edges);
        self.transforms.push(if applied {
            Event::applied(kind, cost, place, 0, 0)
        } else {
            Event::skipped(kind, cost, place)
        });
        if !applied {
            return;
        }
        self.clusters = trial;
        for &e in edges {
            self.contracted[e as usize] = true;
            for v in self.fine.edge_vertices[e as usize] {
                self.in_cluster[v as usize] = true;
            }
        }
    }

    /// Curve edges of a vertex that are not contracted.
    fn curve_edges(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.fine
            .edges_of_vertex(v as usize)
            .filter(|&e| self.kind(e).is_some() && !self.contracted[e as usize])
    }

    /// Whether a vertex is (part of) a node.
    fn is_node(&self, v: u32) -> bool {
        if self.in_cluster[v as usize] {
            return true;
        }
        let mut kinds = self.curve_edges(v).map(|e| self.kind(e));
        match (kinds.next(), kinds.next(), kinds.next()) {
            (None, ..) => self.fine.edges_of_vertex(v as usize).all(|e| !self.edge_alive(e)),
            (Some(a), Some(b), None) => a != b,
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

    /// The sheets as lists of facets, in order of the smallest.
    pub fn sheets(&self) -> Vec<Vec<u32>> {
        let fine = self.fine;
        let mut sets = DisjointSets::new(fine.num_facets());
        for e in 0..fine.num_edges() as u32 {
            if self.edge_alive(e) && self.kind(e).is_none() {
                let mut pair = self.facets(e);
                if let (Some(a), Some(b)) = (pair.next(), pair.next()) {
                    sets.union(a, b);
                }
            }
        }
        let mut slot = vec![NONE; fine.num_facets()];
        let mut sheets: Vec<Vec<u32>> = Vec::new();
        for f in (0..fine.num_facets() as u32).filter(|&f| self.regularised.alive.facets[f as usize]) {
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
