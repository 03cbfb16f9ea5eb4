//! The result of segregation, whatever route made it.

use crate::delaunay::Triangulation;
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
        TriangleMesh {
            points: triangulation.points.clone(),
            triangles: self.triangles.iter().map(|t| t.map(|v| v.0)).collect(),
        }
    }
}
