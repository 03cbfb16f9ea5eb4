//! Fine scaffold: the dual 2-complex of one side's interior simplices.
//!
//! In: the triangulation and the inside labels. Out: [`FineScaffold`]: vertices (inside tetrahedra), edges (triangles
//! between two of them), facets (Delaunay edges with a closed ring of inside tetrahedra) and 3-cells (generators whose whole star is
//! inside), each with radius and generators.

pub mod complex;

pub use complex::{Betti, FineScaffold};
