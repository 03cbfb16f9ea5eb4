//! Partial shapes: half a bone on a whole one, or two halves that share a half.
//!
//! In: two views. Out: verified poses by free-space score, best first.
//!
//! 1. Poses from oriented point pairs ([`super::pairs`]); plus any extra guesses.
//! 2. 20 points source to target with wide tolerances; below -0.2 a pose is dropped; then 60 points; the best go on.
//! 3. Both directions with 150 points; within 8 degrees and 3 % of a better one dropped.
//! 4. Eight iterations of the robust refinement ([`super::refine`]), tolerance 8 % to 4 %, nearest points from the tables; score with
//!    400 points; within 6 degrees and 2.5 % of a better one dropped.
//! 5. Twelve iterations 4 % to 2 % with 800 points, six with nearest points from the kd-tree to 1.5 %; the finest score decides.
//!
//! A second round with ten times the poses runs when the best score is below 0.4 or a rival over 15 degrees away is within 0.4.
//!
//! Of unknown size: the source at seven sizes ([`super::sizes`]), each with four tenths of the poses, a second round for the best two of them when
//! needed; the last refinement has the size as its seventh unknown.
//!
//! Measured on carpals, both cut to two thirds by opposite half-spaces, 1 % noise: every stage above is wide enough that the
//! right pose survives; see `BENCHMARKS.md`. Cost: about 0.3 s of one core after the views are made, 1 s for a second round.

use super::oriented::View;
use super::pairs::PairTable;
use super::refine::{Level, refine};
use super::score::{FINE, ScoreScale, both_ways, one_way, turn_of};
use crate::geometry::Rigid;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// A pose with its score.
#[derive(Clone, Debug)]
pub(crate) struct PartialFit {
    pub(crate) pose: Rigid,
    pub(crate) score: f64,
}

/// How many poses each stage keeps.
#[derive(Clone, Copy, Debug)]
struct Budget {
    poses: usize,
    scored: usize,
    refined: usize,
    finished: usize,
}

impl Budget {
    /// The funnel that found 50 of 50 with 10 000 poses (2 000, 150, 15) and with 100 000 (20 000, 600, 40).
    fn of(poses: usize) -> Self {
        let wide = poses > 30_000;
        Self {
            poses,
            scored: (poses / 5).max(200),
            refined: if wide { 600 } else { 150 },
            finished: if wide { 40 } else { 15 },
        }
    }
}

/// Farthest that a fit may go from the size it was started at (logarithm): two steps of [`super::sizes`].
const FARTHEST_SIZE: f64 = 0.15;

const COARSE: ScoreScale = ScoreScale {
    inlier: 0.04,
    free: 0.05,
    cosine: 0.5,
    violation: 1.0,
};
const MIDDLE: ScoreScale = ScoreScale {
    inlier: 0.025,
    free: 0.04,
    cosine: 0.6,
    violation: 1.75,
};
/// A second round is not needed above this score: half-overlapping bones at 1 % noise have it.
pub(crate) const GOOD_SCORE: f64 = 0.4;
/// ... when every rival is this far below: the most that a wrong pose was ahead of its rivals is 0.22.
pub(crate) const CLEAR_MARGIN: f64 = 0.4;
/// A rival is a pose farther than this, degrees.
pub(crate) const RIVAL_DEG: f64 = 15.0;

/// Finds the poses of two shapes that may be partial. `guesses` are extra poses in view coordinates.
pub(crate) fn partial(
    source: &View,
    target: &View,
    guesses: &[Rigid],
    poses: usize,
    escalated: usize,
    seed: u64,
) -> Vec<PartialFit> {
    let table = PairTable::new(source, target);
    let first = round(source, target, &table, guesses, Budget::of(poses), seed, false);
    let sure = first.first().is_some_and(|best| {
        best.score >= GOOD_SCORE && rival(&first).is_none_or(|r| r <= best.score - CLEAR_MARGIN)
    });
    if sure || escalated <= poses {
        return first;
    }
    // The first round's poses compete again, so that a second round never loses what the first had found.
    let found: Vec<Rigid> = guesses
        .iter()
        .copied()
        .chain(first.iter().map(|f| f.pose))
        .collect();
    round(
        source,
        target,
        &table,
        &found,
        Budget::of(escalated),
        seed.wrapping_add(1),
        false,
    )
}

/// One round of poses whose size is within a few percent of the source's; the last refinement finds it.
pub(crate) fn one_size(
    source: &View,
    target: &View,
    guesses: &[Rigid],
    poses: usize,
    seed: u64,
) -> Vec<PartialFit> {
    let table = PairTable::new(source, target);
    round(source, target, &table, guesses, Budget::of(poses), seed, true)
}

