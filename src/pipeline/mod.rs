//! The front door: every stage in order, with defaults, timed. Nothing here computes; it calls.

pub mod documents;
pub mod error;
pub mod scaffold;
pub mod timing;

pub use error::{PipelineError, StageError};
pub use scaffold::{ScaffoldRun, ScaffoldSettings, scaffold};
pub use timing::{Observer, StageTime, Stages};
