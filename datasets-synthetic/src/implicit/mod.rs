//! Implicit solids: functions that are negative inside, zero on the surface, positive outside.
//!
//! * [`field`]: primitives and the ways to combine them ([`Field`]);
//! * [`polygonise`]: a closed 2-manifold mesh of a field, with its vertices **on** the surface;
//! * [`remesh`]: the mesh made even, by collapses, flips and relaxation that keep the topology.

pub mod field;
pub mod polygonise;
pub mod remesh;

pub use field::Field;
pub use polygonise::{PolygoniseError, mesh_with_edge_length, mesh_with_triangles};
