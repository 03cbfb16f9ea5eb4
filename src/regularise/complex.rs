//! The complex while it is being simplified: masks over a fine scaffold, changed only by elementary collapses and
//! expansions, each written to a log.
//!
//! An elementary collapse removes a cell together with a face that no other cell has; an expansion is its reverse. Both keep
//! the homotopy type (Whitehead, "Simplicial spaces, nuclei and m-groups", 1939), so a log of valid steps
//! *is* a proof that the simplified scaffold has the topology of the fine one; [`replay`] checks it step by step.

use crate::fine_scaffold::{Betti, FineScaffold};
use serde::{Deserialize, Serialize};

/// One elementary change. Ids are those of the fine scaffold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Step {
    /// Collapse of a 3-cell through a facet only it has.
    RemoveCell {
        /// 3-cell.
        cell: u32,
        /// Facet.
        facet: u32,
    },
    /// Collapse of a facet through an edge only it has.
    RemoveFacet {
        /// Facet.
        facet: u32,
        /// Edge.
        edge: u32,
    },
    /// Collapse of an edge without facets through an end only it has.
    RemoveEdge {
        /// Edge.
        edge: u32,
        /// Vertex.
        vertex: u32,
    },
    /// Expansion: a facet with the edge that was missing of its ring.
    AddFacet {
        /// Facet.
        facet: u32,
        /// Edge.
        edge: u32,
    },
    /// Expansion: an edge with the end that was missing.
    AddEdge {
        /// Edge.
        edge: u32,
        /// Vertex.
        vertex: u32,
    },
}

/// A subcomplex of a fine scaffold, with the counts that tell what is free.
#[derive(Clone, Debug)]
pub(crate) struct Complex<'a> {
    pub fine: &'a FineScaffold,
    pub vertex_alive: Vec<bool>,
    pub edge_alive: Vec<bool>,
    pub facet_alive: Vec<bool>,
    pub cell_alive: Vec<bool>,
    /// Alive facets at each edge.
    pub edge_count: Vec<u8>,
    /// Alive edges at each vertex.
    pub vertex_count: Vec<u8>,
    pub log: Vec<Step>,
}

impl<'a> Complex<'a> {
    pub fn new(fine: &'a FineScaffold) -> Self {
        Self {
            fine,
            vertex_alive: vec![true; fine.num_vertices()],
            edge_alive: vec![true; fine.num_edges()],
            facet_alive: vec![true; fine.num_facets()],
            cell_alive: vec![true; fine.num_cells()],
            edge_count: (0..fine.num_edges())
                .map(|e| fine.facets_of_edge(e).len() as u8)
                .collect(),
            vertex_count: (0..fine.num_vertices())
                .map(|v| fine.edges_of_vertex(v).count() as u8)
                .collect(),
            log: Vec::new(),
        }
    }

    pub fn betti(&self) -> Betti {
        self.fine.betti_of(
            &self.vertex_alive,
            &self.edge_alive,
            &self.facet_alive,
            &self.cell_alive,
        )
    }

    /// Whether an edge is alive and has exactly one facet.
    #[inline]
    pub fn is_rib(&self, edge: u32) -> bool {
        self.edge_alive[edge as usize] && self.edge_count[edge as usize] == 1
    }

    /// The only alive edge of a vertex when that edge has no facet: the vertex is the tip of a wire.
    #[inline]
    pub fn wire_at_tip(&self, vertex: u32) -> Option<u32> {
        if !self.vertex_alive[vertex as usize] || self.vertex_count[vertex as usize] != 1 {
            return None;
        }
        self.fine
            .edges_of_vertex(vertex as usize)
            .find(|&e| self.edge_alive[e as usize])
            .filter(|&e| self.edge_count[e as usize] == 0)
    }

    /// The free edge of least key of an alive facet; ties to the smaller id.
    pub fn free_edge(&self, facet: u32, key: &[f64]) -> Option<u32> {
        self.fine
            .facet_edges(facet as usize)
            .iter()
            .copied()
            .filter(|&e| self.is_rib(e))
            .min_by(|&a, &b| key[a as usize].total_cmp(&key[b as usize]).then(a.cmp(&b)))
    }

