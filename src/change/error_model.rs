//! How certain a volume is, and a change of volume.
//!
//! In: a region and its measures. Out: a standard deviation with its parts, and for two dates the change with a 95 % interval.
//! The variance of a volume `V` with surface area `S` is the sum of
//! 1. digitisation: voxels counted on a grid that lies at random. From the covariogram's slope at zero, `S/4` (Matheron), by
//!    Poisson summation: `S / (8 pi^3) * sum over k != 0 of |k / s|^-4`, `s` the voxel size, `k` integer triples. For cubes
//!    of side `u` that is `0.0666 S u^4`. It assumes that the surface faces all directions alike;
//! 2. the boundary: displaced by the same unknown amount everywhere, with standard deviation `b`: `(S b)^2`. This is the
//!    cautious end (independent displacements would average out). Not known otherwise, `b` is a voxel over the square root
//!    of 12; with repeated segmentations it is replaced by their coefficient of variation,
//!    widened by Student's distribution when they are few.
//!
//! The dates are independent. Volumes are positive, so the interval is made for the logarithm of their ratio.

use super::ChangeSettings;
use super::morphology::Measures;
use super::region::Region;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Two-sided 95 % point of the normal distribution.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Two-sided 95 % point of Student's distribution.
fn student_95(degrees_of_freedom: usize) -> f64 {
    const EXACT: [f64; 10] = [
        12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
    ];
    match degrees_of_freedom {
        0 => f64::INFINITY,
        n @ 1..=10 => EXACT[n - 1],
        // Cornish and Fisher's expansion to the third order; right to 2e-4 from here on.
        n => {
            let (z, n) = (NORMAL_95, n as f64);
            let first = z.powi(3) + z;
            let second = 5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z;
            let third = 3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z;
            z + first / (4.0 * n) + second / (96.0 * n * n) + third / (384.0 * n.powi(3))
        }
    }
}

/// Standard deviation of a volume and its parts, mm^3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VolumeError {
    /// All together.
    pub sd_mm3: f64,
    /// From counting voxels.
    pub digitisation_mm3: f64,
    /// From the position of the boundary (or from repeated segmentation).
    pub boundary_mm3: f64,
    /// Standard deviation of the boundary's position that was used, mm; 0 when repeats replace it.
    pub boundary_sd_mm: f64,
}

/// Change of volume between two dates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VolumeChange {
    /// Follow-up less baseline, mm^3.
    pub volume_mm3: f64,
    /// Change in percent of the baseline.
    pub percent: f64,
    /// 95 % interval of `percent`.
    pub ci95_percent: [f64; 2],
    /// Whether the interval leaves zero out.
    pub significant: bool,
}

/// Sum over non-zero integer triples of `|k / s|^-4`, mm^4: exact terms in a ball, the rest by its integral.
fn lattice_sum(spacing_mm: DVec3) -> f64 {
    let s = spacing_mm.to_array();
    // 12 periods of the finest axis; the tail beyond is 1 % of the sum and its integral is good to a few percent of that.
    let reach = 12.0 / s.iter().copied().fold(f64::INFINITY, f64::min);
    let most = s.map(|x| (reach * x).floor() as i64);
    let mut sum = 0.0;
    for k in -most[2]..=most[2] {
        for j in -most[1]..=most[1] {
            for i in -most[0]..=most[0] {
                let q2 = (i as f64 / s[0]).powi(2) + (j as f64 / s[1]).powi(2) + (k as f64 / s[2]).powi(2);
                if q2 > 0.0 && q2 <= reach * reach {
                    sum += 1.0 / (q2 * q2);
                }
            }
        }
    }
    sum + s[0] * s[1] * s[2] * 4.0 * std::f64::consts::PI / reach
}

/// Variance of a voxel count's volume for a surface of 1 mm^2, mm^4.
pub fn digitisation_variance_per_area(spacing_mm: DVec3) -> f64 {
    lattice_sum(spacing_mm) / (8.0 * std::f64::consts::PI.powi(3))
}

/// Standard deviation of the boundary's position, mm.
pub fn boundary_sd_mm(region: &Region, settings: &ChangeSettings) -> f64 {
    settings.boundary_sd_mm.unwrap_or_else(|| {
        let size = match &region.mask {
            Some(mask) => mask.voxel_volume_mm3().cbrt(),
            None => mean_edge_mm(region),
        };
        size / 12f64.sqrt()
    })
}

