//! Change of lesions, or of any paired shapes, between two dates.
//!
//! In: two shapes in one world frame (label maps on any grids, or closed meshes). Out: a [`Change`]: for every lesion its size and
//! form at both dates, its change of volume with a 95 % interval, agreement, response categories, and where it grew. Steps:
//! 1. [`region`]: the lesions of each date with their surfaces;
//! 2. [`pairing`]: which is which; new, vanished, split and merged ones;
//! 3. [`morphology`] (with [`slices`]): measures at each date;
//! 4. [`error_model`]: the change and its interval;
//! 5. [`agreement`]: overlap and surface distances;
//! 6. [`response`]: categories by published thresholds;
//! 7. [`growth`]: signed displacement of the surface, patches, and parts by sheet once scaffolds are attached
//!    ([`LesionChange::attach_scaffolds`]).
//!
//! [`mod@compare`] sets several segmentations of one date against each other and gives the spread that the interval can use.
//!
//! Nothing is aligned here: shapes come in the frame of their files, or moved by registration on other structures.
//! Cost: linear in voxels, `n log n` in surface points.

pub mod agreement;
pub mod compare;
pub mod error_model;
pub mod growth;
pub mod marching_cubes;
pub mod morphology;
pub mod pairing;
pub mod region;
pub mod response;
pub mod settings;
pub mod slices;

mod report;

pub use agreement::{Agreement, SurfaceAgreement};
pub use compare::{Comparison, PooledSpread, compare};
pub use error_model::{VolumeChange, VolumeError};
pub use growth::{GrowthMap, GrowthSummary, Part, PartKind, SheetPair};
pub use morphology::{Measures, ThicknessStatistics};
pub use report::{Alignment, Change, LesionChange, LoneLesion, Relation, Status, Totals};
pub use response::{Assessment, Category, Response};
pub use settings::{ChangeSettings, Pairing};

use crate::geometry::mesh::bounds;
use crate::input::shape::Shape;
use error_model::{Uncertain, volume_change, volume_error};
use glam::DVec3;
use pairing::Group;
use region::{Region, SurfaceKind, regions};
use response::Burden;
use thiserror::Error;

/// Shapes whose change cannot be measured.
#[derive(Debug, Error)]
pub enum ChangeError {
    /// Points without a surface.
    #[error("{name}: a point cloud has no volume; make a closed mesh of it first (`medial mesh`)")]
    NotSolid {
        /// The shape.
        name: String,
    },
    /// A mesh that does not enclose a volume.
    #[error(
        "{name}: the mesh does not enclose a volume ({boundary_edges} open edges, {nonmanifold_edges} edges with more than two \
         triangles, {}); close it first (--repair does, and lists what it changed)",
        if *.oriented { "consistently oriented" } else { "triangles turned both ways" }
    )]
    OpenMesh {
        /// The shape.
        name: String,
        /// Edges with one triangle.
        boundary_edges: usize,
        /// Edges with three or more.
        nonmanifold_edges: usize,
        /// Whether the triangles are turned alike.
        oriented: bool,
    },
    /// A map of zeros.
    #[error(
        "{name}: the mask is empty: no voxel differs from 0; check that it is the segmentation and not the image"
    )]
    Empty {
        /// The shape.
        name: String,
    },
    /// The wanted label is not in the map.
    #[error("{name}: there is no label {label}; the mask holds the labels {found:?}")]
    NoLabel {
        /// The shape.
        name: String,
        /// The wanted label.
        label: i32,
        /// Labels in the file.
        found: Vec<i32>,
    },
    /// The shapes lie apart in the world frame.
    #[error(
        "{baseline} and {followup} lie {apart_mm:.1} mm apart and cannot be two dates of one body part: baseline from {baseline_box}, \
         follow-up from {followup_box} (LPS mm); check frame and units of both files, or align them first (--align)"
    )]
    Apart {
        /// The baseline.
        baseline: String,
        /// The follow-up.
        followup: String,
        /// Distance between their boxes, mm.
        apart_mm: f64,
        /// Box of the baseline.
        baseline_box: String,
        /// Box of the follow-up.
        followup_box: String,
    },
}

/// The change from `baseline` to `followup`, both in one world frame.
///
/// # Errors
/// See [`ChangeError`]: what is not a closed solid, empty, or lies elsewhere gives an error and not a number.
pub fn change(baseline: &Shape, followup: &Shape, settings: &ChangeSettings) -> Result<Change, ChangeError> {
    let before = regions(baseline, settings)?;
    let after = regions(followup, settings)?;
    check_frames(baseline, &before, followup, &after)?;
    let mut out = Change {
        baseline_name: baseline.name.clone(),
        followup_name: followup.name.clone(),
        ..Change::empty(settings)
    };
    for group in pairing::pair(&before, &after, settings.pairing) {
        let pick = |list: &[usize], from: &'_ [Region]| -> Vec<Region> {
            list.iter().map(|i| from[*i].clone()).collect()
        };
        let (b, f) = (pick(&group.baseline, &before), pick(&group.followup, &after));
        match (b.is_empty(), f.is_empty()) {
            (false, false) => out.lesions.push(lesion_change(&group, &b, &f, settings)),
            (true, _) => out.new.extend(f.iter().map(|r| lone(r, settings))),
            (_, true) => out.vanished.extend(b.iter().map(|r| lone(r, settings))),
        }
    }
    out.finish();
    Ok(out)
}

