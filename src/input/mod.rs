//! Input: a file becomes a [`Shape`] in LPS millimetres; nothing is repaired silently.

pub mod shape;

pub use shape::{Generators, Geometry, LabelMap, PointCloud, Provenance, Shape, SourceFormat};
