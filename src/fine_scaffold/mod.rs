//! Fine scaffold: the dual 2-complex of one side's interior simplices.
//!
//! In: the triangulation and the inside labels. Out: [`FineScaffold`]: vertices (inside tetrahedra), edges (triangles
//! between two of them), facets (Delaunay edges with a closed ring of inside tetrahedra) and 3-cells (generators whose whole star is
//! inside), each with radius and generators.
//!
//! * [`domain`]: the part of space whose scaffold it is; `carve` ends that of an open surface;
//! * [`complex`]: the complex as data, and its Betti numbers;
//! * [`build`]: [`fine_scaffold`], the front function;
//! * [`solid`]: the solid's Betti numbers by another route, to check against.

pub mod build;
mod carve;
pub mod complex;
pub mod domain;
pub mod solid;

pub use build::{FineScaffoldError, FineScaffoldSettings, Side, fine_scaffold, fine_scaffold_of};
pub use complex::{Betti, FineScaffold};
pub use domain::Domain;
pub use solid::{mesh_betti, solid_betti, solid_betti_of};