fn lone(region: &Region, settings: &ChangeSettings) -> LoneLesion {
    let measures = morphology::measure(region);
    LoneLesion {
        label: region.label,
        error: volume_error(region, &measures, settings),
        measures,
        surface: region.surface.clone(),
    }
}

fn lesion_change(
    group: &Group,
    before: &[Region],
    after: &[Region],
    settings: &ChangeSettings,
) -> LesionChange {
    let b = Region::union(&before.iter().collect::<Vec<_>>(), settings);
    let f = Region::union(&after.iter().collect::<Vec<_>>(), settings);
    let (baseline, followup) = (morphology::measure(&b), morphology::measure(&f));
    let (error_b, error_f) = (
        volume_error(&b, &baseline, settings),
        volume_error(&f, &followup, settings),
    );
    let change = volume_change(
        Uncertain {
            volume: baseline.volume_best,
            sd: error_b.sd_mm3,
        },
        Uncertain {
            volume: followup.volume_best,
            sd: error_f.sd_mm3,
        },
    );
    let map = growth::growth_map(&b.surface, &f.surface);
    let direct = f.surface.signed_volume() - b.surface.signed_volume();
    let parts = map.as_ref().map_or_else(Vec::new, |m| {
        m.patches(&patch_thresholds_mm(m, &b, &f, settings), baseline.centroid)
    });
    let mut warnings = Vec::new();
    for (date, region) in [("baseline", &b), ("follow-up", &f)] {
        if region.surface_kind == SurfaceKind::Plain {
            warnings.push(format!(
                "lesion {}: too small or thin at {date} to be smoothed; growth follows the voxels' own surface",
                b.label
            ));
        }
    }
    let growth = map.as_ref().map(|m| m.summary(direct));
    if let Some(residual) = growth.and_then(|g| g.identity_residual_percent)
        && residual.abs() > MOST_RESIDUAL_PERCENT
    {
        warnings.push(format!(
            "lesion {}: displacement of the baseline's surface accounts for {:.0} % of the change; the rest lies where no line from \
             that surface reaches (a lobe, an arm): see the follow-up's surface",
            b.label,
            100.0 + residual * direct.signum()
        ));
    }
    LesionChange {
        label: b.label,
        status: match (group.baseline.len(), group.followup.len()) {
            (1, 1) => Status::Paired,
            (1, _) => Status::Split,
            (_, 1) => Status::Merged,
            _ => Status::Rearranged,
        },
        baseline_labels: before.iter().map(|r| r.label).collect(),
        followup_labels: after.iter().map(|r| r.label).collect(),
        response: response::response(Burden::of(&baseline), Burden::of(&followup)),
        agreement: agreement::agreement(&b, &f, settings.surface_dice_tolerance_mm),
        growth,
        followup_distance_mm: growth::followup_distances(&b.surface, &f.surface).unwrap_or_default(),
        measures_change_percent: baseline.change_percent(&followup),
        baseline,
        followup,
        baseline_error: error_b,
        followup_error: error_f,
        change,
        parts,
        new_branches: Vec::new(),
        lost_branches: Vec::new(),
        warnings,
        growth_map: map.unwrap_or_default(),
        followup_surface: f.surface,
    }
}

/// A growth map that leaves out more of the change than this is said to, percent. Chords and folds cost a percent or two.
const MOST_RESIDUAL_PERCENT: f64 = 5.0;

/// By how much each vertex of a growth map must move to count as changed, mm.
fn patch_thresholds_mm(map: &GrowthMap, b: &Region, f: &Region, settings: &ChangeSettings) -> Vec<f64> {
    let of_mesh = |r: &Region| r.mask.is_none().then(|| error_model::boundary_sd_mm(r, settings));
    let (fixed_b, fixed_f) = (of_mesh(b), of_mesh(f));
    let sd = |r: &Region, fixed: Option<f64>, n: DVec3| {
        fixed.unwrap_or_else(|| error_model::boundary_sd_along_mm(r, settings, n))
    };
    let normals = map.mesh.vertex_normals();
    let of = |n: DVec3| settings.patch_threshold_sd * sd(b, fixed_b, n).hypot(sd(f, fixed_f, n));
    normals.into_iter().map(of).collect()
}

/// Refuses shapes whose boxes lie farther apart than either is large: they are not in one frame.
fn check_frames(
    baseline: &Shape,
    before: &[Region],
    followup: &Shape,
    after: &[Region],
) -> Result<(), ChangeError> {
    let box_of = |regions: &[Region]| {
        let points: Vec<DVec3> = regions
            .iter()
            .flat_map(|r| r.plain.points.iter().copied())
            .collect();
        bounds(&points)
    };
    let (Some(a), Some(b)) = (box_of(before), box_of(after)) else {
        return Ok(());
    };
    let gap = (a[0] - b[1]).max(b[0] - a[1]).max(DVec3::ZERO).length();
    if gap > (a[1] - a[0]).length().max((b[1] - b[0]).length()) {
        let text = |x: [DVec3; 2]| format!("{:.1} to {:.1}", x[0], x[1]);
        return Err(ChangeError::Apart {
            baseline: baseline.name.clone(),
            followup: followup.name.clone(),
            apart_mm: gap,
            baseline_box: text(a),
            followup_box: text(b),
        });
    }
    Ok(())
}
