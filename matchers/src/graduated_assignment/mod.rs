//! Graduated assignment: who corresponds to whom, by annealing coupled soft assignments.
//!
//! * [`objective`]: the quadratic gain over blocks of assignment variables, and that of hypergraphs
//! * [`sinkhorn`]: balancing with slack, stable at any temperature
//! * [`anneal`](mod@anneal): the annealing loop
//! * [`starts`]: uniform, spectral, hypotheses
//! * [`discrete`]: LSAP discretisation, block ascent, local search
//! * [`multistart`]: several starts, the best end
//! * [`hypergraphs`]: the front door for hypergraphs
//! * [`pairwise`]: the front door for ordinary graphs
//!
//! S. Gold, A. Rangarajan, "A graduated assignment algorithm for graph matching", IEEE PAMI 18(4), 1996.
//! M.-C. Chang, B. B. Kimia, "Measuring 3D shape similarity by matching the medial scaffolds", 3DIM 2009.

pub mod anneal;
pub mod discrete;
pub mod hypergraphs;
pub mod multistart;
pub mod objective;
pub mod pairwise;
pub mod sinkhorn;
pub mod starts;

pub use anneal::AnnealSettings;
pub use hypergraphs::{HypergraphMatch, MatchedPair, match_hypergraphs};
pub use multistart::MatchSettings;
pub use pairwise::{PairwiseError, PairwiseMatch, PairwiseProblem, match_graphs};
pub use starts::StartKind;
