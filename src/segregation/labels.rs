//! The result of segregation, whatever route made it.

use crate::delaunay::{Facet, Triangulation};
use crate::geometry::{TetId, TriangleMesh, VertexId};

/// Surface triangles over the generators and the side of every tetrahedron.
#[derive(Clone, Debug, Default)]
pub struct Segregation {
    /// Surface triangles, counter-clockwise seen from outside where the surface is orientable.
    pub triangles: Vec<[VertexId; 3]>,
    /// Inside label of every tetrahedron, ghosts (never inside) included; empty when the surface is open and has no inside.
    pub inside: Vec<bool>,
    /// Whether the surface was taken to be closed.
    pub closed: bool,
    /// Triangles near crossings of an open surface that are no facets of the triangulation; the scaffold has no walls there.
    pub loose: usize,
    /// What a user should know, in plain words.
    pub warnings: Vec<String>,
}

impl Segregation {
    /// Whether a tetrahedron is inside.
    #[inline]
    pub fn is_inside(&self, tet: TetId) -> bool {
        self.inside.get(tet.index()).copied().unwrap_or(false)
    }

    /// The surface as a mesh whose points are all generators (used or not), in their order.
    pub fn surface(&self, triangulation: &Triangulation) -> TriangleMesh {
        mesh_of(triangulation, &self.triangles)
    }
}

/// Triangles over the generators as a mesh whose points are all generators.
pub fn mesh_of(triangulation: &Triangulation, triangles: &[[VertexId; 3]]) -> TriangleMesh {
    TriangleMesh {
        points: triangulation.points.clone(),
        triangles: triangles.iter().map(|t| t.map(|v| v.0)).collect(),
    }
}

/// The facets between inside and outside, each as seen from its inside tetrahedron, in the order of the tetrahedra.
/// `inside` is indexed by [`TetId`], ghosts (never inside) included. `O(n)`.
pub fn boundary_facets(triangulation: &Triangulation, inside: &[bool]) -> Vec<Facet> {
    let mut out = Vec::new();
    for tet in triangulation.finite_tets().filter(|t| inside[t.index()]) {
        for index in 0..4u8 {
            if !inside[triangulation.neighbour(tet, index as usize).index()] {
                out.push(Facet { tet, index });
            }
        }
    }
    out
}

/// The triangles of [`boundary_facets`], counter-clockwise seen from outside the solid, smallest vertex first.
pub fn boundary_triangles(triangulation: &Triangulation, inside: &[bool]) -> Vec<[VertexId; 3]> {
    boundary_facets(triangulation, inside)
        .into_iter()
        .map(|f| smallest_first(triangulation.facet_vertices(f)))
        .collect()
}

/// The same oriented triangle written from its smallest vertex.
pub(super) fn smallest_first([a, b, c]: [VertexId; 3]) -> [VertexId; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}
