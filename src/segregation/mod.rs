//! Segregation: splitting the full scaffold into the part that crosses the surface (triangles) and the rest.
//!
//! In: the triangulation, and the known surface when the input has one. Out: [`Segregation`]: the surface mesh over the
//! generators and the inside/outside label of every tetrahedron.

pub mod labels;

pub use labels::Segregation;
