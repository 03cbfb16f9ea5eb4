//! Attributed hypergraph matching and robust pose. Knows nothing of shapes.
//!
//! ```text
//! AttributedHypergraph x 2, ElementCosts            (nodes, curves, sheets; weight = evidence)
//!   --matching_problem--> MatchingProblem           one objective: the cost of an edit, in the weights' unit
//!       --graduated_assignment--> who is whom       (soft, annealed, then discrete)
//!       --edit_distance--> how far apart            (exact or bracketed, with the edit path)
//! matched points
//!       --pose--> T_target_source                   (consistency clique, GNC-TLS, weighted Kabsch)
//! ```
//!
//! Modules in the order the data flows:
//!
//! * [`table`]: dense row-major numbers, one row an element of the target, one column an element of the source
//! * [`hypergraph`]: nodes, curves (loops and parallel curves allowed), sheets, corners, weights, attributes
//! * [`matching_problem`]: two hypergraphs and their costs as one quadratic objective
//! * [`canonical`]: an order of elements that does not depend on how the graphs were stored
//! * [`assignment`]: the linear sum assignment problem, rectangular, with forbidden pairs and dual bounds
//! * [`graduated_assignment`]: coupled soft assignments of nodes, curves and sheets; also ordinary graphs
//! * [`edit_distance`]: the least price of turning one hypergraph into the other, and the path
//! * [`pose`]: weighted rigid and similarity fits, maximum consistent sets, graduated non-convexity
//!
//! Sources, besides those named in the modules: S. Gold, A. Rangarajan, "A graduated assignment algorithm for graph matching", IEEE PAMI 18
//! (1996); M.-C. Chang, B. B. Kimia, "Measuring 3D shape similarity by matching the medial scaffolds", 3DIM 2009; K. Riesen, H. Bunke, "Approximate
//! graph edit distance computation by means of bipartite graph matching", Image and Vision Computing 27 (2009); T. B. Sebastian, P. N. Klein,
//! B. B. Kimia, "Recognition of shapes by editing their shock graphs", IEEE PAMI 26 (2004); H. Yang, P. Antonante, V. Tzoumas, L. Carlone,
//! "Graduated non-convexity for robust spatial perception", IEEE RA-L 5 (2020).
//!
//! ```
//! use matchers::pose::{RobustPoseSettings, robust_pose};
//! use nalgebra::{Isometry3, Point3, Vector3};
//! // Eight right pairs and four wrong ones.
//! let motion = Isometry3::new(Vector3::new(4.0, -1.0, 2.0), Vector3::new(0.3, 1.1, -0.4));
//! let from: Vec<Point3<f64>> = (0..12)
//!     .map(|k| Point3::new((k * k % 7) as f64, (3 * k % 5) as f64, (k % 4) as f64))
//!     .collect();
//! let mut to: Vec<Point3<f64>> = from.iter().map(|p| motion * p).collect();
//! to[8..].reverse();
//! let settings = RobustPoseSettings { inlier_bound: 0.1, ..Default::default() };
//! let found = robust_pose(&from, &to, &[1.0; 12], &settings)?;
//! assert!((found.pose.T_target_source.to_homogeneous() - motion.to_homogeneous()).norm() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Everything is deterministic: no result depends on threads, hash order, the clock or an unseeded generator.

pub mod assignment;
pub mod canonical;
pub mod edit_distance;
pub mod graduated_assignment;

pub mod hypergraph;
pub mod matching_problem;
pub mod pose;

pub mod table;

pub use assignment::{Assignment, AssignmentError};
pub use hypergraph::{AttributedHypergraph, CurveEnds, CurveId, HypergraphError, NodeId, SheetId};
pub use matching_problem::{ElementCosts, EvidenceSettings, MatchingProblem};
pub use table::Table;

/// The example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
