//! What can be wrong with the input of a segregation.

use thiserror::Error;

/// Why a segregation is refused.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SegregationError {
    /// Too few points, or all on one plane, line or spot: there are no tetrahedra to label.
    #[error(
        "{points} points that span {dimension} of 3 dimensions cannot enclose anything; give at least four that do not lie in a plane"
    )]
    FewPoints {
        /// Distinct points.
        points: usize,
        /// Dimension they span.
        dimension: u8,
    },
    /// A coordinate is not a finite number.
    #[error("point {index} is ({x}, {y}, {z}), which is not finite; remove it or mend the file")]
    NotFinite {
        /// Place in the input, from 0.
        index: usize,
        /// Coordinates as given.
        x: f64,
        /// Coordinates as given.
        y: f64,
        /// Coordinates as given.
        z: f64,
    },
    /// The known surface has a border, so it has no inside.
    #[error(
        "the known surface of {triangles} triangles has {boundary_edges} open edges and so no inside; repair it (`--repair`) or treat it as a cloud"
    )]
    OpenSurface {
        /// Edges with one triangle.
        boundary_edges: usize,
        /// Triangles of the surface.
        triangles: usize,
    },
    /// The component asked for does not exist.
    #[error("component {asked} was asked for, but the cloud has {found}, numbered from 0 (largest first)")]
    NoSuchComponent {
        /// The number asked for.
        asked: usize,
        /// Components found.
        found: usize,
    },
    /// A triangle of the mesh to repair names a point that does not exist.
    #[error("triangle {triangle} refers to point {point}, but there are {points}")]
    BadTriangle {
        /// Place in the input, from 0.
        triangle: usize,
        /// The point it names.
        point: u32,
        /// Points of the mesh.
        points: usize,
    },
    /// The triangulation refused the prepared points.
    #[error("the points cannot be triangulated: {0}")]
    Triangulation(#[from] crate::delaunay::DelaunayError),
}
