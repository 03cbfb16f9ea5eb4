//! Full scaffold: flow types, arcs and sinks of the medial scaffold of all generators, by exact signs (Leymarie & Kimia
//! 2007), read off the Delaunay triangulation.

mod facets;
pub mod flow;
mod four;
pub mod merged;
pub mod planar;
pub mod scaffold;
mod spheres;

pub use flow::{CriticalCounts, FlowType};
pub use merged::DegenerateVertex;
pub use planar::PlanarScaffold;
pub use scaffold::{Arc, FullScaffold, UnboundedCurve, full_scaffold};
