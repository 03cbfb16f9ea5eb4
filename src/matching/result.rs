//! What matching says: who corresponds to whom, how far apart the shapes are, and which poses the scaffolds allow.

use crate::geometry::{CurveId, NodeId, Rigid, SheetId};
use serde::{Deserialize, Serialize};
use std::fmt;

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
    /// Difference of the distributions of medial points (radii, distances from the centroid and between points, deviations), mm:
    /// needs no pose and does not see the mirror image.
    pub distribution_mm: f64,
    /// The same at unit size.
    pub distribution: f64,
    /// Price of making one hypergraph from the other by attributes alone, mm of evidence. No pose enters, so it is
    /// continuous where the edit distance is proven; `edit` holds the path in the pose, which knows places as well.
    pub structure_mm: f64,
    /// `structure_mm` as a share of the price of having nothing in common, 0 to 1.
    pub structure: f64,
}

/// What a step of the way does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EditKind {
    /// An element changes into its counterpart.
    Deform,
    /// An element goes that the other scaffold does not have.
    Splice,
    /// A curve shrinks to a point; its end nodes become one.
    Contract,
    /// Two curves become one across a node, or two sheets across a curve.
    Merge,
}

/// The scaffold a step happens to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EditSide {
    /// The target.
    Target,
    /// The source.
    Source,
}

impl fmt::Display for EditSide {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Target => "target",
            Self::Source => "source",
        })
    }
}

/// What a step is done to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EditElement {
    /// A node.
    Node,
    /// An axial curve.
    AxialCurve,
    /// A rib.
    Rib,
    /// A wire.
    Wire,
    /// A seam.
    Seam,
    /// A sheet.
    Sheet,
}

impl fmt::Display for EditElement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Node => "node",
            Self::AxialCurve => "axial curve",
            Self::Rib => "rib",
            Self::Wire => "wire",
            Self::Seam => "seam",
            Self::Sheet => "sheet",
        })
    }
}

/// One step of the way that makes target and source equal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EditOperation {
    /// What is done.
    pub operation: EditKind,
    /// What it is done to; of a merge, what goes.
    pub element: EditElement,
    /// The scaffold it happens to; none for a deformation, which joins both.
    pub side: Option<EditSide>,
    /// Ids in the target: more than one for an element that was merged before.
    pub target: Vec<u32>,
    /// Ids in the source.
    pub source: Vec<u32>,
    /// Ids of the elements that become one by a contraction (nodes) or a merge (curves across a node, sheets across a curve).
    pub joined: Vec<u32>,
    /// Price, mm.
    pub price: f64,
    /// The step in words, price included.
    pub text: String,
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
    /// The steps: splices, contractions and merges, deformations; their prices add up to the upper bound.
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
