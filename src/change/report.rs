//! The result of the change stage, as `change.json` holds it, and its totals.

use super::ChangeSettings;
use super::agreement::Agreement;
use super::compare::Comparison;
use super::error_model::{Uncertain, VolumeChange, VolumeError, volume_change};
use super::growth::{GrowthMap, GrowthSummary, Part, SheetPair};
use super::morphology::{Measures, ThicknessStatistics};
use super::response::{Burden, Response, response};
use crate::coarse_scaffold::hypergraph::CoarseScaffold;
use crate::geometry::{SheetId, TriangleMesh};
use serde::Serialize;
use std::collections::BTreeMap;

/// How the regions of the two dates make up a lesion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// One at each date.
    Paired,
    /// One became several.
    Split,
    /// Several became one.
    Merged,
    /// Several became several others.
    Rearranged,
}

/// A lesion at both dates.
#[derive(Clone, Debug, Serialize)]
pub struct LesionChange {
    /// Label (the smallest one of several).
    pub label: i32,
    /// How the regions make up the lesion.
    pub status: Status,
    /// Labels or component numbers at baseline.
    pub baseline_labels: Vec<i32>,
    /// Labels or component numbers at follow-up.
    pub followup_labels: Vec<i32>,
    /// Size and form at baseline.
    pub baseline: Measures,
    /// Size and form at follow-up.
    pub followup: Measures,
    /// Change of every measure that both dates have, percent of the baseline's, by its name.
    pub measures_change_percent: BTreeMap<&'static str, f64>,
    /// How certain the baseline volume is.
    pub baseline_error: VolumeError,
    /// How certain the follow-up volume is.
    pub followup_error: VolumeError,
    /// Change of `volume_best`.
    pub change: VolumeChange,
    /// Response categories (research calculations).
    pub response: Response,
    /// Overlap and distances between the two dates.
    pub agreement: Agreement,
    /// Numbers of the growth map.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub growth: Option<GrowthSummary>,
    /// Patches that moved, and sheets once scaffolds are attached.
    pub parts: Vec<Part>,
    /// Sheets of the follow-up scaffold without a partner.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub new_branches: Vec<SheetId>,
    /// Sheets of the baseline scaffold without a partner.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost_branches: Vec<SheetId>,
    /// What a user should know, in plain words.
    pub warnings: Vec<String>,
    /// The growth map itself (`growth_<label>.ply`).
    #[serde(skip)]
    pub growth_map: GrowthMap,
    /// Surface at follow-up, LPS mm.
    #[serde(skip)]
    pub followup_surface: TriangleMesh,
    /// Signed distance of its vertices from the baseline's surface, mm, outside positive.
    #[serde(skip)]
    pub followup_distance_mm: Vec<f64>,
}

impl LesionChange {
    /// Adds what the scaffolds of the two surfaces (`growth_map.mesh` and `followup_surface`) tell: change by sheet, thickness, new
    /// and lost branches. `pairs` are the matched sheets.
    pub fn attach_scaffolds(
        &mut self,
        baseline: &CoarseScaffold,
        followup: &CoarseScaffold,
        pairs: &[SheetPair],
    ) {
        let parts = self.growth_map.sheet_parts(baseline, followup, pairs);
        self.parts.extend(parts);
        self.baseline.thickness = thickness(baseline);
        self.followup.thickness = thickness(followup);
        let unpaired = |scaffold: &CoarseScaffold, paired: &dyn Fn(SheetId) -> bool| -> Vec<SheetId> {
            let ids = scaffold.sheets.iter().map(|s| s.id);
            ids.filter(|id| !paired(*id)).collect()
        };
        self.lost_branches = unpaired(baseline, &|id| pairs.iter().any(|p| p.baseline == id));
        self.new_branches = unpaired(followup, &|id| pairs.iter().any(|p| p.followup == id));
    }
}

