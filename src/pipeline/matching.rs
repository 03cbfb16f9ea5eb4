//! The way of two shapes: both scaffolds, the pose, who corresponds to whom, and how the shapes differ.
//!
//! 1. Scaffold of target and source, side by side. A shape without one (an open patch, a part of a bone) is matched by its surface alone, and the
//!    warnings say so.
//! 2. Pose: hypotheses of the scaffolds and of the surfaces, decided on the surfaces.
//! 3. Correspondences, edit path and shape distance in that pose.
//! 4. Difference of the surfaces.

use super::documents::MatchDocument;
use super::error::{PipelineError, StageError};
use super::scaffold::{self, ScaffoldRun, ScaffoldSettings};
use super::timing::{Observer, StageTime, Stages};
use crate::geometry::{Rigid, TriangleMesh};
use crate::input::sampling::{LabelSurfaceSettings, label_surface};
use crate::input::{Geometry, Shape};
use crate::matching::{Matching, MatchingSettings, match_scaffolds_at};
use crate::registration::{
    Difference, Registration, RegistrationSettings, RegistrationShape, SheetContext, difference, register,
};
use serde::{Deserialize, Serialize};

/// Settings of every stage of [`match_shapes`].
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct MatchSettings {
    /// Scaffolds of both shapes.
    pub scaffold: ScaffoldSettings,
    /// Pose.
    pub registration: RegistrationSettings,
    /// Correspondences.
    pub matching: MatchingSettings,
}

/// A shape on its way through a match.
#[derive(Clone, Debug)]
pub struct MatchSide {
    /// Name of the shape.
    pub name: String,
    /// Its surface, when it has one; of a cloud the segregated one, when it could be made.
    pub surface: Option<TriangleMesh>,
    /// Its scaffold, when it could be made.
    pub scaffold: Option<ScaffoldRun>,
}

/// A match.
#[derive(Clone, Debug)]
pub struct MatchRun {
    /// The shape that stays.
    pub target: MatchSide,
    /// The shape that is moved.
    pub source: MatchSide,
    /// The pose and how well it is known.
    pub registration: Registration,
    /// Correspondences, edit path and shape distance, when both shapes have a scaffold.
    pub matching: Option<Matching>,
    /// Difference of the surfaces, when both shapes have one.
    pub difference: Option<Difference>,
    /// Seconds by stage.
    pub stages: Vec<StageTime>,
    /// What a user must know.
    pub warnings: Vec<String>,
}

/// Matches `source` to `target`.
///
/// # Errors
/// [`PipelineError`]: the stage that stopped, and the shape it stopped at.
pub fn match_shapes(
    target: &Shape,
    source: &Shape,
    settings: &MatchSettings,
    observer: Observer,
) -> Result<MatchRun, PipelineError> {
    let path = |shape: &Shape| shape.provenance.path.display().to_string();
    // Each side keeps its own times and warnings, so that their order does not depend on who is done first.
    let (target_done, source_done) = rayon::join(
        || prepare(target, "target", settings, observer).map_err(|e| e.of(&path(target))),
        || prepare(source, "source", settings, observer).map_err(|e| e.of(&path(source))),
    );
    let (target_done, source_done) = (target_done?, source_done?);
    let (target_side, source_side) = (target_done.side, source_done.side);
    let mut stages = target_done.stages;
    stages.extend(source_done.stages);
    let mut warnings = target_done.warnings;
    warnings.extend(source_done.warnings);
    let mut late = Stages::new(observer, "");
    let registration = late
        .run("registration", || {
            register(
                &target_side.to_register(target),
                &source_side.to_register(source),
                &settings.registration,
            )
        })
        .map_err(|e| StageError::from(e).of(&format!("{} and {}", path(target), path(source))))?;
    let pose = &registration.T_target_source;
    let matching = match (&target_side.scaffold, &source_side.scaffold) {
        (Some(t), Some(s)) => Some(late.run("matching", || {
            match_scaffolds_at(&t.coarse, &s.coarse, pose, &settings.matching)
        })),
        _ => None,
    };
    let difference = late
        .run("difference", || {
            surfaces_differ(&target_side, &source_side, pose, matching.as_ref())
        })
        .map_err(|e| e.of(&format!("{} and {}", path(target), path(source))))?;
    stages.extend(late.into_times());
    warnings.extend(
        registration
            .ambiguity
            .iter()
            .map(|reason| format!("the pose is ambiguous: {reason}")),
    );
    warnings.extend(
        registration
            .uncertainty
            .iter()
            .map(|reason| format!("the pose is uncertain: {reason}")),
    );
    Ok(MatchRun {
        target: target_side,
        source: source_side,
        registration,
        matching,
        difference,
        stages,
        warnings,
    })
}

