//! The way of one shape: from what was read to its coarse scaffold.
//!
//! 1. A mesh is its own surface; a mask gets one; both are sampled. A cloud is its own generators.
//! 2. Delaunay triangulation and segregation: by the known surface, refined where its topology asks for it; by gap transforms and closure
//!    for a cloud or an open mesh.
//! 3. Full scaffold: flow and the Morse identity.
//! 4. Fine scaffold of one side (of both, joined, when the surface stays open), regularised, made into the coarse scaffold.
//! 5. Betti numbers of the solid by an independent route, fidelity, summaries.

use super::documents::{Counts, Fidelity, ScaffoldDocument, SurfaceSummary, TopologySummary};
use super::error::{PipelineError, StageError};
use super::timing::{Observer, StageTime, Stages};
use crate::coarse_scaffold::{CoarseScaffold, CoarseScaffoldSettings, coarse_scaffold};
use crate::delaunay::Triangulation;
use crate::fine_scaffold::{Domain, FineScaffold, Side, fine_scaffold_of, solid_betti_of};
use crate::full_scaffold::{CriticalCounts, full_scaffold};
use crate::geometry::{Length, TriangleMesh};
use crate::input::sampling::{SamplingSettings, sample};
use crate::input::{Geometry, Shape};
use crate::regularise::{RegulariseSettings, Regularised, regularise};
use crate::segregation::{
    CloudReport, KnownSurfaceSettings, Segregation, SegregationSettings, segregate_cloud,
    segregate_known_refined,
};
use serde::{Deserialize, Serialize};

/// Settings of every stage of [`scaffold`].
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ScaffoldSettings {
    /// Sampling of known surfaces.
    pub sampling: SamplingSettings,
    /// Segregation by a known surface.
    pub known_surface: KnownSurfaceSettings,
    /// Segregation of clouds and open meshes.
    pub cloud: SegregationSettings,
    /// Side of the surface.
    pub side: Side,
    /// Whether an open surface, which has no inside, is an error; otherwise it gets the scaffold of both its sides, [`Side::Joined`].
    pub refuse_open: bool,
    /// Regularisation, with the tolerance.
    pub regularise: RegulariseSettings,
    /// Least tolerance for a mask, in its largest voxel edges; 0 for none. A mask does not know its surface better than half a voxel,
    /// and what a smaller tolerance keeps is the steps between its slices.
    pub least_tolerance_vox: f64,
    /// Coarse scaffold.
    pub coarse: CoarseScaffoldSettings,
}

/// Everything known of one shape.
#[derive(Clone, Debug)]
pub struct ScaffoldRun {
    /// Name of the shape.
    pub name: String,
    /// Side of the surface.
    pub side: Side,
    /// Delaunay triangulation of the generators.
    pub triangulation: Triangulation,
    /// Surface triangles and labels.
    pub segregation: Segregation,
    /// The segregated surface; its points are all generators.
    pub surface: TriangleMesh,
    /// The input's own surface, when it has one.
    pub known_surface: Option<TriangleMesh>,
    /// How a raw cloud was prepared, meshed and closed.
    pub cloud: Option<CloudReport>,
    /// Critical points of the radius flow over all of space.
    pub full: CriticalCounts,
    /// Fine scaffold.
    pub fine: FineScaffold,
    /// What regularisation left of it.
    pub regularised: Regularised,
    /// Coarse scaffold.
    pub coarse: CoarseScaffold,
    /// Betti numbers by two routes.
    pub topology: TopologySummary,
    /// Seconds by stage.
    pub stages: Vec<StageTime>,
    /// What was done that a user may want to know.
    pub notes: Vec<String>,
    /// What a user must know.
    pub warnings: Vec<String>,
}

/// The scaffold of one side of a shape.
///
/// # Errors
/// [`PipelineError`]: the stage that stopped and why, with the name of the shape.
pub fn scaffold(
    shape: &Shape,
    settings: &ScaffoldSettings,
    observer: Observer,
) -> Result<ScaffoldRun, PipelineError> {
    run(shape, settings, observer, "").map_err(|e| e.of(&shape.provenance.path.display().to_string()))
}