fn thickness(scaffold: &CoarseScaffold) -> Option<ThicknessStatistics> {
    let area: f64 = scaffold.sheets.iter().map(|s| s.area).sum();
    (area > 0.0).then(|| ThicknessStatistics {
        mean: 2.0
            * scaffold
                .sheets
                .iter()
                .map(|s| s.area * s.mean_radius)
                .sum::<f64>()
            / area,
        max: 2.0 * scaffold.sheets.iter().map(|s| s.max_radius).fold(0.0, f64::max),
    })
}

/// A lesion at one date only.
#[derive(Clone, Debug, Serialize)]
pub struct LoneLesion {
    /// Label or component number.
    pub label: i32,
    /// Size and form.
    #[serde(flatten)]
    pub measures: Measures,
    /// How certain its volume is.
    pub error: VolumeError,
    /// Its surface, LPS mm.
    #[serde(skip)]
    pub surface: TriangleMesh,
}

/// Regions of one date that correspond to those of the other, by label.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Relation {
    /// At baseline.
    pub baseline: Vec<i32>,
    /// At follow-up.
    pub followup: Vec<i32>,
}

/// All lesions together.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Totals {
    /// Volume at baseline, mm^3.
    pub baseline_mm3: f64,
    /// Volume at follow-up, mm^3.
    pub followup_mm3: f64,
    /// Change, mm^3.
    pub volume_mm3: f64,
    /// Change, percent; left out without volume at baseline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub percent: Option<f64>,
    /// 95 % interval of `percent`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ci95_percent: Option<[f64; 2]>,
    /// Whether the interval leaves zero out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub significant: Option<bool>,
    /// Criteria on the sums over all lesions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub response: Option<Response>,
}

/// How the follow-up was moved onto the baseline before anything was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(
    non_snake_case,
    reason = "frames are written as they are read: baseline from follow-up"
)]
pub struct Alignment {
    /// What the dates were aligned on, in words.
    pub on: String,
    /// Takes coordinates of the follow-up's file to the baseline's, LPS mm, 4x4 row-major, column vectors.
    pub T_baseline_followup: [[f64; 4]; 4],
    /// Angle of the motion, degrees.
    pub rotation_deg: f64,
    /// How far the motion moves the centre of the structure, mm.
    pub shift_mm: f64,
    /// Symmetric root mean square distance of the structure's surfaces after it, mm.
    pub rms_mm: f64,
    /// Whether other poses fit about as well; the one nearest to the files' own frames was taken.
    pub ambiguous: bool,
}

/// The result of [`super::change`], as `change.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Change {
    /// `medial-scaffold/change`.
    pub schema: String,
    /// Version of the schema.
    pub version: u32,
    /// `mm`.
    pub units: String,
    /// `LPS`.
    pub frame: String,
    /// Name of the baseline; empty when only segmentations of one date were compared.
    pub baseline_name: String,
    /// Name of the follow-up.
    pub followup_name: String,
    /// What the interval rests on, in words.
    pub error_model: String,
    /// What the categories are, in words.
    pub response_note: String,
    /// The motion of the follow-up, when it was aligned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alignment: Option<Alignment>,
    /// Several segmentations of the baseline's date, when given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segmentations: Option<Comparison>,
    /// Lesions of both dates.
    pub lesions: Vec<LesionChange>,
    /// Lesions of the follow-up only.
    pub new: Vec<LoneLesion>,
    /// Lesions of the baseline only.
    pub vanished: Vec<LoneLesion>,
    /// Lesions that became several.
    pub split: Vec<Relation>,
    /// Lesions that became one.
    pub merged: Vec<Relation>,
    /// All together.
    pub totals: Totals,
    /// What a user should know, in plain words.
    pub warnings: Vec<String>,
}

