//! Is one pose of whole shapes better than another by more than the shapes differ from place to place?
//!
//! In: two views and two poses. Out: by how many standard errors the first fits better.
//!
//! The ratio of two residuals says little when the shapes themselves differ: two persons' bones leave a residual of 2 to 5 % in
//! the right pose, and a wrong one adds to it only where the bone is not nearly symmetric. What counts is whether the
//! advantage is there over most of the surface or in a few places only.
//!
//! 1. Each surface is split into [`PATCHES`] patches (farthest point sampling), about a tenth of the diagonal wide: over that
//!    length two persons' bones differ in one piece.
//! 2. Every patch says by how much its mean squared distance is smaller under the first pose.
//! 3. The mean of those over its standard error is a paired t statistic. The two directions see the same differences,
//!    so that they count as one set of patches.
//!
//! Cost: two exact distances a sample. Degenerate: identical advantages (exactly symmetric shapes) have no lead.

use super::oriented::View;
use super::surface::Distances;
use crate::geometry::Rigid;
use glam::DVec3;

/// Patches of each surface.
const PATCHES: usize = 32;
/// Samples of each surface.
const SAMPLES: usize = 2000;

/// By how many standard errors `best` fits better than `rival`; both take `source` to `target`. Distances over `clip` count as that.
pub(crate) fn lead(source: &View, target: &View, best: &Rigid, rival: &Rigid, clip: f64) -> f64 {
    let [ours, theirs] = [best, rival].map(|pose| {
        let mut d = Distances::new(source, target, pose, SAMPLES);
        for d in d.there.iter_mut().chain(&mut d.back) {
            *d = d.min(clip);
        }
        d
    });
    let mut gains = patch_gains(&source.points, &ours.there, &theirs.there);
    gains.extend(patch_gains(&target.points, &ours.back, &theirs.back));
    let n = gains.len() as f64;
    if n < 4.0 {
        return 0.0;
    }
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (variance / (0.5 * n)).sqrt();
    if error > 0.0 { mean / error } else { 0.0 }
}

/// Mean advantage of the first distances over the second, squared, for each patch.
fn patch_gains(points: &[DVec3], ours: &[f64], theirs: &[f64]) -> Vec<f64> {
    let points = &points[..ours.len()];
    let mut patch = vec![0usize; points.len()];
    let mut nearest = vec![f64::INFINITY; points.len()];
    let mut seed = 0;
    let count = PATCHES.min(points.len());
    for k in 0..count {
        let centre = points[seed];
        for (i, p) in points.iter().enumerate() {
            let d = p.distance_squared(centre);
            if d < nearest[i] {
                nearest[i] = d;
                patch[i] = k;
            }
        }
        let far = (0..points.len()).max_by(|&a, &b| nearest[a].total_cmp(&nearest[b]));
        seed = far.unwrap_or(0);
    }
    let mut sums = vec![(0.0, 0usize); count];
    for (i, &k) in patch.iter().enumerate() {
        sums[k].0 += theirs[i] * theirs[i] - ours[i] * ours[i];
        sums[k].1 += 1;
    }
    sums.iter()
        .filter(|s| s.1 > 0)
        .map(|s| s.0 / s.1 as f64)
        .collect()
}