/// Standard deviation of the boundary's position along a normal, mm: a voxel's extent in that direction over the square root of 12
/// (thick slices leave flat ends in doubt by a slice), or the boundary's own when that is larger.
pub fn boundary_sd_along_mm(region: &Region, settings: &ChangeSettings, normal: DVec3) -> f64 {
    match &region.mask {
        Some(mask) => {
            let extent = (mask.direction.inverse() * normal * mask.spacing_mm).length();
            (extent / 12f64.sqrt()).max(settings.boundary_sd_mm.unwrap_or(0.0))
        }
        None => boundary_sd_mm(region, settings),
    }
}

fn mean_edge_mm(region: &Region) -> f64 {
    let mesh = &region.surface;
    let sum: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            a.distance(b) + b.distance(c) + c.distance(a)
        })
        .sum();
    sum / (3 * mesh.triangles.len()).max(1) as f64
}

/// How certain the volume of a region is.
pub fn volume_error(region: &Region, measures: &Measures, settings: &ChangeSettings) -> VolumeError {
    let digitisation = region.mask.as_ref().map_or(0.0, |m| {
        (measures.area_smooth * digitisation_variance_per_area(m.spacing_mm)).sqrt()
    });
    let (boundary, boundary_sd_mm) = match settings.repeat_cv {
        Some(cv) => {
            let wider = settings
                .repeat_degrees_of_freedom
                .map_or(1.0, |n| student_95(n) / NORMAL_95);
            (wider * cv * measures.volume_best, 0.0)
        }
        None => {
            let sd = boundary_sd_mm(region, settings);
            (measures.area_smooth * sd, sd)
        }
    };
    VolumeError {
        sd_mm3: digitisation.hypot(boundary),
        digitisation_mm3: digitisation,
        boundary_mm3: boundary,
        boundary_sd_mm,
    }
}

/// A volume with its standard deviation, mm^3.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Uncertain {
    /// Volume.
    pub volume: f64,
    /// Standard deviation.
    pub sd: f64,
}

/// The change from one volume to another, both positive.
pub fn volume_change(baseline: Uncertain, followup: Uncertain) -> VolumeChange {
    let (a, b) = (baseline, followup);
    let sd = (a.sd / a.volume).hypot(b.sd / b.volume);
    let ratio = b.volume / a.volume;
    let end = |z: f64| 100.0 * (ratio * (z * sd).exp() - 1.0);
    let ci95_percent = [end(-NORMAL_95), end(NORMAL_95)];
    VolumeChange {
        volume_mm3: b.volume - a.volume,
        percent: 100.0 * (ratio - 1.0),
        ci95_percent,
        significant: ci95_percent[0] > 0.0 || ci95_percent[1] < 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cubic_lattice_has_matherons_constant() {
        let c = digitisation_variance_per_area(DVec3::ONE);
        // 16.5323 / (8 pi^3), the Epstein zeta value of the cubic lattice.
        assert!((c - 0.06665).abs() < 3e-4, "{c}");
        let scaled = digitisation_variance_per_area(DVec3::splat(2.0));
        assert!((scaled / c - 16.0).abs() < 1e-9);
    }

    #[test]
    fn few_repeats_widen_as_students_table_says() {
        for (n, t) in [
            (1, 12.706),
            (5, 2.571),
            (10, 2.228),
            (11, 2.2010),
            (20, 2.0860),
            (60, 2.0003),
        ] {
            assert!((student_95(n) - t).abs() < 2e-4, "{n}: {}", student_95(n));
        }
        assert!((student_95(100_000) - NORMAL_95).abs() < 1e-4);
    }

    #[test]
    fn intervals_are_symmetric_in_ratio_and_hold_the_estimate() {
        let at = |volume: f64| Uncertain {
            volume,
            sd: 0.05 * volume,
        };
        let c = volume_change(at(100.0), at(130.0));
        assert!((c.percent - 30.0).abs() < 1e-12 && c.significant);
        let [lo, hi] = c.ci95_percent.map(|p| 1.0 + p / 100.0);
        assert!((lo * hi - 1.3 * 1.3).abs() < 1e-12);
        assert!(!volume_change(at(100.0), at(105.0)).significant);
    }
}