/// A side with what its preparation has to say.
struct Prepared {
    side: MatchSide,
    stages: Vec<StageTime>,
    warnings: Vec<String>,
}

fn prepare(
    shape: &Shape,
    role: &str,
    settings: &MatchSettings,
    observer: Observer,
) -> Result<Prepared, StageError> {
    let (mut stages, mut warnings) = (Vec::new(), Vec::new());
    let scaffold_settings = ScaffoldSettings {
        refuse_open: true,
        ..settings.scaffold.clone()
    };
    let (scaffold, why_not) = match scaffold::run(shape, &scaffold_settings, observer, &format!("{role} ")) {
        Ok(run) => (Some(run), None),
        // An open shape has no inside, hence no scaffold; its surface can still be matched.
        Err(e @ (StageError::FineScaffold(_) | StageError::Segregation(_))) => (None, Some(e)),
        Err(e) => return Err(e),
    };
    if let Some(run) = &scaffold {
        stages.extend(run.stages.iter().cloned());
        warnings.extend(run.warnings.iter().map(|w| format!("{role}: {w}")));
    }
    if let Some(e) = why_not {
        warnings.push(format!("{role}: no scaffold, matched by its surface alone ({e})"));
    }
    let surface = match &shape.geometry {
        Geometry::Mesh(mesh) => Some(mesh.clone()),
        Geometry::Labels(map) => {
            let settings = LabelSurfaceSettings {
                label: settings.scaffold.sampling.label,
                smoothing_passes: settings.scaffold.sampling.smoothing_passes,
            };
            Some(label_surface(map, &settings)?.mesh)
        }
        Geometry::Cloud(_) => scaffold.as_ref().map(|run| run.surface.clone()),
    };
    Ok(Prepared {
        side: MatchSide {
            name: shape.name.clone(),
            surface,
            scaffold,
        },
        stages,
        warnings,
    })
}

fn surfaces_differ(
    target: &MatchSide,
    source: &MatchSide,
    pose: &Rigid,
    matching: Option<&Matching>,
) -> Result<Option<Difference>, StageError> {
    let (Some(target_surface), Some(source_surface)) = (&target.surface, &source.surface) else {
        return Ok(None);
    };
    let sheets = match (&target.scaffold, &source.scaffold, matching) {
        (Some(t), Some(s), Some(m)) => Some(SheetContext {
            target: &t.coarse,
            source: &s.coarse,
            pairs: &m.correspondences.sheets,
        }),
        _ => None,
    };
    Ok(Some(difference(target_surface, source_surface, pose, sheets)?))
}

impl MatchSide {
    /// What registration needs: the raw cloud when the shape is one, else the surface; and the scaffold.
    fn to_register<'a>(&'a self, shape: &'a Shape) -> RegistrationShape<'a> {
        let bare = match (&shape.geometry, &self.surface) {
            (Geometry::Cloud(cloud), _) => RegistrationShape::cloud(&cloud.points),
            (_, Some(mesh)) => RegistrationShape::mesh(mesh),
            // Meshes and label maps always have a surface.
            (_, None) => RegistrationShape::cloud(&[]),
        };
        match &self.scaffold {
            Some(run) => bare.with_scaffold(&run.coarse),
            None => bare,
        }
    }
}

impl MatchRun {
    /// The document written as `match.json`.
    pub fn document(&self) -> MatchDocument<'_> {
        let matching = self.matching.as_ref();
        MatchDocument {
            schema: "medial-scaffold/match",
            version: env!("CARGO_PKG_VERSION"),
            units: "mm",
            frame: "lps",
            target: &self.target.name,
            source: &self.source.name,
            registration: &self.registration,
            correspondences: matching.map(|m| &m.correspondences),
            shape_distance: matching.map(|m| m.shape_distance.with_size_mm),
            shape_distance_parts: matching.map(|m| &m.shape_distance),
            edit: matching.map(|m| &m.edit),
            cut_mm: matching.map(|m| m.cut_mm),
            difference: self.difference.as_ref(),
            warnings: &self.warnings,
        }
    }
}
