//! The fine scaffold as data: a cell complex dual to the simplices in the interior of the solid.
//!
//! Duality: inside tetrahedron -> vertex (at its circumcentre), triangle between two inside tetrahedra -> edge, Delaunay edge
//! whose every tetrahedron is inside -> polygonal facet (its ring of tetrahedra), generator whose every
//! tetrahedron is inside -> 3-cell. The complex is a deformation retract of the solid's interior.

use crate::geometry::{TetId, VertexId};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Betti numbers: components, tunnels, cavities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "[i64; 3]", into = "[i64; 3]")]
pub struct Betti {
    /// Components.
    pub b0: i64,
    /// Tunnels.
    pub b1: i64,
    /// Cavities.
    pub b2: i64,
}

impl From<[i64; 3]> for Betti {
    fn from([b0, b1, b2]: [i64; 3]) -> Self {
        Self { b0, b1, b2 }
    }
}

impl From<Betti> for [i64; 3] {
    fn from(b: Betti) -> Self {
        [b.b0, b.b1, b.b2]
    }
}

/// A polygonal 2-complex (with 3-cells while any are left), in structure-of-arrays form.
///
/// Elements are never renumbered: simplification marks them dead in masks of its own.
#[derive(Clone, Debug, Default)]
pub struct FineScaffold {
    /// Position of each vertex: the circumcentre of its tetrahedron, mm.
    pub vertex_position: Vec<DVec3>,
    /// Radius of each vertex: the circumradius, mm.
    pub vertex_radius: Vec<f64>,
    /// Tetrahedron each vertex is dual to.
    pub vertex_tet: Vec<TetId>,
    /// End vertices of each edge, smaller first.
    pub edge_vertices: Vec<[u32; 2]>,
    /// Delaunay triangle each edge is dual to.
    pub edge_generators: Vec<[VertexId; 3]>,
    /// The two generators of each facet (the Delaunay edge it is dual to), smaller first.
    pub facet_generators: Vec<[VertexId; 2]>,
    /// Start of each facet's ring in `ring_vertices` and `ring_edges`; one more entry than facets.
    pub facet_start: Vec<u32>,
    /// Vertices of each facet in cyclic order.
    pub ring_vertices: Vec<u32>,
    /// Edges of each facet in cyclic order; `ring_edges[k]` joins `ring_vertices[k]` and the next.
    pub ring_edges: Vec<u32>,
    /// Start of each edge's facets in `edge_facets`; one more entry than edges.
    pub edge_facet_start: Vec<u32>,
    /// Facets incident to each edge, ascending.
    pub edge_facets: Vec<u32>,
    /// Generators with a 3-cell.
    pub cell_generator: Vec<VertexId>,
    /// Start of each 3-cell's facets in `cell_facets`; one more entry than 3-cells.
    pub cell_facet_start: Vec<u32>,
    /// Facets of each 3-cell, ascending.
    pub cell_facets: Vec<u32>,
}

impl FineScaffold {
    /// Number of vertices.
    pub fn num_vertices(&self) -> usize {
        self.vertex_radius.len()
    }

    /// Number of edges.
    pub fn num_edges(&self) -> usize {
        self.edge_vertices.len()
    }

    /// Number of facets.
    pub fn num_facets(&self) -> usize {
        self.facet_generators.len()
    }

    /// Ring of a facet: its vertices in cyclic order.
    pub fn facet_vertices(&self, facet: usize) -> &[u32] {
        &self.ring_vertices[self.facet_start[facet] as usize..self.facet_start[facet + 1] as usize]
    }

    /// Ring of a facet: its edges in cyclic order.
    pub fn facet_edges(&self, facet: usize) -> &[u32] {
        &self.ring_edges[self.facet_start[facet] as usize..self.facet_start[facet + 1] as usize]
    }

    /// Facets incident to an edge.
    pub fn facets_of_edge(&self, edge: usize) -> &[u32] {
        &self.edge_facets[self.edge_facet_start[edge] as usize..self.edge_facet_start[edge + 1] as usize]
    }
}
