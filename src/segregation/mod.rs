//! Segregation: splitting the full scaffold into the part that crosses the surface (triangles) and the rest.
//!
//! In: the triangulation, and the known surface when the input has one. Out: [`Segregation`]: the surface mesh over the
//! generators and the inside/outside label of every tetrahedron.
//!
//! * [`known_surface`]: a mesh or mask says where its surface is; one winding number a region;
//!   [`refine`] adds generators where that does not give the surface's topology.

pub mod balls;
pub mod error;
pub mod flood;
pub mod known_queries;
pub mod known_surface;
pub mod labels;
pub mod refine;
mod stars;

pub use balls::Balls;
pub use error::SegregationError;
pub use known_queries::KnownSurface;
pub use known_surface::{
    KnownSurfaceReport, KnownSurfaceSegregation, KnownSurfaceSettings, RefinementPlace, RefinementReason,
    segregate_known,
};
pub use labels::{Segregation, boundary_facets, boundary_triangles};
pub use refine::{RefinedSegregation, segregate_known_refined};
