//! Coarse scaffold: the hypergraph of nodes, curves and sheets, with attributes and persistence.
//!
//! In: the fine scaffold and its regularisation. Out: [`CoarseScaffold`].
//!
//! * [`hypergraph`]: the types that matching, measures and reports read;
//! * [`build`]: [`coarse_scaffold`], the front function; `network` finds nodes, curves and sheets, `contract` makes
//!   nodes of what is small, `hide` and `tongues` take out what is below the cut, `corners` cuts ribs, `dissolve` takes out nodes where
//!   nothing ends, `ribs` fits the borders, `breadth` tells it where a sheet is but a strip, `attributes` measures, `wires` grades
//!   wires, `generators` maps the surface to all of them, `natural` finds gaps in the persistences;
//! * [`view`]: the graph at a coarser tolerance; [`levels`]: how many elements each of them has.

mod attributes;
mod breadth;
pub mod build;
mod contract;
mod corners;
mod dissolve;
mod generators;
mod hide;
pub mod hypergraph;
pub mod levels;
mod natural;
mod network;
pub mod ribs;
pub mod settings;
mod tongues;
pub mod view;
mod wires;

pub use build::coarse_scaffold;
pub use hypergraph::{
    CoarseScaffold, Curve, CurveKind, FineLinks, Host, MedialPoint, NaturalTolerance, Node, NodeKind, Sheet,
    SheetMesh, SheetMoments,
};
pub use levels::Level;
pub use settings::CoarseScaffoldSettings;
