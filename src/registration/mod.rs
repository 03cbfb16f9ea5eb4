//! Registration: the pose of one shape on another, verified on their surfaces.
//!
//! In: two [`RegistrationShape`]s in any pose (surface mesh or cloud, optionally the coarse scaffold). Out: a
//! [`Registration`]: `T_target_source`, how well it fits, what else it could be, which motions are loose.
//!
//! 1. [`oriented`](self): both surfaces become oriented samples; raw clouds lose what lies alone
//!    and are de-noised.
//! 2. Whole shapes: first guesses from moments and scaffolds, refined on the surfaces, symmetric distance decides.
//! 3. Partial shapes, when the surfaces ask for it: poses from oriented point pairs, at several sizes when the size is unknown; free space decides.
//! 4. Ambiguity, conditioning, precision and overlap of the chosen pose.
//!
//! | file | idea |
//! |---|---|
//! | `shape`, `settings`, `result` | what goes in and what comes out |
//! | `oriented`, `isolated`, `outer`, `denoise`, `walls`, `cells`, `nearest_grid`, `exact` | a surface prepared for search |
//! | `faces` | which hand and which face of a thin sheet may be outside |
//! | `surface` | whole shapes |
//! | `partial`, `pairs`, `sizes` | partial shapes, also of unknown size |
//! | `score`, `refine`, `solve` | shared by both: free space, closest points, one linear step |
//! | `significance` | whether one whole pose is better than another by more than the shapes differ |
//! | `precision` | how precisely the pose is known |
//! | `verdict` | which pose is reported |
//! | `doubts` | what is said of it |
//! | [`naming`] | which shape of one set is which of another |
//! | [`difference`](mod@difference) | what is left between the shapes in that pose |
//!
//! Everything is seeded; parallel parts keep their order, so results are equal for any number of threads.

mod cells;
mod denoise;
pub mod difference;
mod doubts;
mod exact;
mod faces;
mod isolated;
pub mod naming;
mod nearest_grid;
mod oriented;
mod outer;
mod pairs;
mod partial;
mod precision;
mod refine;
mod result;
mod score;
mod settings;
mod shape;
mod significance;
mod sizes;
mod solve;
mod surface;
mod verdict;
mod walls;

pub use denoise::{CleanCloud, clean_cloud};
pub use difference::{Difference, SheetContext, SheetDifference, difference};
pub use naming::{NamedPair, Naming, NamingSettings, name_shapes};
pub use result::{
    AxisPrecision, Conditioning, Hypothesis, Method, Precision, Registration, SlidingDirection,
};
pub use settings::{Extent, Mirror, RegistrationSettings};
pub use shape::{RegistrationError, RegistrationShape, Surface};
pub use verdict::register;
