//! The front door: every stage in order, with defaults, timed. Nothing here computes; it calls.

pub mod alignment;
pub mod change;
pub mod documents;
pub mod error;
pub mod matching;
pub mod scaffold;
pub mod timing;

pub use alignment::{Aligned, align_on, move_shape, structure_surface};
pub use change::{ChangeRun, ChangeRunSettings, change_of};
pub use error::{PipelineError, StageError};
pub use matching::{MatchRun, MatchSettings, MatchSide, match_shapes};
pub use scaffold::{ScaffoldRun, ScaffoldSettings, scaffold};
pub use timing::{Observer, StageTime, Stages};
