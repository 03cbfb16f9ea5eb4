//! The JSON documents the commands write. Field names are a contract: added freely, never renamed.

use crate::coarse_scaffold::{CoarseScaffold, Curve, CurveKind, Level, Node, Sheet};
use crate::fine_scaffold::{Betti, Side};
use crate::full_scaffold::CriticalCounts;
use crate::geometry::TriangleMesh;
use crate::matching::{Correspondences, Edit, ShapeDistance};
use crate::registration::{Difference, Registration};
use crate::regularise::Event;
use crate::segregation::CloudReport;
use serde::Serialize;

/// `scaffold.json`.
#[derive(Clone, Debug, Serialize)]
pub struct ScaffoldDocument<'a> {
    /// Name of this schema.
    pub schema: &'static str,
    /// Version of the program that wrote it.
    pub version: &'static str,
    /// Units of every length: mm.
    pub units: &'static str,
    /// Frame of every position: LPS.
    pub frame: &'static str,
    /// Name of the shape.
    pub name: &'a str,
    /// Side of the surface.
    pub side: Side,
    /// Critical points of the radius flow over all of space, and the Morse identity.
    pub full: CriticalCounts,
    /// The surface.
    pub surface: SurfaceSummary,
    /// How a raw cloud was prepared, meshed and closed; null for shapes that come with a surface.
    pub segregation: Option<&'a CloudReport>,
    /// Betti numbers of solid and scaffold by two routes.
    pub topology: TopologySummary,
    /// Numbers of elements.
    pub counts: Counts,
    /// How far the shape rebuilt from the scaffold is from the surface, mm.
    pub fidelity: Fidelity,
    /// What was simplified, in order.
    pub history: &'a [Event],
    /// The tolerance, mm.
    pub tolerance_mm: f64,
    /// Nodes.
    pub nodes: &'a [Node],
    /// Curves.
    pub curves: &'a [Curve],
    /// Sheets.
    pub sheets: &'a [Sheet],
    /// What the graph of each coarser tolerance holds.
    pub levels: Vec<Level>,
    /// What was done that a user may want to know.
    pub notes: &'a [String],
    /// What a user must know.
    pub warnings: &'a [String],
}

/// A surface in numbers.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SurfaceSummary {
    /// Vertices used by a triangle.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Euler number.
    pub euler: i64,
    /// Whether every edge has two triangles.
    pub watertight: bool,
    /// Volume, mm^3; null for an open surface.
    pub volume: Option<f64>,
    /// Area, mm^2.
    pub area: f64,
}

impl SurfaceSummary {
    /// Measures a mesh.
    pub fn of(mesh: &TriangleMesh) -> Self {
        let t = mesh.topology();
        Self {
            vertices: t.vertices,
            triangles: t.triangles,
            euler: t.euler,
            watertight: t.watertight,
            volume: (t.watertight && t.oriented).then(|| mesh.signed_volume()),
            area: mesh.area(),
        }
    }
}

/// Betti numbers by two independent routes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct TopologySummary {
    /// Of the solid, from the inside tetrahedra's boundary surface.
    pub solid_betti: Betti,
    /// Of the regularised scaffold, from its own cells.
    pub scaffold_betti: Betti,
    /// Whether they are equal.
    pub agree: bool,
    /// Whether the surface found has the components and Euler numbers of the surface given; null for a cloud, which gives none.
    pub surface_as_given: Option<bool>,
}

impl TopologySummary {
    /// Compares the two.
    pub fn new(solid_betti: Betti, scaffold_betti: Betti, surface_as_given: Option<bool>) -> Self {
        Self {
            solid_betti,
            scaffold_betti,
            agree: solid_betti == scaffold_betti,
            surface_as_given,
        }
    }
}

/// Numbers of elements of a coarse scaffold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Nodes.
    pub nodes: usize,
    /// Axial curves.
    pub axial_curves: usize,
    /// Ribs.
    pub rib_curves: usize,
    /// Wires.
    pub wires: usize,
    /// Seams.
    pub seams: usize,
    /// Sheets.
    pub sheets: usize,
}

