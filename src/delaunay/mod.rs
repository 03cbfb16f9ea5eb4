//! Delaunay: the canonical 3D Delaunay triangulation of the generators, by exact predicates.
//!
//! In: distinct finite points in lexicographic coordinate order. Out: [`Triangulation`], a function of the point *set*
//! alone: cospherical ties are broken by coordinates, tetrahedra are numbered canonically, so no order of insertion and no
//! thread count can be seen in the result.

pub mod triangulation;

pub use triangulation::{Facet, Triangulation};
