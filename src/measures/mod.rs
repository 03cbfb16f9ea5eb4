//! Measures: what a scaffold says of its shape in the units users ask for.
//!
//! * [`mod@thickness`]: twice the radius of the medial ball that touches each surface point.

pub mod thickness;

pub use thickness::thickness;
