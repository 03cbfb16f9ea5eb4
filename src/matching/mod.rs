//! Matching: who corresponds to whom in two coarse scaffolds, how far apart the shapes are, and which poses they allow.
//!
//! In: two coarse scaffolds. Out: a [`Matching`]: correspondences, edit path, shape distance, hypotheses of the pose.
//!
//! | file | idea |
//! |---|---|
//! | `samples` | a scaffold as points with radii |
//! | `moments`, `dense` | poses from those points |
//! | `signature` | what they are like in any pose |
//! | `evidence` | the elements above a shared cut, weighted by persistence |
//! | `compatibility` | what two elements have in common |
//! | `edit_path` | the way from one to the other, in words and mm |
//! | `correspond` | the front door: assignment, edit path, distance |
//!
//! Bones have few nodes and one large sheet with slits, so discrete matching cannot carry a pose: dense medial points do, and the
//! assignment names elements in that pose. The solvers are in the crate `matchers`, which knows no shapes.

mod compatibility;
mod correspond;
mod dense;
mod edit_path;
mod evidence;
pub(crate) mod moments;
mod result;
mod samples;
mod settings;
mod signature;

pub use correspond::{match_scaffolds, match_scaffolds_at, pose_hypotheses};
pub use result::{
    Correspondences, Edit, EditElement, EditKind, EditOperation, EditSide, Elements, Matching, Pair,
    PoseHypothesis, ShapeDistance,
};
pub use settings::MatchingSettings;
