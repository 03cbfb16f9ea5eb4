//! Geometry that every stage may use and that knows no stage: ids, triangle meshes and their topology, rigid
//! motions, lengths with units. Topology modules take ids only; coordinates enter by name.

pub mod ids;
pub mod length;
pub mod mesh;
pub mod rigid;

pub use ids::{CurveId, NodeId, SheetId, TetId, VertexId};
pub use length::{Length, LengthError, LengthScale};
pub use mesh::{MeshTopology, TriangleMesh};
pub use rigid::Rigid;
