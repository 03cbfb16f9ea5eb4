//! Geometry that every stage may use and that knows no stage: ids, triangle meshes and their topology, rigid
//! motions, lengths with units, neighbours, closest points, inside and outside. Topology modules take ids only; coordinates
//! enter by name.

pub mod circumsphere;
pub mod closest;
mod expansion;
pub(crate) mod fixed;
pub mod ids;
pub mod length;
pub mod mesh;
pub mod neighbours;
pub mod predicates;
pub mod pseudonormals;
pub mod rigid;
pub mod winding;

pub use circumsphere::Sphere;
pub use closest::{ClosestOnMesh, ClosestPoint, SignedDistance};
pub use ids::{CurveId, NodeId, SheetId, TetId, VertexId};
pub use length::{Length, LengthError, LengthScale};
pub use mesh::{MeshTopology, TriangleMesh};
pub use neighbours::{Neighbour, Neighbours};
pub use pseudonormals::Pseudonormals;
pub use rigid::Rigid;
pub use winding::WindingNumber;
