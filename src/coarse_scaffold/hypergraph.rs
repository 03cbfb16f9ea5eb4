//! The coarse scaffold as data: what matching, measures and reports read. All lengths in mm, frame LPS.

use crate::geometry::{CurveId, NodeId, SheetId};
use crate::regularise::Event;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A medial point with its radius, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 4]", into = "[f64; 4]")]
pub struct MedialPoint {
    /// Position.
    pub position: DVec3,
    /// Distance to the generators.
    pub radius: f64,
}

impl From<[f64; 4]> for MedialPoint {
    fn from([x, y, z, radius]: [f64; 4]) -> Self {
        Self {
            position: DVec3::new(x, y, z),
            radius,
        }
    }
}

impl From<MedialPoint> for [f64; 4] {
    fn from(p: MedialPoint) -> Self {
        [p.position.x, p.position.y, p.position.z, p.radius]
    }
}

/// The coarse scaffold of one side of a shape at one tolerance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CoarseScaffold {
    /// How much the shape was allowed to change, mm.
    pub tolerance_mm: f64,
    /// Diagonal of the shape's bounding box, mm.
    pub diagonal_mm: f64,
    /// Nodes; `nodes[i].id == NodeId(i)`.
    pub nodes: Vec<Node>,
    /// Curves; `curves[i].id == CurveId(i)`.
    pub curves: Vec<Curve>,
    /// Sheets; `sheets[i].id == SheetId(i)`.
    pub sheets: Vec<Sheet>,
    /// Tolerances at which the graph is least a matter of the exact cut, the best first; see [`NaturalTolerance`].
    #[serde(default)]
    pub natural_tolerances: Vec<NaturalTolerance>,
    /// Contractions and merges of curves and nodes, done or refused; they follow the history of the regularisation.
    #[serde(default)]
    pub transforms: Vec<Event>,
    /// The way back to the fine scaffold; empty in a scaffold read from a file or in a view.
    #[serde(skip)]
    pub fine: FineLinks,
}

/// A wide gap in the sorted persistences: any tolerance inside it gives the same graph.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NaturalTolerance {
    /// Middle of the gap on a log scale, mm.
    pub tolerance_mm: f64,
    /// Upper end of the gap over its lower end.
    pub ratio: f64,
    /// Axial curves and wires above the gap.
    pub curves: u32,
}

/// What hosts a generator: the element of the coarse scaffold it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Host {
    /// A sheet.
    Sheet(SheetId),
    /// A wire.
    Curve(CurveId),
    /// A node that is all there is (a ball).
    Node(NodeId),
    /// Nothing: the scaffold is empty.
    Absent,
}

/// Elements of the fine scaffold behind each element of the coarse one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FineLinks {
    /// Fine vertices of each node: one, or those of a curve that was contracted to it.
    pub node_vertices: Vec<Vec<u32>>,
    /// Fine edges of each curve, in order along it.
    pub curve_edges: Vec<Vec<u32>>,
    /// Fine facets of each sheet, ascending.
    pub sheet_facets: Vec<Vec<u32>>,
    /// Host of each generator; total.
    pub generator_host: Vec<Host>,
}

/// What meets at a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NodeKind {
    /// One rib pair and one axial curve end here (generic end of an axial curve).
    A1A3,
    /// Four axial curves meet.
    A14,
    /// The free end of a wire.
    Tip,
    /// Two ribs of one sheet meet at a corner of the surface.
    Corner,
    /// Any other meeting, made by a transform or by degenerate input.
    Degenerate,
}

/// A node of the coarse scaffold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Id.
    pub id: NodeId,
    /// Kind.
    #[serde(rename = "type")]
    pub kind: NodeKind,
    /// Position, mm.
    pub position: DVec3,
    /// Radius, mm.
    pub radius: f64,
    /// Curves that end here; a loop is named twice.
    pub curves: Vec<CurveId>,
    /// Sheets that reach the node, ascending; a wire may end in the middle of one.
    #[serde(default)]
    pub sheets: Vec<SheetId>,
    /// The largest persistence of its axial curves and wires, mm.
    pub persistence: f64,
}

/// The kinds of curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CurveKind {
    /// Three or more sheets meet (A1^3).
    Axial,
    /// The border of one sheet (A3).
    Rib,
    /// No sheet at all.
    Wire,
    /// Closes the gap between an axial curve's end and a near rib.
    Seam,
}

/// A curve of the coarse scaffold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Id.
    pub id: CurveId,
    /// Kind.
    pub kind: CurveKind,
    /// How much of the shape must be given up before this curve goes, mm. Where the tolerance is relative to the radius this is
    /// in units of the local tolerance times `tolerance_mm`, so that a view cuts thick and thin parts alike. Never the
    /// diagonal, unless nothing short of another topology takes the curve away.
    pub persistence: f64,
    /// End nodes: two (equal for a loop through a node), or none for a closed curve without nodes.
    pub nodes: Vec<NodeId>,
    /// Whether the curve is closed.
    pub closed: bool,
    /// Incident sheets, one entry for each time a sheet meets the curve; of an axial curve in order of erosion thickness at its most
    /// persistent place, so that the last is the one that goes first.
    pub sheets: Vec<SheetId>,
    /// Length, mm.
    pub length: f64,
    /// Points from `nodes[0]` to `nodes[1]`; a closed curve does not repeat its first point.
    pub polyline: Vec<MedialPoint>,
}

/// Area-weighted moments of a sheet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SheetMoments {
    /// Centroid, mm.
    pub centroid: DVec3,
    /// Standard deviations along the principal axes, mm, largest first.
    pub deviations: [f64; 3],
    /// Principal axes as rows, right-handed, largest first.
    pub axes: [DVec3; 3],
}

/// A sheet as triangles with radii; exact medial points of the fine scaffold.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SheetMesh {
    /// Vertices.
    pub vertices: Vec<MedialPoint>,
    /// Triangles.
    pub triangles: Vec<[u32; 3]>,
}

/// A sheet of the coarse scaffold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sheet {
    /// Id.
    pub id: SheetId,
    /// Maximum erosion thickness, mm.
    pub persistence: f64,
    /// Boundary as chains of curves, the longest first.
    pub boundary: Vec<Vec<CurveId>>,
    /// Area, mm^2.
    pub area: f64,
    /// Area-weighted mean radius, mm.
    pub mean_radius: f64,
    /// Largest radius, mm.
    pub max_radius: f64,
    /// Share of the solid's volume nearest to this sheet by the generator map, 0 to 1.
    pub volume_share: f64,
    /// Number of generators hosted by this sheet.
    pub generators: u32,
    /// Moments.
    pub moments: SheetMoments,
    /// Geometry, kept out of `scaffold.json` (it is in `fine.ma` and `sheets.vtp`).
    #[serde(skip)]
    pub mesh: SheetMesh,
}
