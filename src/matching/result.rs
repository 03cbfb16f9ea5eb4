//! What matching says: who corresponds to whom, how far apart the shapes are, and which poses the scaffolds allow.

use crate::geometry::{CurveId, NodeId, Rigid, SheetId};
use serde::{Deserialize, Serialize};

/// A pair of corresponding elements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair<Id> {
    /// Element of the target.
    pub target: Id,
    /// Element of the source.
    pub source: Id,
    /// Evidence for the pair, mm: what the match would lose without it.
    pub weight: f64,
    /// Soft assignment at the end of annealing, 0 to 1; near 1 when nothing competes.
    pub confidence: f64,
}

/// Elements of one scaffold.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Elements {
    /// Nodes.
    pub nodes: Vec<NodeId>,
    /// Curves.
    pub curves: Vec<CurveId>,
    /// Sheets.
    pub sheets: Vec<SheetId>,
}

/// Who corresponds to whom. Elements at or below the shared cut appear nowhere: they say nothing either way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Correspondences {
    /// Corresponding nodes, by target.
    pub nodes: Vec<Pair<NodeId>>,
    /// Corresponding curves, by target.
    pub curves: Vec<Pair<CurveId>>,
    /// Corresponding sheets, by target.
    pub sheets: Vec<Pair<SheetId>>,
    /// Elements of the target above the cut that nothing corresponds to.
    pub unmatched_target: Elements,
    /// Elements of the source above the cut that nothing corresponds to.
    pub unmatched_source: Elements,
}

/// How far apart two shapes are. All parts are zero for equal shapes and symmetric.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShapeDistance {
    /// Root mean square distance of the medial points (radius included) in the best pose, mm.
    pub with_size_mm: f64,
    /// The same after both shapes are brought to unit size (root mean square of distance from the centroid and radius): a
    /// share of the size.
    pub without_size: f64,
    /// Price of making one hypergraph from the other, mm of evidence: unmatched elements, changed incidences, deformations.
    /// Continuous for a given pose; the pose of two unequal scaffolds settles to within a degree, which moves it by some
    /// percent.
    pub structure_mm: f64,
    /// `structure_mm` as a share of the price of having nothing in common, 0 to 1.
    pub structure: f64,
}

/// One step of the way from target to source.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "operation")]
pub enum EditOperation {
    /// A node changes into its counterpart.
    DeformNode {
        /// Node of the target.
        target: NodeId,
        /// Node of the source.
        source: NodeId,
        /// Price, mm.
        price: f64,
    },
    /// A curve changes into its counterpart.
    DeformCurve {
        /// Curve of the target.
        target: CurveId,
        /// Curve of the source.
        source: CurveId,
        /// Price, mm.
        price: f64,
    },
    /// A sheet changes into its counterpart.
    DeformSheet {
        /// Sheet of the target.
        target: SheetId,
        /// Sheet of the source.
        source: SheetId,
        /// Price, mm.
        price: f64,
    },
    /// A node of the target goes.
    RemoveNode {
        /// Node of the target.
        target: NodeId,
        /// Price, mm.
        price: f64,
    },
    /// A curve of the target goes.
    RemoveCurve {
        /// Curve of the target.
        target: CurveId,
        /// Price, mm.
        price: f64,
    },
    /// A sheet of the target is spliced away: its persistence above the cut.
    RemoveSheet {
        /// Sheet of the target.
        target: SheetId,
        /// Price, mm.
        price: f64,
    },
    /// A node of the source comes.
    AddNode {
        /// Node of the source.
        source: NodeId,
        /// Price, mm.
        price: f64,
    },
    /// A curve of the source comes.
    AddCurve {
        /// Curve of the source.
        source: CurveId,
        /// Price, mm.
        price: f64,
    },
    /// A sheet of the source comes.
    AddSheet {
        /// Sheet of the source.
        source: SheetId,
        /// Price, mm.
        price: f64,
    },
    /// Ends, boundaries and corners that change between elements that stay.
    Rewire {
        /// Price, mm.
        price: f64,
    },
}

impl EditOperation {
    /// Price of the step, mm.
    pub fn price(&self) -> f64 {
        match *self {
            Self::DeformNode { price, .. }
            | Self::DeformCurve { price, .. }
            | Self::DeformSheet { price, .. }
            | Self::RemoveNode { price, .. }
            | Self::RemoveCurve { price, .. }
            | Self::RemoveSheet { price, .. }
            | Self::AddNode { price, .. }
            | Self::AddCurve { price, .. }
            | Self::AddSheet { price, .. }
            | Self::Rewire { price } => price,
        }
    }
}

/// The way from target to source and what is known of the cheapest one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Edit {
    /// No way is cheaper than this, mm.
    pub lower_bound: f64,
    /// The way below costs this, mm.
    pub upper_bound: f64,
    /// Both bounds meet.
    pub exact: bool,
    /// The steps, in the order of the elements; their prices add up to the upper bound.
    pub operations: Vec<EditOperation>,
}

/// A pose that the scaffolds allow, not verified on the surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[allow(
    non_snake_case,
    reason = "frames are written as they are read: target from source"
)]
pub struct PoseHypothesis {
    /// Takes source coordinates to target coordinates.
    pub T_target_source: Rigid,
    /// Root mean square distance of the medial points, radius included, mm.
    pub residual_mm: f64,
}

/// The match of two scaffolds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(
    non_snake_case,
    reason = "frames are written as they are read: target from source"
)]
pub struct Matching {
    /// The pose the correspondences were read in; identity when a scaffold has no points.
    pub T_target_source: Rigid,
    /// The pose mirrors.
    pub mirrored: bool,
    /// Another pose over 15 degrees away fits about as well.
    pub ambiguous: bool,
    /// Persistence at which both scaffolds were cut, mm.
    pub cut_mm: f64,
    /// Who corresponds to whom.
    pub correspondences: Correspondences,
    /// How far apart the shapes are.
    pub shape_distance: ShapeDistance,
    /// How one scaffold becomes the other.
    pub edit: Edit,
    /// Poses that the scaffolds allow, the best first.
    pub hypotheses: Vec<PoseHypothesis>,
}
