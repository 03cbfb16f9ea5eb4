//! The triangulation as data: tetrahedra, their neighbours, and ghosts at infinity. Topology only, but for the points that
//! are kept beside it by name.
//!
//! Conventions, relied on by every later stage:
//! * A finite tetrahedron `[a, b, c, d]` is positively oriented: `(b - a) x (c - a) . (d - a) > 0`.
//! * Facet `i` of a tetrahedron is opposite its vertex `i`; [`Triangulation::facet_vertices`] lists it counter-clockwise
//!   seen from outside the tetrahedron.
//! * A ghost is a tetrahedron with the vertex [`INFINITE`] in place 3; its facet 3 is a hull triangle. Its orientation
//!   is the one a point far outside would give.
//! * Finite tetrahedra come first, ghosts after; both are sorted by their vertices, so ids are canonical.
//! * Fewer than four affinely independent points make no tetrahedra; `dimension` says so.

use crate::geometry::{TetId, VertexId};
use glam::DVec3;

/// The vertex at infinity.
pub const INFINITE: VertexId = VertexId(u32::MAX);

/// A facet: a tetrahedron and which of its four facets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Facet {
    /// The tetrahedron.
    pub tet: TetId,
    /// Index of the opposite vertex, 0 to 3.
    pub index: u8,
}

/// A 3D Delaunay triangulation; see the module for the conventions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangulation {
    /// Distinct points in lexicographic order, mm; `VertexId(i)` is `points[i]`.
    pub points: Vec<DVec3>,
    /// Affine dimension of the points, 0 to 3 (0 also without points).
    pub dimension: u8,
    /// Four vertices a tetrahedron, finite ones first.
    pub(crate) vertices: Vec<[VertexId; 4]>,
    /// Neighbour opposite each vertex, packed as `4 * tet + index of the shared facet in the neighbour`.
    pub(crate) neighbours: Vec<[u32; 4]>,
    /// Number of finite tetrahedra.
    pub(crate) finite: u32,
}

/// Vertex places of facet `i`, counter-clockwise seen from outside a positively oriented tetrahedron.
const FACET: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

impl Triangulation {
    /// Number of tetrahedra, ghosts included.
    pub fn num_tets(&self) -> usize {
        self.vertices.len()
    }

    /// Number of finite tetrahedra; they have ids below this.
    pub fn num_finite(&self) -> usize {
        self.finite as usize
    }

    /// All tetrahedra, ghosts last.
    pub fn tets(&self) -> impl ExactSizeIterator<Item = TetId> + use<> {
        (0..self.vertices.len() as u32).map(TetId)
    }

    /// All finite tetrahedra.
    pub fn finite_tets(&self) -> impl ExactSizeIterator<Item = TetId> + use<> {
        (0..self.finite).map(TetId)
    }

    /// Whether a tetrahedron is finite.
    #[inline]
    pub fn is_finite(&self, tet: TetId) -> bool {
        tet.0 < self.finite
    }

    /// The four vertices of a tetrahedron.
    #[inline]
    pub fn tet(&self, tet: TetId) -> [VertexId; 4] {
        self.vertices[tet.index()]
    }

    /// The positions of the vertices of a finite tetrahedron.
    #[inline]
    pub fn corners(&self, tet: TetId) -> [DVec3; 4] {
        debug_assert!(self.is_finite(tet));
        self.vertices[tet.index()].map(|v| self.points[v.index()])
    }

    /// The same facet seen from the other side.
    #[inline]
    pub fn mirror(&self, facet: Facet) -> Facet {
        let packed = self.neighbours[facet.tet.index()][facet.index as usize];
        Facet {
            tet: TetId(packed >> 2),
            index: (packed & 3) as u8,
        }
    }

    /// The neighbour across facet `index` (opposite vertex `index`).
    #[inline]
    pub fn neighbour(&self, tet: TetId, index: usize) -> TetId {
        TetId(self.neighbours[tet.index()][index] >> 2)
    }

    /// The three vertices of a facet, counter-clockwise seen from outside its tetrahedron.
    #[inline]
    pub fn facet_vertices(&self, facet: Facet) -> [VertexId; 3] {
        let v = self.vertices[facet.tet.index()];
        FACET[facet.index as usize].map(|k| v[k])
    }

    /// Each facet once, as seen from the tetrahedron of smaller id.
    pub fn facets(&self) -> impl Iterator<Item = Facet> + '_ {
        self.tets()
            .flat_map(move |tet| (0..4u8).map(move |index| Facet { tet, index }))
            .filter(|&f| f < self.mirror(f))
    }
}