/// Score of the best pose over 15 degrees from the first.
pub(crate) fn rival(fits: &[PartialFit]) -> Option<f64> {
    let best = fits.first()?;
    fits.iter()
        .find(|f| f.pose.rotation_angle_deg(&best.pose) > RIVAL_DEG)
        .map(|f| f.score)
}

fn round(
    source: &View,
    target: &View,
    table: &PairTable,
    guesses: &[Rigid],
    budget: Budget,
    seed: u64,
    scale: bool,
) -> Vec<PartialFit> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut poses = guesses.to_vec();
    poses.extend(table.poses(source, target, budget.poses, &mut rng));
    let coarse: Vec<f64> = poses
        .par_iter()
        .map(|pose| {
            if one_way(source, 20, target, pose, COARSE) < -0.2 {
                return f64::NEG_INFINITY;
            }
            one_way(source, 60, target, pose, COARSE)
        })
        .collect();
    let fits = keep(poses, coarse, budget.scored);
    let fits = rescore(fits, |pose| (pose, both_ways(source, target, &pose, 150, COARSE)));
    let fits = thin(fits, 8.0, 0.03, budget.refined);
    let level = Level {
        iterations: 8,
        from: 0.08,
        to: 0.04,
        count: 200,
        exact: false,
        cosine: 0.6,
        by_noise: false,
    };
    let fits = rescore(fits, |pose| {
        let pose = refine(source, target, pose, level, false);
        (pose, both_ways(source, target, &pose, 400, MIDDLE))
    });
    let fits = thin(fits, 6.0, 0.025, budget.finished);
    let fits = rescore(fits, |pose| finish(source, target, pose, scale));
    thin(fits, 6.0, 0.025, budget.finished)
}

/// The last refinement of a partial pose, its size included when asked for, and its score at the finest scale.
fn finish(source: &View, target: &View, pose: Rigid, scale: bool) -> (Rigid, f64) {
    let level = Level {
        iterations: 12,
        from: 0.04,
        to: 0.02,
        count: 800,
        exact: false,
        cosine: 0.6,
        by_noise: false,
    };
    let pose = refine(source, target, pose, level, false);
    let exact = Level {
        iterations: 6,
        from: 0.02,
        to: 0.015,
        count: 800,
        exact: true,
        cosine: 0.6,
        by_noise: false,
    };
    let pose = refine(source, target, pose, exact, false);
    let pose = if scale {
        let start = Level { from: 0.03, ..level };
        let grown = refine(
            source,
            target,
            refine(source, target, pose, start, true),
            exact,
            true,
        );
        if near_its_size(&grown) { grown } else { pose }
    } else {
        pose
    };
    (pose, both_ways(source, target, &pose, usize::MAX, FINE))
}

/// Whether a fit has stayed near the size it was started at. A piece of a smooth surface hardly tells its size, and a fit that runs away
/// has found none.
pub(crate) fn near_its_size(pose: &Rigid) -> bool {
    pose.linear.determinant().abs().cbrt().ln().abs() < FARTHEST_SIZE
}

fn rescore(fits: Vec<PartialFit>, better: impl Fn(Rigid) -> (Rigid, f64) + Sync) -> Vec<PartialFit> {
    let mut fits: Vec<PartialFit> = fits
        .into_par_iter()
        .map(|fit| {
            let (pose, score) = better(fit.pose);
            PartialFit { pose, score }
        })
        .collect();
    fits.sort_by(|a, b| b.score.total_cmp(&a.score));
    fits
}

fn keep(poses: Vec<Rigid>, scores: Vec<f64>, count: usize) -> Vec<PartialFit> {
    let mut fits: Vec<PartialFit> = poses
        .into_iter()
        .zip(scores)
        .filter(|(_, score)| *score > f64::NEG_INFINITY)
        .map(|(pose, score)| PartialFit { pose, score })
        .collect();
    fits.sort_by(|a, b| b.score.total_cmp(&a.score));
    fits.truncate(count);
    fits
}

/// Keeps up to `count` poses, the best first, none near a better one: nearer than `degrees` and `shift` together.
fn thin(fits: Vec<PartialFit>, degrees: f64, shift: f64, count: usize) -> Vec<PartialFit> {
    let mut out: Vec<PartialFit> = Vec::with_capacity(count);
    let least_trace = 1.0 + 2.0 * degrees.to_radians().cos();
    for fit in fits {
        if out.len() >= count {
            break;
        }
        let near = |k: &PartialFit| {
            let (a, b) = (turn_of(&k.pose), turn_of(&fit.pose));
            let trace = a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis);
            trace > least_trace && k.pose.translation.distance(fit.pose.translation) < shift
        };
        if !out.iter().any(near) {
            out.push(fit);
        }
    }
    out
}
