//! Noise, outliers and order: what happens to points between a surface and a file.

use super::{generator, stream};
use crate::mesh::Bounds;
use glam::DVec3;
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_distr::StandardNormal;

/// Adds isotropic Gaussian noise of standard deviation `sigma` mm **a coordinate**.
///
/// For noise in units of the spacing or of the diagonal multiply by [`mean_spacing`] or by
/// [`Bounds::diagonal`]. `sigma = 0` returns the points unchanged.
pub fn add_noise(points: &[DVec3], sigma: f64, seed: u64) -> Vec<DVec3> {
    let mut rng = generator(seed, stream::NOISE);
    let mut normal = || -> f64 { rng.sample(StandardNormal) };
    points
        .iter()
        .map(|&p| {
            let d = DVec3::new(normal(), normal(), normal());
            p + sigma * d
        })
        .collect()
}

/// Appends `round(fraction * n)` points uniform in the bounding box inflated by `inflate` times its diagonal.
///
/// The first `n` points are the given ones, in their order, so that truth by index stays valid.
pub fn add_outliers(points: &[DVec3], fraction: f64, inflate: f64, seed: u64) -> Vec<DVec3> {
    let Some(bounds) = Bounds::of(points) else {
        return Vec::new();
    };
    let bounds = bounds.inflated(inflate * bounds.diagonal());
    let mut rng = generator(seed, stream::OUTLIERS);
    let mut all = points.to_vec();
    let extra = (fraction * points.len() as f64).round() as usize;
    all.extend((0..extra).map(|_| {
        let u = DVec3::new(rng.random(), rng.random(), rng.random());
        bounds.min + u * bounds.size()
    }));
    all
}

/// The spacing that noise is measured in: the side of the square that each point owns, `sqrt(area / n)`, mm.
///
/// For blue noise this is within a few percent of the mean distance between natural neighbours; it does
/// not depend on how irregular the sampling is, so noise levels compare across samplings.
pub fn mean_spacing(area: f64, n: usize) -> f64 {
    (area / n.max(1) as f64).sqrt()
}

/// A random permutation of `0..n`; entry `i` is the old index of the new point `i`.
pub fn shuffle(n: usize, seed: u64) -> Vec<u32> {
    let mut order: Vec<u32> = (0..n as u32).collect();
    order.shuffle(&mut generator(seed, stream::SHUFFLE));
    order
}
