//! The fine scaffold as data: a cell complex dual to the simplices in the interior of the solid.
//!
//! Duality: inside tetrahedron -> vertex (at its circumcentre), triangle between two inside tetrahedra -> edge, Delaunay edge
//! whose every tetrahedron is inside -> polygonal facet (its ring of tetrahedra), generator whose every
//! tetrahedron is inside -> 3-cell. The complex is a deformation retract of the solid's interior.

use crate::geometry::mesh::DisjointSets;
use crate::geometry::{LengthScale, TetId, VertexId};
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

/// No element.
pub const NONE: u32 = u32::MAX;

/// A polygonal 2-complex (with 3-cells while any are left), in structure-of-arrays form.
///
/// Elements are never renumbered: simplification marks them dead in masks of its own.
#[derive(Clone, Debug)]
pub struct FineScaffold {
    /// Diagonal of the bounding box of the generators, and spacing `sqrt(area of the solid's boundary / generators on it)`, mm.
    pub scale: LengthScale,
    /// Position of every generator, mm; `VertexId(i)` is `generator_position[i]`.
    pub generator_position: Vec<DVec3>,
    /// A quarter of the volume of each generator's tetrahedra of this side, mm^3; the sum is the solid's volume.
    pub generator_volume: Vec<f64>,
    /// Component of the complement of the complex that each generator lies in (a generator with a 3-cell is alone in its
    /// own). Two generators share one when tetrahedra of the other side join them; numbered by smallest generator.
    pub generator_region: Vec<u32>,
    /// Number of components of the complement, those of 3-cells included.
    pub num_regions: u32,
    /// Position of each vertex: the circumcentre of its tetrahedron, mm (its centroid where the circumcentre is far on the other side).
    pub vertex_position: Vec<DVec3>,
    /// Radius of each vertex: the circumradius, mm.
    pub vertex_radius: Vec<f64>,
    /// Whether the circumcentre lies on the other side of the surface (spikes of flat tetrahedra; none with labels by
    /// circumcentre).
    pub vertex_outside: Vec<bool>,
    /// The edges of each vertex, one a facet of its tetrahedron; [`NONE`] where the neighbour is on the other side.
    pub vertex_edges: Vec<[u32; 4]>,
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

    /// Number of 3-cells.
    pub fn num_cells(&self) -> usize {
        self.cell_generator.len()
    }

    /// Facets of a 3-cell.
    pub fn facets_of_cell(&self, cell: usize) -> &[u32] {
        &self.cell_facets[self.cell_facet_start[cell] as usize..self.cell_facet_start[cell + 1] as usize]
    }

    /// The edges of a vertex that exist.
    pub fn edges_of_vertex(&self, vertex: usize) -> impl Iterator<Item = u32> + '_ {
        self.vertex_edges[vertex].iter().copied().filter(|&e| e != NONE)
    }

    /// The other end of an edge.
    #[inline]
    pub fn other_end(&self, edge: usize, vertex: u32) -> u32 {
        let [a, b] = self.edge_vertices[edge];
        a ^ b ^ vertex
    }

    /// Radius of a vertex with the sign of its side: negative where the circumcentre lies outside the solid.
    #[inline]
    pub fn signed_radius(&self, vertex: usize) -> f64 {
        if self.vertex_outside[vertex] {
            -self.vertex_radius[vertex]
        } else {
            self.vertex_radius[vertex]
        }
    }

    /// Volume of the solid, mm^3.
    pub fn solid_volume_mm3(&self) -> f64 {
        self.generator_volume.iter().sum()
    }

    /// Betti numbers of the whole complex; see [`FineScaffold::betti_of`].
    pub fn betti(&self) -> Betti {
        self.betti_of(
            &vec![true; self.num_vertices()],
            &vec![true; self.num_edges()],
            &vec![true; self.num_facets()],
            &vec![true; self.num_cells()],
        )
    }

    /// Betti numbers of a subcomplex given by masks (which must be closed under taking faces).
    ///
    /// `b0` by union-find over edges; `b2` by Alexander duality: the bounded components of the complement, which are
    /// unions of Voronoi cells joined across absent facets (3-cells that are present are not part of the complement); `b1`
    /// from the Euler number. `O(n a(n))`.
    pub fn betti_of(&self, vertices: &[bool], edges: &[bool], facets: &[bool], cells: &[bool]) -> Betti {
        let count = |mask: &[bool]| mask.iter().filter(|&&alive| alive).count() as i64;
        let euler = count(vertices) - count(edges) + count(facets) - count(cells);
        let mut parts = DisjointSets::new(self.num_vertices());
        let mut b0 = count(vertices);
        for (e, _) in edges.iter().enumerate().filter(|(_, alive)| **alive) {
            let [a, b] = self.edge_vertices[e];
            b0 -= i64::from(parts.union(a, b));
        }
        let mut regions = DisjointSets::new(self.num_regions as usize);
        let mut b2 = i64::from(self.num_regions) - count(cells) - 1;
        for (f, _) in facets.iter().enumerate().filter(|(_, alive)| !**alive) {
            let [a, b] = self.facet_generators[f].map(|g| self.generator_region[g.index()]);
            b2 -= i64::from(regions.union(a, b));
        }
        Betti {
            b0,
            b1: b0 + b2 - euler,
            b2,
        }
    }
}
