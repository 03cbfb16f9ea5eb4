//! Edit distance of hypergraphs: the least price of turning one into the other, with the path that costs it.
//!
//! Operations, all priced in the unit of the weights:
//!
//! * **deform** an element into one of the other graph: its cost, and what its incidences change by;
//! * **splice** an element away (from either graph): its weight, and its incidences;
//! * **contract** a curve, so that its two end nodes become one: the price that the curve names;
//! * **merge** two curves across a node, or two sheets across a curve, where all else that met there is gone: what splicing the node or
//!   curve costs.
//!
//! With deform and splice alone the distance is a pseudo-metric whenever the costs are metric and respect the weights
//! ([`crate::matching_problem`]). With contract and merge it is symmetric and zero for equal graphs, and obeys the
//! triangle inequality up to what a healed element can differ from its parts. (T. B. Sebastian, P. N. Klein, B. B. Kimia, "Recognition of
//! shapes by editing their shock graphs", IEEE PAMI 26, 2004, for trees, where a dynamic programme finds the distance; scaffolds have cycles.)
//!
//! * [`costs`]: deformation costs of single and healed elements
//! * [`shares`]: the bound, made tight by dual ascent
//! * [`branch_and_bound`]: exact search, for fixed graphs
//! * [`healing`]: contract and merge
//! * `optimism`: what heals may at best save on one graph
//! * `healed_search`: exact search over maps and heals together
//! * [`operations`]: the edit path
//! * [`distance`]: the front door

pub mod branch_and_bound;
pub mod costs;
pub mod distance;
mod healed_search;
pub mod healing;
pub mod operations;
mod optimism;
pub mod shares;

pub use costs::{AttributeCosts, GroupCosts, MergeRule, MergeRules};
pub use distance::{EditDistance, EditSettings, edit_distance};
pub use healing::Heal;
pub use operations::{GraphSide, Operation};