impl Change {
    pub(super) fn empty(settings: &ChangeSettings) -> Self {
        let boundary = match (settings.repeat_cv, settings.boundary_sd_mm) {
            (Some(cv), _) => format!(
                "repeated segmentation (coefficient of variation {:.2} %{})",
                100.0 * cv,
                settings
                    .repeat_degrees_of_freedom
                    .map_or_else(String::new, |n| format!(", {n} degrees of freedom"))
            ),
            (None, Some(sd)) => format!("a boundary displaced alike everywhere, standard deviation {sd} mm"),
            (None, None) => "a boundary displaced alike everywhere, standard deviation one voxel (for meshes: edge) / sqrt(12)"
                .to_owned(),
        };
        Self {
            schema: "medial-scaffold/change".to_owned(),
            version: 1,
            units: "mm".to_owned(),
            frame: "LPS".to_owned(),
            baseline_name: String::new(),
            followup_name: String::new(),
            error_model: format!(
                "95 % interval of the log ratio of two independent volumes; variance of each: counting voxels on a randomly placed \
                 grid (Matheron), plus {boundary}"
            ),
            response_note: "Research calculations by the published thresholds of RECIST 1.1, RANO and RANO 2.0 (volumetric); not a \
                            clinical reading."
                .to_owned(),
            alignment: None,
            segmentations: None,
            lesions: Vec::new(),
            new: Vec::new(),
            vanished: Vec::new(),
            split: Vec::new(),
            merged: Vec::new(),
            totals: Totals::default(),
            warnings: Vec::new(),
        }
    }

    /// One date only: segmentations against each other.
    pub fn of_segmentations(segmentations: Comparison, settings: &ChangeSettings) -> Self {
        Self {
            segmentations: Some(segmentations),
            ..Self::empty(settings)
        }
    }

    /// Fills the lists and sums that follow from the lesions.
    pub(super) fn finish(&mut self) {
        for l in &self.lesions {
            let relation = Relation {
                baseline: l.baseline_labels.clone(),
                followup: l.followup_labels.clone(),
            };
            match l.status {
                Status::Paired => {}
                Status::Split => self.split.push(relation),
                Status::Merged => self.merged.push(relation),
                Status::Rearranged => {
                    self.split.push(relation.clone());
                    self.merged.push(relation);
                }
            }
            self.warnings.extend(l.warnings.iter().cloned());
        }
        self.totals = self.sum();
    }

    fn sum(&self) -> Totals {
        let add = |list: &mut dyn Iterator<Item = (f64, f64)>| {
            let (volume, variance) = list.fold((0.0, 0.0), |(v, s), (x, sd)| (v + x, s + sd * sd));
            Uncertain {
                volume,
                sd: variance.sqrt(),
            }
        };
        let alone = |list: &[LoneLesion]| -> Vec<(f64, f64)> {
            list.iter()
                .map(|l| (l.measures.volume_best, l.error.sd_mm3))
                .collect()
        };
        let (vanished, new) = (alone(&self.vanished), alone(&self.new));
        let both = self.lesions.iter();
        let before = add(&mut both
            .clone()
            .map(|l| (l.baseline.volume_best, l.baseline_error.sd_mm3))
            .chain(vanished));
        let after = add(&mut both
            .map(|l| (l.followup.volume_best, l.followup_error.sd_mm3))
            .chain(new));
        let change = (before.volume > 0.0 && after.volume > 0.0).then(|| volume_change(before, after));
        let burdens = |date: fn(&LesionChange) -> &Measures, lone: &[LoneLesion]| {
            let paired = self.lesions.iter().map(|l| Burden::of(date(l)));
            Burden::sum(paired.chain(lone.iter().map(|l| Burden::of(&l.measures))))
        };
        Totals {
            baseline_mm3: before.volume,
            followup_mm3: after.volume,
            volume_mm3: after.volume - before.volume,
            percent: change.map(|c| c.percent),
            ci95_percent: change.map(|c| c.ci95_percent),
            significant: change.map(|c| c.significant),
            response: (before.volume > 0.0).then(|| {
                response(
                    burdens(|l| &l.baseline, &self.vanished),
                    burdens(|l| &l.followup, &self.new),
                )
            }),
        }
    }
}
