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