impl Counts {
    /// Counts the elements.
    pub fn of(scaffold: &CoarseScaffold) -> Self {
        let of_kind = |kind| scaffold.curves.iter().filter(|c| c.kind == kind).count();
        Self {
            nodes: scaffold.nodes.len(),
            axial_curves: of_kind(CurveKind::Axial),
            rib_curves: of_kind(CurveKind::Rib),
            wires: of_kind(CurveKind::Wire),
            seams: of_kind(CurveKind::Seam),
            sheets: scaffold.sheets.len(),
        }
    }
}

/// Distance from the surface to the shape rebuilt from the scaffold (medial balls interpolated over its cells).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Fidelity {
    /// Largest, mm.
    pub hausdorff: f64,
    /// Mean, mm.
    pub mean: f64,
    /// Largest as a share of the bounding box's diagonal, percent.
    pub hausdorff_percent_diag: f64,
}

/// `match.json`.
#[derive(Clone, Debug, Serialize)]
#[allow(
    non_snake_case,
    reason = "frames are written as they are read: target from source"
)]
pub struct MatchDocument<'a> {
    /// Name of this schema.
    pub schema: &'static str,
    /// Version of the program that wrote it.
    pub version: &'static str,
    /// Units of every length: mm.
    pub units: &'static str,
    /// Frame of every position: LPS.
    pub frame: &'static str,
    /// Name of the target.
    pub target: &'a str,
    /// Name of the source.
    pub source: &'a str,
    /// The pose and how well it is known: `T_target_source`, `converged`, `mirrored`, `ambiguous`, `hypotheses`, `rms` ...
    #[serde(flatten)]
    pub registration: &'a Registration,
    /// Who corresponds to whom; null when a shape has no scaffold.
    pub correspondences: Option<&'a Correspondences>,
    /// Distance of the shapes, mm; null when a shape has no scaffold.
    pub shape_distance: Option<f64>,
    /// The parts of the distance, with and without size.
    pub shape_distance_parts: Option<&'a ShapeDistance>,
    /// The way from one scaffold to the other.
    pub edit: Option<&'a Edit>,
    /// Persistence at which both scaffolds were cut, mm.
    pub cut_mm: Option<f64>,
    /// How the surfaces differ.
    pub difference: Option<&'a Difference>,
    /// What a user must know.
    pub warnings: &'a [String],
}

/// What `mesh --json` prints.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceDocument<'a> {
    /// Name of this schema.
    pub schema: &'static str,
    /// Version of the program that wrote it.
    pub version: &'static str,
    /// Points given.
    pub points: usize,
    /// Vertices used by a triangle.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Edges with three or more triangles.
    pub nonmanifold_edges: usize,
    /// Connected components.
    pub components: usize,
    /// Euler number.
    pub euler: i64,
    /// Whether every edge has two triangles.
    pub watertight: bool,
    /// Whether a consistent orientation exists.
    pub orientable: bool,
    /// Volume, mm^3; null for an open surface.
    pub volume: Option<f64>,
    /// Area, mm^2.
    pub area: f64,
    /// Decisions, numbers, holes, doubts.
    pub report: &'a CloudReport,
}

impl<'a> SurfaceDocument<'a> {
    /// Measures a segregated surface made of `points` input points.
    pub fn new(points: usize, mesh: &TriangleMesh, report: &'a CloudReport) -> Self {
        let t = mesh.topology();
        Self {
            schema: "medial-scaffold/mesh",
            version: env!("CARGO_PKG_VERSION"),
            points,
            vertices: t.vertices,
            triangles: t.triangles,
            boundary_edges: t.boundary_edges,
            nonmanifold_edges: t.nonmanifold_edges,
            components: t.components,
            euler: t.euler,
            watertight: t.watertight,
            orientable: t.orientable,
            volume: (t.watertight && t.oriented).then(|| mesh.signed_volume()),
            area: mesh.area(),
            report,
        }
    }
}
