//! Truncated least squares by graduated non-convexity.
//!
//! In: matched points, prior weights, inlier bound c. Out: the pose that minimises `sum w min(r^2, c^2)`, approached
//! through a family of surrogates that starts convex.
//!
//! 1. Fit with the prior weights; `mu = c^2 / (2 r_max^2 - c^2)`. When `2 r_max^2 <= c^2` every pair is an inlier.
//! 2. Weights: 0 when `r^2 >= c^2 (mu + 1) / mu`; 1 when `r^2 <= c^2 mu / (mu + 1)`; else `(c / r) sqrt(mu (mu + 1)) - mu`.
//! 3. Fit with those weights times the prior; `mu *= 1.4`; until the cost `sum w r^2` settles or weights are 0 or 1.
//!
//! H. Yang, P. Antonante, V. Tzoumas, L. Carlone, "Graduated non-convexity for robust spatial perception: from
//! non-minimal solvers to global outlier rejection", IEEE RA-L 5(2), 2020, section IV-B. Tolerates outliers up to about
//! 80 %; prune by consistency before. Fails with a typed error when the pairs kept no longer determine a rotation.
//! Cost: O(n) an iteration.

use super::fit::{Pose, PoseError, check_pairs, fit};
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

/// How to fit robustly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GncSettings {
    /// Largest residual of an inlier, in the points' unit.
    pub inlier_bound: f64,
    /// Also estimate a scale.
    pub with_scale: bool,
    /// Growth of mu an iteration (Yang et al. 2020: 1.4).
    pub growth: f64,
    /// Most iterations (TEASER++: 100).
    pub max_iterations: usize,
    /// Relative change of the cost that counts as settled.
    pub cost_tolerance: f64,
}

impl Default for GncSettings {
    fn default() -> Self {
        Self {
            inlier_bound: 1.0,
            with_scale: false,
            growth: 1.4,
            max_iterations: 100,
            cost_tolerance: 1e-9,
        }
    }
}

/// A robust fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GncFit {
    /// The pose.
    pub pose: Pose,
    /// Final weight of every pair in [0, 1], without the prior.
    pub weights: Vec<f64>,
    /// Iterations done.
    pub iterations: usize,
    /// Whether the cost settled.
    pub converged: bool,
}

/// Fits a pose by graduated non-convexity.
///
/// # Errors
/// When the input is malformed or the pairs kept do not determine a rotation.
pub fn fit_gnc(
    source: &[Point3<f64>],
    target: &[Point3<f64>],
    prior: &[f64],
    settings: &GncSettings,
) -> Result<GncFit, PoseError> {
    check_pairs(source, target, prior)?;
    check_settings(settings)?;
    let c2 = settings.inlier_bound * settings.inlier_bound;
    let mut pose = fit(source, target, prior, settings.with_scale)?;
    let mut weights = vec![1.0; source.len()];
    let squares = |pose: &Pose| -> Vec<f64> {
        source
            .iter()
            .zip(target)
            .map(|(p, q)| (pose.apply(p) - q).norm_squared())
            .collect()
    };
    let mut residuals = squares(&pose);
    let counted = residuals.iter().zip(prior).filter(|(_, w)| **w > 0.0);
    let largest = counted.fold(0.0, |m: f64, (r, _)| m.max(*r));
    if 2.0 * largest <= c2 {
        return Ok(GncFit {
            pose,
            weights,
            iterations: 0,
            converged: true,
        });
    }
    let mut mu = c2 / (2.0 * largest - c2);
    let mut last_cost = f64::INFINITY;
    for iteration in 1..=settings.max_iterations {
        for (w, r2) in weights.iter_mut().zip(&residuals) {
            *w = truncated_weight(*r2, c2, mu);
        }
        let both: Vec<f64> = weights.iter().zip(prior).map(|(w, p)| w * p).collect();
        pose = fit(source, target, &both, settings.with_scale)?;
        residuals = squares(&pose);
        let cost: f64 = residuals.iter().zip(&both).map(|(r, w)| r * w).sum();
        let binary = weights.iter().all(|w| *w == 0.0 || *w == 1.0);
        if (cost - last_cost).abs() <= settings.cost_tolerance * cost.max(c2 * 1e-9) && binary {
            return Ok(GncFit {
                pose,
                weights,
                iterations: iteration,
                converged: true,
            });
        }
        last_cost = cost;
        mu *= settings.growth;
    }
    Ok(GncFit {
        pose,
        weights,
        iterations: settings.max_iterations,
        converged: false,
    })
}

/// The weight of a squared residual at one stage of the relaxation.
fn truncated_weight(r2: f64, c2: f64, mu: f64) -> f64 {
    if r2 >= c2 * (mu + 1.0) / mu {
        0.0
    } else if r2 <= c2 * mu / (mu + 1.0) {
        1.0
    } else {
        ((c2 / r2).sqrt() * (mu * (mu + 1.0)).sqrt() - mu).clamp(0.0, 1.0)
    }
}

fn check_settings(s: &GncSettings) -> Result<(), PoseError> {
    let positive = "it must be a finite number above 0";
    if !(s.inlier_bound.is_finite() && s.inlier_bound > 0.0) {
        return Err(PoseError::BadSetting {
            name: "inlier_bound",
            value: s.inlier_bound,
            expected: positive,
        });
    }
    if !(s.growth.is_finite() && s.growth > 1.0) {
        let expected = "it must be a finite number above 1";
        return Err(PoseError::BadSetting {
            name: "growth",
            value: s.growth,
            expected,
        });
    }
    Ok(())
}
