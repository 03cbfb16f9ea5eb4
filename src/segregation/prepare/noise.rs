//! The noise level of a cloud, from the cloud alone.
//!
//! In: points and neighbour lists. Out: noise standard deviation over local spacing.
//!
//! 1. At every point fit a quadratic height field to its `k` nearest; `sigma_k` is the rms residual over `k - 6` degrees of
//!    freedom, divided by the local spacing. The median over all points is `r_k`.
//! 2. With strong noise the fit turns with the points and reads too little, the more the fewer they are; a table made on a
//!    plane ([`TRUTH`]) takes that back.
//! 3. Curvature, sharp edges and second sheets bias `r_k` upward. The bias of a quadratic fit grows like the cube of its
//!    width, that is `k^(3/2)`, so its square grows like `k^3`, and two sizes remove it (Richardson extrapolation):
//!    `r^2 = (r16^2 - (16/24)^3 r24^2) / (1 - (16/24)^3)`.
//!
//! Measured over 9 shapes: 0 reads at most 0.027, 0.05 at least 0.050, 0.25 reads 0.248-0.305; 0.5 reads at most 0.62 where
//! parts are three to five spacings thick, which 32 neighbours alone read as 0.64-0.78.

use super::knn::KnnLists;
use super::local_fit::plain_fit;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Neighbours of the smaller fit.
pub const SMALL: usize = 16;
/// Neighbours of the larger fit.
pub const LARGE: usize = 24;
/// Noise over spacing of a plane, and what the two sizes read there (20 000 points).
const TRUTH: [f64; 9] = [0.0, 0.2, 0.35, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
const READ_SMALL: [f64; 9] = [0.0, 0.200, 0.343, 0.469, 0.542, 0.597, 0.639, 0.672, 0.696];
const READ_LARGE: [f64; 9] = [0.0, 0.200, 0.347, 0.485, 0.569, 0.643, 0.706, 0.757, 0.800];
/// Noise over spacing below which nothing is done: between the readings of 0 (at most 0.027) and 0.05 (at least 0.050).
pub const THRESHOLD: f64 = 0.03;

/// A measured noise level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseLevel {
    /// Noise standard deviation over local spacing.
    pub noise_over_spacing: f64,
    /// Median local spacing, mm.
    pub spacing_mm: f64,
}

/// How a level of noise is removed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SmoothingPlan {
    /// The level: noise standard deviation over local spacing.
    pub noise_over_spacing: f64,
    /// Moving-least-squares passes.
    pub passes: usize,
    /// Neighbours in a pass.
    pub neighbours: usize,
    /// Radius of the thinning over the local spacing.
    pub thinning: f64,
}

impl SmoothingPlan {
    /// The plan of the weakest noise for this level: it moves thin parts least.
    pub fn light(self) -> Self {
        Self {
            noise_over_spacing: self.noise_over_spacing,
            ..plan(THRESHOLD).unwrap_or(self)
        }
    }
}

/// The plan for a level; `None` when it is below [`THRESHOLD`]. Sizes measured: one or two passes suffice for the shape,
/// more of them move thin parts.
pub fn plan(noise_over_spacing: f64) -> Option<SmoothingPlan> {
    let plan = |passes, neighbours, thinning| {
        Some(SmoothingPlan {
            noise_over_spacing,
            passes,
            neighbours,
            thinning,
        })
    };
    match noise_over_spacing {
        r if r < THRESHOLD => None,
        r if r < 0.07 => plan(1, 18, 0.4),
        r if r < 0.15 => plan(1, 24, 0.4),
        r if r < 0.35 => plan(2, 32, 0.55),
        _ => plan(3, 48, 0.55),
    }
}

/// Measures the level; the lists hold at least [`LARGE`] neighbours where there are as many points.
pub fn estimate(points: &[DVec3], lists: &KnnLists) -> NoiseLevel {
    let small = residuals(points, lists, SMALL);
    let large = residuals(points, lists, LARGE);
    let narrow = unsaturated(median_ratio(&small), &READ_SMALL);
    let wide = unsaturated(median_ratio(&large), &READ_LARGE);
    let share = (SMALL as f64 / LARGE as f64).powi(3);
    NoiseLevel {
        noise_over_spacing: ((narrow * narrow - share * wide * wide) / (1.0 - share))
            .max(0.0)
            .sqrt(),
        spacing_mm: median(small.iter().map(|r| r.spacing_mm).collect()),
    }
}

/// The noise that reads as this on a plane: the table between and beyond its entries.
fn unsaturated(reading: f64, table: &[f64; TRUTH.len()]) -> f64 {
    let above = table.partition_point(|t| *t < reading).clamp(1, TRUTH.len() - 1);
    let (low, high) = (table[above - 1], table[above]);
    let share = (reading - low) / (high - low);
    TRUTH[above - 1] + share * (TRUTH[above] - TRUTH[above - 1])
}

/// Residual of one fit and the spacing it is measured in, mm.
#[derive(Clone, Copy)]
struct Residual {
    sigma_mm: f64,
    spacing_mm: f64,
}

fn residuals(points: &[DVec3], lists: &KnnLists, k: usize) -> Vec<Residual> {
    let all: Vec<Option<Residual>> = (0..points.len())
        .into_par_iter()
        .map(|i| residual(points, lists.first(i, k), points[i]))
        .collect();
    all.into_iter().flatten().collect()
}

/// Residual of one fit over the spacing of its neighbours.
pub(super) fn noise_ratio(points: &[DVec3], list: &[u32], origin: DVec3) -> Option<f64> {
    residual(points, list, origin).map(|r| r.sigma_mm / r.spacing_mm)
}

fn residual(points: &[DVec3], list: &[u32], origin: DVec3) -> Option<Residual> {
    if list.len() <= 6 {
        return None;
    }
    let fit = plain_fit(points, list, origin)?;
    let mut sum = 0.0;
    let mut m2 = 0.0;
    for &j in list {
        let p = points[j as usize];
        sum += fit.residual(p).powi(2);
        m2 += fit.in_plane2(p);
    }
    let k = list.len() as f64;
    let spacing_mm = (2.0 * std::f64::consts::PI * m2 / (k * k)).sqrt();
    (spacing_mm > 0.0).then(|| Residual {
        sigma_mm: (sum / (k - 6.0)).sqrt(),
        spacing_mm,
    })
}

fn median_ratio(residuals: &[Residual]) -> f64 {
    median(residuals.iter().map(|r| r.sigma_mm / r.spacing_mm).collect())
}

/// The upper median; 0 without values.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
