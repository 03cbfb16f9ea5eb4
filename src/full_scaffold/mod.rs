//! Full scaffold: flow types, arcs and sinks of the medial scaffold of all generators, by exact signs (Leymarie & Kimia
//! 2007), read off the Delaunay triangulation.

pub mod flow;

pub use flow::{CriticalCounts, FlowType};