    /// Alive facets at an edge.
    pub fn alive_facets(&self, edge: u32) -> impl Iterator<Item = u32> + '_ {
        self.fine
            .facets_of_edge(edge as usize)
            .iter()
            .copied()
            .filter(|&f| self.facet_alive[f as usize])
    }

    pub fn remove_cell(&mut self, cell: u32, facet: u32) {
        debug_assert!(self.cell_alive[cell as usize] && self.facet_alive[facet as usize]);
        self.cell_alive[cell as usize] = false;
        self.kill_facet(facet);
        self.log.push(Step::RemoveCell { cell, facet });
    }

    pub fn remove_facet(&mut self, facet: u32, edge: u32) {
        debug_assert!(self.facet_alive[facet as usize] && self.is_rib(edge));
        self.kill_facet(facet);
        self.kill_edge(edge);
        self.log.push(Step::RemoveFacet { facet, edge });
    }

    pub fn remove_edge(&mut self, edge: u32, vertex: u32) {
        debug_assert!(self.wire_at_tip(vertex) == Some(edge));
        self.kill_edge(edge);
        self.vertex_alive[vertex as usize] = false;
        self.log.push(Step::RemoveEdge { edge, vertex });
    }

    pub fn add_edge(&mut self, edge: u32, vertex: u32) {
        debug_assert!(!self.edge_alive[edge as usize] && !self.vertex_alive[vertex as usize]);
        self.vertex_alive[vertex as usize] = true;
        self.revive_edge(edge);
        self.log.push(Step::AddEdge { edge, vertex });
    }

    pub fn add_facet(&mut self, facet: u32, edge: u32) {
        debug_assert!(!self.facet_alive[facet as usize] && !self.edge_alive[edge as usize]);
        self.revive_edge(edge);
        self.revive_facet(facet);
        self.log.push(Step::AddFacet { facet, edge });
    }

    /// Takes back the steps after the first `length`, last first. 3-cells are never taken back.
    pub fn undo_to(&mut self, length: usize) {
        while self.log.len() > length {
            let Some(step) = self.log.pop() else { return };
            match step {
                Step::RemoveCell { cell, facet } => {
                    self.revive_facet(facet);
                    self.cell_alive[cell as usize] = true;
                }
                Step::RemoveFacet { facet, edge } => {
                    self.revive_edge(edge);
                    self.revive_facet(facet);
                }
                Step::RemoveEdge { edge, vertex } => {
                    self.vertex_alive[vertex as usize] = true;
                    self.revive_edge(edge);
                }
                Step::AddFacet { facet, edge } => {
                    self.kill_facet(facet);
                    self.kill_edge(edge);
                }
                Step::AddEdge { edge, vertex } => {
                    self.kill_edge(edge);
                    self.vertex_alive[vertex as usize] = false;
                }
            }
        }
    }

    fn kill_facet(&mut self, facet: u32) {
        self.facet_alive[facet as usize] = false;
        for &e in self.fine.facet_edges(facet as usize) {
            self.edge_count[e as usize] -= 1;
        }
    }

    fn revive_facet(&mut self, facet: u32) {
        self.facet_alive[facet as usize] = true;
        for &e in self.fine.facet_edges(facet as usize) {
            self.edge_count[e as usize] += 1;
        }
    }

    fn kill_edge(&mut self, edge: u32) {
        self.edge_alive[edge as usize] = false;
        for v in self.fine.edge_vertices[edge as usize] {
            self.vertex_count[v as usize] -= 1;
        }
    }

    fn revive_edge(&mut self, edge: u32) {
        self.edge_alive[edge as usize] = true;
        for v in self.fine.edge_vertices[edge as usize] {
            self.vertex_count[v as usize] += 1;
        }
    }
}

/// A subcomplex of a fine scaffold by masks, closed under taking faces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Alive {
    /// Vertices.
    pub vertices: Vec<bool>,
    /// Edges.
    pub edges: Vec<bool>,
    /// Facets.
    pub facets: Vec<bool>,
    /// 3-cells (none after a regularisation).
    pub cells: Vec<bool>,
}

impl From<Complex<'_>> for Alive {
    fn from(complex: Complex<'_>) -> Self {
        Self {
            vertices: complex.vertex_alive,
            edges: complex.edge_alive,
            facets: complex.facet_alive,
            cells: complex.cell_alive,
        }
    }
}

/// Replays a log on the whole fine scaffold, checking that every step is an elementary collapse or expansion.
///
/// # Errors
/// The index of the first step that is not one.
pub fn replay(fine: &FineScaffold, log: &[Step]) -> Result<Alive, usize> {
    let mut at = Complex::new(fine);
    let mut cells_of_facet = vec![0u8; fine.num_facets()];
    for &f in &fine.cell_facets {
        cells_of_facet[f as usize] += 1;
    }
    for (i, &step) in log.iter().enumerate() {
        let valid = match step {
            Step::RemoveCell { cell, facet } => {
                at.cell_alive[cell as usize]
                    && at.facet_alive[facet as usize]
                    && cells_of_facet[facet as usize] == 1
                    && fine.facets_of_cell(cell as usize).contains(&facet)
            }
            Step::RemoveFacet { facet, edge } => {
                at.facet_alive[facet as usize]
                    && cells_of_facet[facet as usize] == 0
                    && at.is_rib(edge)
                    && fine.facet_edges(facet as usize).contains(&edge)
            }
            Step::RemoveEdge { edge, vertex } => at.wire_at_tip(vertex) == Some(edge),
            Step::AddFacet { facet, edge } => {
                let ring = fine.facet_edges(facet as usize);
                !at.facet_alive[facet as usize]
                    && ring.contains(&edge)
                    && ring.iter().all(|&e| at.edge_alive[e as usize] == (e != edge))
            }
            Step::AddEdge { edge, vertex } => {
                fine.edge_vertices[edge as usize].contains(&vertex)
                    && !at.vertex_alive[vertex as usize]
                    && at.vertex_alive[fine.other_end(edge as usize, vertex) as usize]
                    && !at.edge_alive[edge as usize]
            }
        };
        if !valid {
            return Err(i);
        }
        match step {
            Step::RemoveCell { cell, facet } => {
                at.remove_cell(cell, facet);
                for &f in fine.facets_of_cell(cell as usize) {
                    cells_of_facet[f as usize] -= 1;
                }
            }
            Step::RemoveFacet { facet, edge } => at.remove_facet(facet, edge),
            Step::RemoveEdge { edge, vertex } => at.remove_edge(edge, vertex),
            Step::AddFacet { facet, edge } => at.add_facet(facet, edge),
            Step::AddEdge { edge, vertex } => at.add_edge(edge, vertex),
        }
    }
    Ok(at.into())
}
