//! Weighted least-squares pose of matched points.
//!
//! In: points `p_k` (source), `q_k` (target), weights `w_k >= 0`. Out: rotation R, translation t and, when asked for,
//! scale s that minimise `sum w_k | q_k - s R p_k - t |^2`.
//!
//! ```text
//! pm = sum w p / sum w,  qm = sum w q / sum w
//! H  = sum w (p - pm)(q - qm)^T = U S V^T,   d = sign det(V U^T)
//! R  = V diag(1, 1, d) U^T
//! s  = tr(S diag(1, 1, d)) / sum w |p - pm|^2
//! t  = qm - s R pm
//! ```
//!
//! W. Kabsch, Acta Cryst. A32 (1976); S. Umeyama, "Least-squares estimation of transformation parameters between two
//! point patterns", IEEE PAMI 13(4), 1991. The rotation is unique when `S_2 + d S_3 > 0`; that margin, relative to `S_1`, is
//! reported, and points on a line (margin zero) are refused. Points in a plane are fine. Cost: O(n).

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Below this margin the rotation is rounding noise.
const LEAST_MARGIN: f64 = 1e-9;

/// Why points do not determine a pose.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PoseError {
    /// The lists differ in length.
    #[error(
        "{source_count} source points, {target} target points and {weights} weights; give one each a pair"
    )]
    Length {
        /// Source points.
        source_count: usize,
        /// Target points.
        target: usize,
        /// Weights.
        weights: usize,
    },
    /// A coordinate or weight is not finite, or a weight is negative.
    #[error("pair {index}: coordinates and weights must be finite, weights at least 0")]
    BadPair {
        /// Position of the pair.
        index: usize,
    },
    /// A setting is out of range.
    #[error("setting {name} is {value}; {expected}")]
    BadSetting {
        /// Name of the setting.
        name: &'static str,
        /// Value found.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// Fewer than three pairs with weight, all on a line, or mirror-symmetric: infinitely many rotations fit alike.
    #[error(
        "{pairs} weighted pairs leave the rotation free (margin {margin:.1e}); give at least 3 pairs off one line"
    )]
    Underdetermined {
        /// Pairs of positive weight.
        pairs: usize,
        /// `(S_2 + d S_3) / S_1`.
        margin: f64,
    },
}

/// A similarity that takes source coordinates to target coordinates: `q = R (s p) + t`.
#[allow(non_snake_case)] // frames in names: T_target_source
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Rotation and translation.
    pub T_target_source: Isometry3<f64>,
    /// Scale, applied first; 1 for a rigid pose.
    pub scale: f64,
    /// Weighted root mean square residual, in the points' unit.
    pub rms: f64,
    /// How well the rotation is determined: `(S_2 + d S_3) / S_1`, 0 not at all, towards 2 for points spread alike in
    /// all directions.
    pub rotation_margin: f64,
}

impl Pose {
    /// Takes a source point to the target.
    pub fn apply(&self, source: &Point3<f64>) -> Point3<f64> {
        self.T_target_source * (source * self.scale)
    }
}

/// Fits a rigid pose.
///
/// # Errors
/// When lists differ in length, a number is not finite, or the rotation is not determined.
///
/// # Example
/// ```
/// use matchers::pose::fit_rigid;
/// use nalgebra::{Isometry3, Point3, Vector3};
/// let truth = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, -0.2, 0.9));
/// let source = [Point3::new(0.0, 0.0, 0.0), Point3::new(4.0, 0.0, 0.0), Point3::new(0.0, 3.0, 1.0)];
/// let target = source.map(|p| truth * p);
/// let pose = fit_rigid(&source, &target, &[1.0; 3]).unwrap();
/// assert!((pose.T_target_source.inverse() * truth).rotation.angle() < 1e-12);
/// ```
pub fn fit_rigid(source: &[Point3<f64>], target: &[Point3<f64>], weights: &[f64]) -> Result<Pose, PoseError> {
    check_pairs(source, target, weights)?;
    fit(source, target, weights, false)
}

/// Fits a rigid pose and a scale.
///
/// # Errors
/// As [`fit_rigid`].
pub fn fit_similarity(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    weights: &[f64],
) -> Result<Pose, PoseError> {
    check_pairs(source, target, weights)?;
    fit(source, target, weights, true)
}

pub(super) fn check_pairs(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    weights: &[f64],
) -> Result<(), PoseError> {
    if source.len() != target.len() || source.len() != weights.len() {
        let (source_count, target, weights) = (source.len(), target.len(), weights.len());
        return Err(PoseError::Length {
            source_count,
            target,
            weights,
        });
    }
    let finite = |p: &Point3<f64>| p.iter().all(|v| v.is_finite());
    let bad = |k: &usize| {
        let w = weights[*k];
        !finite(&source[*k]) || !finite(&target[*k]) || !w.is_finite() || w < 0.0
    };
    match (0..source.len()).find(bad) {
        Some(index) => Err(PoseError::BadPair { index }),
        None => Ok(()),
    }
}

pub(super) fn fit(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    weights: &[f64],
    with_scale: bool,
) -> Result<Pose, PoseError> {
    let pairs = weights.iter().filter(|w| **w > 0.0).count();
    let total: f64 = weights.iter().sum();
    if pairs < 3 {
        return Err(PoseError::Underdetermined { pairs, margin: 0.0 });
    }
    let mean = |points: &[Point3<f64>]| -> Vector3<f64> {
        points
            .iter()
            .zip(weights)
            .map(|(p, w)| p.coords * *w)
            .sum::<Vector3<f64>>()
            / total
    };
    let (pm, qm) = (mean(source), mean(target));
    let mut h = Matrix3::zeros();
    let mut spread = 0.0;
    for ((p, q), w) in source.iter().zip(target).zip(weights) {
        let (p, q) = (p.coords - pm, q.coords - qm);
        h += *w * p * q.transpose();
        spread += w * p.norm_squared();
    }
    let svd = h.svd(true, true);
    let u = svd.u.expect("asked for");
    let v = svd.v_t.expect("asked for").transpose();
    let d = if (v * u.transpose()).determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let s = svd.singular_values;
    let margin = if s[0] > 0.0 { (s[1] + d * s[2]) / s[0] } else { 0.0 };
    if margin < LEAST_MARGIN {
        return Err(PoseError::Underdetermined { pairs, margin });
    }
    let r = v * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, d)) * u.transpose();
    let scale = if with_scale {
        (s[0] + s[1] + d * s[2]) / spread
    } else {
        1.0
    };
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r));
    let t = qm - rotation * pm * scale;
    let mut pose = Pose {
        T_target_source: Isometry3::from_parts(Translation3::from(t), rotation),
        scale,
        rms: 0.0,
        rotation_margin: margin,
    };
    let squares: f64 = source
        .iter()
        .zip(target)
        .zip(weights)
        .map(|((p, q), w)| w * (pose.apply(p) - q).norm_squared())
        .sum();
    pose.rms = (squares / total).sqrt();
    Ok(pose)
}
