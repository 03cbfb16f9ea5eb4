//! The linear sum assignment problem (LSAP), rectangular, with forbidden pairs and dual bounds.
//!
//! In: a [`Table`](crate::Table) of costs (`+inf` forbids a pair). Out: the cheapest one-to-one assignment of the shorter side, its
//! cost, and the dual prices that prove it.
//!
//! * [`jonker_volgenant`]: the solver
//! * [`partial`]: every element may also stay unmatched at a price (what matching and edit distances need)

pub mod jonker_volgenant;
pub mod partial;

pub use jonker_volgenant::{Assignment, AssignmentError, solve, solve_max};
pub use partial::{PartialAssignment, solve_partial};