/// As [`scaffold`]; `prefix` goes before the names of the stages.
pub(super) fn run(
    shape: &Shape,
    settings: &ScaffoldSettings,
    observer: Observer,
    prefix: &str,
) -> Result<ScaffoldRun, StageError> {
    let mut stages = Stages::new(observer, prefix);
    let mut warnings = shape.warnings.clone();
    let mut notes = shape.notes.clone();
    let sided = side_of_surface(shape, settings, &mut stages, &mut notes, &mut warnings)?;
    let full = stages.run("full scaffold", || full_scaffold(&sided.triangulation))?;
    let open = sided.segregation.inside.is_empty() && !settings.refuse_open;
    let side = if open { Side::Joined } else { settings.side };
    if open {
        warnings.push(
            "the surface is open and has no inside: this is one scaffold of both its sides; `medial mesh --closed` closes the surface"
                .to_owned(),
        );
    }
    let domain = Domain::new(&sided.triangulation, &sided.segregation, side)?;
    let fine = stages.run("fine scaffold", || {
        fine_scaffold_of(&sided.triangulation, &domain)
    })?;
    let regularise_settings = RegulariseSettings {
        tolerance: tolerance_of_mask(shape, settings, &fine, &mut notes),
        ..settings.regularise.clone()
    };
    let regularised = stages.run("regularise", || regularise(&fine, &regularise_settings))?;
    let coarse = stages.run("coarse scaffold", || {
        coarse_scaffold(&fine, &regularised, &settings.coarse)
    });
    let solid = stages.run("topology", || solid_betti_of(&sided.triangulation, &domain));
    let topology = TopologySummary::new(solid, regularised.betti(), sided.surface_as_given);
    warnings.extend(sided.segregation.warnings.iter().cloned());
    Ok(ScaffoldRun {
        name: shape.name.clone(),
        side,
        surface: sided.segregation.surface(&sided.triangulation),
        triangulation: sided.triangulation,
        segregation: sided.segregation,
        known_surface: sided.known_surface,
        cloud: sided.cloud,
        full: full.counts,
        fine,
        regularised,
        coarse,
        topology,
        stages: stages.into_times(),
        notes,
        warnings,
    })
}

/// The tolerance asked for, or for a mask the least that its voxels allow when that is more.
fn tolerance_of_mask(
    shape: &Shape,
    settings: &ScaffoldSettings,
    fine: &FineScaffold,
    notes: &mut Vec<String>,
) -> Length {
    let asked = settings.regularise.tolerance;
    let Geometry::Labels(map) = &shape.geometry else {
        return asked;
    };
    let voxel_mm = map.spacing_mm.max_element();
    let least_mm = settings.least_tolerance_vox * voxel_mm;
    if matches!(asked, Length::LocalRadii(_)) || asked.to_mm(fine.scale, 0.0) >= least_mm {
        return asked;
    }
    notes.push(format!(
        "the tolerance is {least_mm:.3} mm, {} of the largest voxel edge of {voxel_mm:.3} mm: a mask does not know its surface \
         better; --tolerance {asked} keeps more",
        settings.least_tolerance_vox
    ));
    Length::Millimetres(least_mm)
}

/// Generators triangulated and labelled.
struct Sided {
    triangulation: Triangulation,
    segregation: Segregation,
    known_surface: Option<TriangleMesh>,
    surface_as_given: Option<bool>,
    cloud: Option<CloudReport>,
}

fn side_of_surface(
    shape: &Shape,
    settings: &ScaffoldSettings,
    stages: &mut Stages,
    notes: &mut Vec<String>,
    warnings: &mut Vec<String>,
) -> Result<Sided, StageError> {
    let sampled = stages.run("sampling", || sample(shape, &settings.sampling))?;
    notes.extend(sampled.remarks);
    let generators = sampled.generators;
    if let Some(known) = generators.known_surface {
        let open = known.topology().boundary_edges;
        if open == 0 {
            let found = stages.run("delaunay and segregation", || {
                segregate_known_refined(&generators.points, &known, &settings.known_surface)
            })?;
            return Ok(Sided {
                triangulation: found.triangulation,
                surface_as_given: Some(found.result.report.agree),
                segregation: found.result.segregation,
                known_surface: Some(known),
                cloud: None,
            });
        }
        warnings.push(format!(
            "the surface is not closed ({open} open edges), so its inside is not known: it was treated as a cloud of \
             its points; `medial check` shows what is wrong with it"
        ));
    }
    let found = stages.run("segregation", || {
        segregate_cloud(&generators.points, &settings.cloud)
    })?;
    Ok(Sided {
        triangulation: found.triangulation,
        segregation: found.segregation,
        known_surface: None,
        surface_as_given: None,
        cloud: Some(found.report),
    })
}

impl ScaffoldRun {
    /// The document written as `scaffold.json`.
    pub fn document(&self) -> ScaffoldDocument<'_> {
        let fidelity = &self.regularised.fidelity;
        ScaffoldDocument {
            schema: "medial-scaffold/scaffold",
            version: env!("CARGO_PKG_VERSION"),
            units: "mm",
            frame: "lps",
            name: &self.name,
            side: self.side,
            full: self.full,
            surface: SurfaceSummary::of(&self.surface),
            segregation: self.cloud.as_ref(),
            topology: self.topology,
            counts: Counts::of(&self.coarse),
            fidelity: Fidelity {
                hausdorff: fidelity.max_mm,
                mean: fidelity.mean_mm,
                hausdorff_percent_diag: 100.0 * fidelity.max_mm / self.coarse.diagonal_mm,
            },
            history: &self.regularised.history,
            tolerance_mm: self.coarse.tolerance_mm,
            nodes: &self.coarse.nodes,
            curves: &self.coarse.curves,
            sheets: &self.coarse.sheets,
            levels: self.coarse.levels(),
            notes: &self.notes,
            warnings: &self.warnings,
        }
    }
}
