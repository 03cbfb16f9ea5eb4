//! Generators of a raw cloud: its distinct points, and an estimate of their spacing.
//!
//! On a surface the `k` nearest neighbours of a point fill a disk: `k = pi r_k^2 / s^2`, so `s = r_k sqrt(pi / k)`. The median
//! over the points does not mind borders, creases and a few outliers. Cost `O(n log n)`.

use super::{Sampling, SamplingError, distinct};
use crate::{
    geometry::Neighbours,
    input::shape::{Generators, PointCloud},
};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Neighbours that make the estimate steady and still local.
const NEIGHBOURS: usize = 8;

/// Points asked at most; a median of so many is within 1 %.
const ASKED: usize = 20_000;

/// The distinct points of a cloud.
///
/// # Errors
/// [`SamplingError::TooFew`] when fewer than four are distinct.
pub fn generators(cloud: &PointCloud) -> Result<Sampling, SamplingError> {
    let (points, source) = distinct(&cloud.points);
    if points.len() < 4 {
        return Err(SamplingError::TooFew {
            distinct: points.len(),
        });
    }
    let spacing_mm = spacing_mm(&points);
    let mut remarks = vec![format!("{} points about {spacing_mm:.4} mm apart", points.len())];
    let twins = cloud.points.len() - points.len();
    if twins > 0 {
        remarks.push(format!(
            "{twins} points are exact copies of others and were left out"
        ));
    }
    Ok(Sampling {
        generators: Generators {
            points,
            source,
            known_surface: None,
            spacing_mm,
        },
        feature_samples: 0,
        remarks,
    })
}

/// Mean spacing of distinct points of a surface, mm; see the module's documentation.
pub fn spacing_mm(points: &[DVec3]) -> f64 {
    let tree = Neighbours::new(points);
    let k = NEIGHBOURS.min(points.len().saturating_sub(1));
    if k == 0 {
        return 0.0;
    }
    let step = points.len().div_ceil(ASKED);
    let mut spacings: Vec<f64> = points
        .par_iter()
        .step_by(step)
        .map(|&p| {
            let last = tree.knn(p, k + 1)[k]; // the point itself comes first
            (PI * last.distance2 / k as f64).sqrt()
        })
        .collect();
    let middle = spacings.len() / 2;
    *spacings.select_nth_unstable_by(middle, f64::total_cmp).1
}
