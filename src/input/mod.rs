//! Input: a file becomes a [`Shape`] in LPS millimetres; nothing is repaired silently.
//!
//! * [`read`]: the front door, [`read_shape`]; frame, units, label, what cannot be used.
//! * `formats`: one reader a format, on a cursor that knows its place (`scan`, `scalar`, `decompress`).
//! * [`error`]: what can be wrong and how it is said.
//! * [`shape`]: what comes out.
//! * [`mod@check`]: what is in a file and is it usable. [`mod@repair`]: only when asked, with a list of what was changed.
//! * [`sampling`]: from a shape to generators.

pub mod check;
mod decompress;
pub mod error;
mod formats;
mod parsed;
pub mod read;
pub mod repair;
pub mod sampling;
mod scalar;
mod scan;
pub mod shape;

pub use check::{CheckContent, CheckReport, Problem, Purpose, Severity, Use, check};
pub use error::{Fault, Flaw, Place, ReadError};
pub use parsed::{Frame, Units};
pub use read::{ReadSettings, read_bytes, read_shape};
pub use repair::{RepairSettings, Repaired, repair};
pub use sampling::{
    LabelSurface, LabelSurfaceSettings, Sampling, SamplingError, SamplingSettings, label_surface, sample,
    sample_mesh,
};
pub use shape::{Generators, Geometry, LabelCount, LabelMap, PointCloud, Provenance, Shape, SourceFormat};
