//! Pose from matched points: weighted fits, consistent sets, robust estimation.
//!
//! In: source points and target points, pair by pair, some of the pairs wrong. Out: `T_target_source`, which takes
//! source coordinates to target coordinates, and which pairs were right.
//!
//! * [`fit`]: weighted least squares (Kabsch; Umeyama with scale)
//! * [`clique`]: exact maximum clique
//! * [`consistency`]: which pairs agree on lengths
//! * [`gnc`]: truncated least squares by graduated non-convexity
//! * [`robust`]: the front door: consistency, clique, GNC, re-collection
//!
//! Lengths are in the unit of the points given.

pub mod clique;
pub mod consistency;
pub mod fit;
pub mod gnc;
pub mod robust;

pub use clique::{Clique, Graph, max_clique};
pub use consistency::{ScaleRange, consistency_graph};
pub use fit::{Pose, PoseError, fit_rigid, fit_similarity};
pub use gnc::{GncFit, GncSettings, fit_gnc};
pub use robust::{RobustPose, RobustPoseSettings, robust_pose};
