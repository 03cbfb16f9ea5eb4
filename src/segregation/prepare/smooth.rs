//! Moving least squares: every point moves along the local normal onto a quadratic fitted to its neighbours.
//!
//! In: points, lists, a plan. Out: the points moved, lists of the moved points.
//!
//! One pass, at every point: weights `exp(-d^2 / (0.4 R^2))` with `R` the distance of the farthest neighbour; weighted
//! principal frame; quadratic height fit with two re-weightings `w / (1 + (res / 2.5 sigma)^2)^2` (sigma from the median
//! absolute residual), so that a second sheet or an outlier near by does not pull; the move is at most `R`. After Levin 1998
//! and Alexa et al. 2003, with the frame of the principal axes instead of a non-linear plane search.

use super::knn::KnnLists;
use super::local_fit::{MOST, fit_heights, principal_frame};
use super::noise::SmoothingPlan;
use glam::DVec3;
use rayon::prelude::*;

/// Width of the weights over the squared distance of the farthest neighbour.
const WIDTH: f64 = 0.4;
/// Re-weighting steps.
const REWEIGHTINGS: usize = 2;
/// Residuals are compared with this many robust standard deviations.
const DEVIATIONS: f64 = 2.5 * 1.48;

/// Makes the passes of the plan; `lists` are those of the moved points afterwards.
pub fn smooth(points: &mut Vec<DVec3>, lists: &mut KnnLists, plan: &SmoothingPlan) {
    for pass in 0..plan.passes {
        if pass > 0 || lists.k() < plan.neighbours {
            *lists = KnnLists::new(points, plan.neighbours);
        }
        let moved: Vec<DVec3> = (0..points.len())
            .into_par_iter()
            .map(|i| project(points, lists.first(i, plan.neighbours), points[i]).unwrap_or(points[i]))
            .collect();
        *points = moved;
    }
    *lists = KnnLists::new(points, super::noise::LARGE);
}

/// Where one point goes; `None` when its neighbours determine no surface.
fn project(points: &[DVec3], list: &[u32], origin: DVec3) -> Option<DVec3> {
    let list = &list[..list.len().min(MOST)];
    let near = list.iter().map(|&j| points[j as usize]);
    let reach2 = near
        .clone()
        .map(|p| p.distance_squared(origin))
        .fold(0.0, f64::max);
    if reach2 <= 0.0 {
        return None;
    }
    let mut base = [0.0f64; MOST];
    for (w, p) in base.iter_mut().zip(near.clone()) {
        *w = (-p.distance_squared(origin) / (WIDTH * reach2)).exp();
    }
    let base = &base[..list.len()];
    let frame = principal_frame(near.clone(), base)?;
    let reach = reach2.sqrt();
    let mut fit = fit_heights(origin, frame, near.clone(), base, reach)?;
    let mut weights = [0.0f64; MOST];
    let mut residuals = [0.0f64; MOST];
    for _ in 0..REWEIGHTINGS {
        for (r, p) in residuals.iter_mut().zip(near.clone()) {
            *r = fit.residual(p).abs();
        }
        let mut sorted = residuals;
        let middle = list.len() / 2;
        let median = *sorted[..list.len()]
            .select_nth_unstable_by(middle, f64::total_cmp)
            .1;
        if median <= 1e-12 * reach {
            break;
        }
        for k in 0..list.len() {
            let x = residuals[k] / (DEVIATIONS * median);
            weights[k] = base[k] / (1.0 + x * x).powi(2);
        }
        fit = fit_heights(origin, frame, near.clone(), &weights[..list.len()], reach)?;
    }
    let step = fit.height_at_origin().clamp(-reach, reach);
    Some(origin + step * frame.z_axis)
}
