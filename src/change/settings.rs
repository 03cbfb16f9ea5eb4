//! Settings of the change stage.

use serde::{Deserialize, Serialize};

/// How lesions of the two dates are paired.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pairing {
    /// Equal labels are the same lesion.
    #[default]
    Label,
    /// Connected components that overlap in the world frame are the same lesion; labels are ignored.
    Overlap,
}

/// Settings of [`super::change`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChangeSettings {
    /// How lesions are paired.
    pub pairing: Pairing,
    /// Only this label of label maps; every label but 0 when not given.
    pub label: Option<i32>,
    /// Standard deviation of the boundary's position, mm, the same all over a lesion and independent between dates. When not
    /// given: a voxel's size (geometric mean) over the square root of 12, the spread of a boundary known to a voxel; for a
    /// mesh its mean edge length instead of a voxel.
    pub boundary_sd_mm: Option<f64>,
    /// Coefficient of variation of a lesion's volume under repeated segmentation, 0.05 for 5 %. Replaces the boundary term.
    pub repeat_cv: Option<f64>,
    /// Degrees of freedom that `repeat_cv` was found with (segmentations less one, summed over lesions): few of them widen the
    /// interval as Student's distribution asks. Not given: known well.
    pub repeat_degrees_of_freedom: Option<usize>,
    /// Labels that are no lesions: structures the dates were aligned on.
    pub ignored_labels: Vec<i32>,
    /// Tolerance of the surface Dice coefficient, mm. 1 mm is the smallest of those used for organs by Nikolov et al. 2018.
    pub surface_dice_tolerance_mm: f64,
    /// Standard deviation of the smoothing kernel that turns a mask into a smooth surface, voxels along each axis. At 1.2
    /// the steps of slices vanish but for flat ends, and structures of three voxels stay.
    /// Where this wipes out a part of the lesion, three quarters or a half of it is taken.
    pub smoothing_vox: f64,
    /// A patch of the surface counts as changed when it somewhere moved by more than this many standard deviations of the
    /// difference of two boundaries; it reaches as far as half of that. Each boundary is known to a voxel along its normal, so two
    /// cannot differ by more than the square root of 6 without a change.
    pub patch_threshold_sd: f64,
    /// Components of fewer voxels are not lesions (pairing by overlap only); 0 keeps all.
    pub least_voxels: usize,
}

impl Default for ChangeSettings {
    fn default() -> Self {
        Self {
            pairing: Pairing::Label,
            label: None,
            boundary_sd_mm: None,
            repeat_cv: None,
            repeat_degrees_of_freedom: None,
            ignored_labels: Vec::new(),
            surface_dice_tolerance_mm: 1.0,
            smoothing_vox: 1.2,
            patch_threshold_sd: 2.45,
            least_voxels: 0,
        }
    }
}
