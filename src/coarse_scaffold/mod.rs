//! Coarse scaffold: the hypergraph of nodes, curves and sheets, with attributes and persistence.

pub mod hypergraph;

pub use hypergraph::{
    CoarseScaffold, Curve, CurveKind, MedialPoint, Node, NodeKind, Sheet, SheetMesh, SheetMoments,
};
