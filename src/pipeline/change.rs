//! The way of two dates: lesions paired and measured, then read on their scaffolds: which part grew.
//!
//! 1. Change by volumes and surfaces, in the world frame of the files.
//! 2. Of every lesion that can be had at both dates the scaffold of both surfaces, at one tolerance; correspondences in place (nothing is
//!    moved); sheets that grew, branches that are new or lost. A lesion too small for a scaffold goes without, and its
//!    warnings say so.

use super::error::{PipelineError, StageError};
use super::scaffold::{self, ScaffoldRun, ScaffoldSettings};
use super::timing::{Observer, StageTime, Stages};
use crate::change::{Change, ChangeSettings, LesionChange, SheetPair, change};
use crate::geometry::{Length, Rigid, TriangleMesh};
use crate::input::{Geometry, Shape};
use crate::matching::{MatchingSettings, match_scaffolds_at};
use serde::{Deserialize, Serialize};

/// Settings of every stage of [`change_of`].
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ChangeRunSettings {
    /// Pairing, error model, smoothing.
    pub change: ChangeSettings,
    /// Scaffolds of the lesions.
    pub scaffold: ScaffoldSettings,
    /// Correspondences of their elements.
    pub matching: MatchingSettings,
}

/// A change and what it cost.
#[derive(Clone, Debug)]
pub struct ChangeRun {
    /// The change.
    pub change: Change,
    /// Seconds by stage.
    pub stages: Vec<StageTime>,
    /// What a user must know.
    pub warnings: Vec<String>,
}

/// The change from `baseline` to `followup`.
///
/// # Errors
/// [`PipelineError`] when a shape has no volume or the two lie in different places.
pub fn change_of(
    baseline: &Shape,
    followup: &Shape,
    settings: &ChangeRunSettings,
    observer: Observer,
) -> Result<ChangeRun, PipelineError> {
    let mut stages = Stages::new(observer, "");
    let mut found = stages
        .run("change", || change(baseline, followup, &settings.change))
        .map_err(|e| {
            let both = format!(
                "{} and {}",
                baseline.provenance.path.display(),
                followup.provenance.path.display()
            );
            StageError::from(e).of(&both)
        })?;
    stages.run("scaffolds", || {
        for lesion in &mut found.lesions {
            read_on_scaffolds(lesion, settings, observer);
        }
    });
    let warnings = baseline
        .warnings
        .iter()
        .chain(&followup.warnings)
        .chain(&found.warnings)
        .cloned()
        .collect();
    Ok(ChangeRun {
        change: found,
        stages: stages.into_times(),
        warnings,
    })
}

/// Adds what both scaffolds say, or a warning that says why not.
fn read_on_scaffolds(lesion: &mut LesionChange, settings: &ChangeRunSettings, observer: Observer) {
    let surfaces = [&lesion.growth_map.mesh, &lesion.followup_surface];
    // One tolerance for both dates, or a lesion that grows would lose elements for being larger.
    let diagonal_mm = surfaces.map(|s| s.diagonal_mm()).into_iter().fold(0.0, f64::max);
    let mut scaffold_settings = settings.scaffold.clone();
    if let Length::PercentDiagonal(percent) = scaffold_settings.regularise.tolerance {
        scaffold_settings.regularise.tolerance = Length::Millimetres(percent / 100.0 * diagonal_mm);
    }
    let run = |mesh: &TriangleMesh, name: &str| -> Result<ScaffoldRun, StageError> {
        let shape = Shape::generated(name, Geometry::Mesh(mesh.clone()));
        scaffold::run(
            &shape,
            &scaffold_settings,
            observer,
            &format!("label {} {name} ", lesion.label),
        )
    };
    let both = run(surfaces[0], "baseline").and_then(|b| Ok((b, run(surfaces[1], "followup")?)));
    match both {
        Ok((baseline, followup)) => {
            let matched = match_scaffolds_at(
                &baseline.coarse,
                &followup.coarse,
                &Rigid::IDENTITY,
                &settings.matching,
            );
            let pairs: Vec<SheetPair> = matched
                .correspondences
                .sheets
                .iter()
                .map(|p| SheetPair {
                    baseline: p.target,
                    followup: p.source,
                })
                .collect();
            lesion.attach_scaffolds(&baseline.coarse, &followup.coarse, &pairs);
        }
        Err(e) => lesion
            .warnings
            .push(format!("no scaffold, so nothing is said of its parts: {e}")),
    }
}
