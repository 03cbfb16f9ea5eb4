//! Whole shapes from any pose.
//!
//! In: two views, extra first guesses (from the scaffolds). Out: verified poses, best first.
//!
//! 1. First guesses: moments with flips, swaps and spins ([`crate::matching`]), the scaffolds' own, each handedness allowed.
//! 2. Every guess: 12 iterations on 150 points of each surface, nearest points from the table, tolerance from half the diagonal
//!    to 15 %. Ranked by symmetric root mean square distance, within 8 degrees of a better one dropped, 8 kept.
//! 3. Again with 500 points to 10 %, 4 kept.
//! 4. The exact finish: nearest places on the surfaces themselves, untruncated, until the step vanishes. Untruncated, because two
//!    persons' bones that differ in size fit best as wholes: a narrow tolerance locks on to one matching patch. A few hundred
//!    samples tell basins and handedness apart ([`survey`]); only the winner is worth the whole surface ([`finish`]).
//! 5. From every surveyed pose, a fit that gives up on what does not agree (Geman and McClure's weights, their width following the
//!    distance below which a quarter of the surface lies; Black and Rangarajan 1996). When that quarter comes to lie within 0.3 % of
//!    the diagonal and at less than half its distance, that fit wins: a fragment, a tumour or a lesion must not drag the unchanged surface along, and the
//!    question is what grew on it.
//! 6. Raw clouds that differ by no more than their noise end with the narrow, symmetric point-to-plane fit of partial shapes.
//!
//! The symmetric distance decides. Papers: Besl and McKay 1992, Chen and Medioni 1992; Pottmann et al. 2006 for why the normal
//! part of a distance is its Gauss-Newton model. Cost: some 0.2 s for bones of 20 000 points.

use super::oriented::View;
use super::refine::{Level, refine, rest};
use super::solve::{NormalEquations, cleaned};
use crate::geometry::Rigid;
use crate::matching::moments::from_moments;
use rayon::prelude::*;

/// Poses nearer than this are one pose, degrees.
pub(crate) const SAME_POSE_DEG: f64 = 8.0;
/// Samples of each surface and most iterations by which surveyed poses are compared.
const SURVEY_SAMPLES: usize = 300;
const SURVEY_ITERATIONS: usize = 12;
/// Samples of each surface on the way to the exact finish, and in it. With 2 500 of 4 000 points in it the median error of whole
/// bones at 1 % noise is 0.44 degrees instead of 0.41.
const NEAR_SAMPLES: usize = 600;
const FINISH_SAMPLES: usize = 4000;
/// A fit rests when its step is below this share of the spacing; `converged` asks for 0.001.
const AT_REST: f64 = 3e-4;
/// Share of the surface that must be unchanged for a fit to it alone to win. A swelling as wide as 0.15 diagonals at one end leaves a quarter
/// of a bone in place; with 0.4 two of sixteen such bones end upside down, with 0.25 none.
const UNCHANGED: f64 = 0.25;
/// Width of the robust weights, in distances below which [`UNCHANGED`] of the samples lie; for Gaussian distances that is one standard
/// deviation.
const ROBUST_WIDTH: f64 = 3.0;
/// Largest distance of the part that agrees, in units, when noise is less than twice that: it is the same surface in both. Two persons' bones
/// have a quarter of the surface somewhere that is a fifth as far apart as the rest, but not this close: with no such limit four of
/// seven pairs of one wrist's bones and another's are laid on a likeness, two of them the wrong way round.
const SAME_SURFACE: f64 = 0.003;
/// The part that agrees must lie this much closer than in the fit to all for its own fit to win, and this much for there to be no doubt.
const AGREES_BETTER: f64 = 0.5;
const AGREES_CLEARLY: f64 = 0.2;
/// Most iterations of a robust fit from each surveyed pose, and of the chosen one on all samples.
const ROBUST_ITERATIONS: usize = 40;
/// Most iterations of the exact finish.
const FINISH_ITERATIONS: usize = 60;

/// A pose of whole shapes with its residuals, in units.
#[derive(Clone, Debug)]
pub(crate) struct WholeFit {
    pub(crate) pose: Rigid,
    /// Symmetric root mean square distance.
    pub(crate) rms: f64,
    /// What ranks it: the same, or for a fit to the part that agrees the distance within which that part lies.
    pub(crate) residual: f64,
    /// A fit to the part that agrees.
    pub(crate) robust: bool,
    /// Where the other kind of fit (to all, or to the part that agrees) ends, when the shapes themselves do not decide between the two.
    pub(crate) other_kind: Option<Rigid>,
    /// The last step was below 0.1 % of the spacing.
    pub(crate) converged: bool,
}

/// Distances of both surfaces under a pose, in units: source samples to the target, then target samples to the source.
pub(crate) struct Distances {
    pub(crate) there: Vec<f64>,
    pub(crate) back: Vec<f64>,
}

impl Distances {
    /// Exact distances of up to `count` samples of each view.
    pub(crate) fn new(source: &View, target: &View, pose: &Rigid, count: usize) -> Self {
        let inverse = pose.inverse();
        // Both are measured in the target's frame, so that a similarity cannot win by shrinking the source to a point.
        let scale = pose.linear.determinant().abs().cbrt();
        let there = source.points[..count.min(source.points.len())]
            .par_iter()
            .map(|&p| {
                let q = pose.apply(p);
                target.exact.touch(q).place.distance(q)
            })
            .collect();
        let back = target.points[..count.min(target.points.len())]
            .par_iter()
            .map(|&p| {
                let q = inverse.apply(p);
                source.exact.touch(q).place.distance(q) * scale
            })
            .collect();
        Self { there, back }
    }

    /// Root of the mean over directions of the mean squares.
    pub(crate) fn rms(&self) -> f64 {
        let mean = |d: &[f64]| d.iter().map(|x| x * x).sum::<f64>() / d.len().max(1) as f64;
        (0.5 * (mean(&self.there) + mean(&self.back))).sqrt()
    }

    /// The value below which `share` of all distances lie.
    pub(crate) fn quantile(&self, share: f64) -> f64 {
        let mut all: Vec<f64> = self.there.iter().chain(&self.back).copied().collect();
        if all.is_empty() {
            return 0.0;
        }
        let k = ((all.len() - 1) as f64 * share).round() as usize;
        *all.select_nth_unstable_by(k, f64::total_cmp).1
    }
}

/// Finds the poses of two whole shapes, the best first; rivals are over [`SAME_POSE_DEG`] apart. `guesses` are extra first
/// guesses in view coordinates. The poses are good enough to tell basins and handedness apart; [`finish`] brings them to rest.
pub(crate) fn survey(
    source: &View,
    target: &View,
    guesses: &[Rigid],
    scale: bool,
    keep: usize,
) -> Vec<WholeFit> {
    let mut poses = guesses.to_vec();
    poses.extend(from_moments(&target.moments, &source.moments));
    if scale {
        // At the wrong size every basin of the search is wrong: a shape 20 % smaller fits inside the other upside down as well.
        for pose in &mut poses {
            *pose = sized(source, target, pose);
        }
    }
    let rough = Level {
        iterations: 12,
        from: 0.5,
        to: 0.15,
        count: 150,
        exact: false,
        cosine: 0.0,
        by_noise: false,
    };
    let poses = search(source, target, poses, rough, 8, scale);
    let fine = Level {
        iterations: 12,
        from: 0.25,
        to: 0.10,
        count: 500,
        exact: false,
        cosine: 0.3,
        by_noise: false,
    };
    let poses = search(source, target, poses, fine, keep.max(2), scale);
    let mut fits: Vec<WholeFit> = poses
        .into_par_iter()
        .map(|pose| settle(source, target, pose, SURVEY_SAMPLES, SURVEY_ITERATIONS, scale))
        .collect();
    rank(&mut fits);
    fits
}

/// Brings the surveyed winner to rest on the whole surface. Its nearest rival is measured there as well, and takes the lead if it
/// is better after all; the others stay as they are.
pub(crate) fn finish(source: &View, target: &View, fits: &mut Vec<WholeFit>, scale: bool) {
    let near = |fit: &WholeFit| settle(source, target, fit.pose, NEAR_SAMPLES, FINISH_ITERATIONS, scale);
    let finished = |fit: WholeFit| settle(source, target, fit.pose, FINISH_SAMPLES, FINISH_ITERATIONS, scale);
    let Some(first) = fits.first_mut() else {
        return;
    };
    *first = finished(near(first));
    let best_rms = first.rms;
    if let Some(rival) = fits.get_mut(1) {
        *rival = near(rival);
        rival.rms = Distances::new(source, target, &rival.pose, FINISH_SAMPLES).rms();
        rival.residual = rival.rms;
        if rival.rms < best_rms {
            *rival = finished(rival.clone());
        }
    }
    rank(fits);
    if let Some(robust) = robust_fits(source, target, fits, scale) {
        *fits = robust;
        return;
    }
    let Some(best) = fits.first_mut() else {
        return;
    };
    if let Some(close) = close_finish(source, target, best, scale) {
        *best = close;
    }
}

/// Beyond this a distance under a fit to the part that agrees says only that the place differs.
pub(crate) fn differs_beyond(residual: f64) -> f64 {
    ROBUST_WIDTH * residual
}

/// Whether whole shapes of this residual end with the narrow fit.
pub(crate) fn ends_close(source: &View, target: &View, rms: f64) -> bool {
    let noise = source.noise.max(target.noise);
    noise > 0.0 && rms <= noise.max(source.spacing)
}

/// The fit of raw clouds that differ by no more than their noise: points in pairs, along the mean of both normals, within a narrow
/// tolerance. De-noising rounds the two clouds' edges differently, and an untruncated fit follows that.
fn close_finish(source: &View, target: &View, fit: &WholeFit, scale: bool) -> Option<WholeFit> {
    if !ends_close(source, target, fit.rms) {
        return None;
    }
    let (pose, converged) = rest(source, target, fit.pose, scale);
    let rms = Distances::new(source, target, &pose, FINISH_SAMPLES).rms();
    Some(WholeFit {
        pose,
        rms,
        residual: rms,
        robust: false,
        other_kind: None,
        converged,
    })
}

/// A pose with the source brought to the target's size about its own centroid; whole shapes have comparable radii of gyration.
fn sized(source: &View, target: &View, pose: &Rigid) -> Rigid {
    let centre = source.moments.centroid;
    let linear = pose.linear * (target.gyration() / source.gyration());
    Rigid {
        linear,
        translation: pose.apply(centre) - linear * centre,
    }
}

fn search(
    source: &View,
    target: &View,
    poses: Vec<Rigid>,
    level: Level,
    keep: usize,
    scale: bool,
) -> Vec<Rigid> {
    let mut fits: Vec<WholeFit> = poses
        .into_par_iter()
        .map(|pose| {
            let pose = refine(source, target, pose, level, scale);
            let rms = table_rms(source, target, &pose, 300);
            WholeFit {
                pose,
                rms,
                residual: rms,
                robust: false,
                other_kind: None,
                converged: false,
            }
        })
        .collect();
    rank(&mut fits);
    fits.truncate(keep);
    fits.into_iter().map(|f| f.pose).collect()
}

/// Sorts by residual (stable, so equal poses keep the order of their guesses) and drops poses near a better one.
fn rank(fits: &mut Vec<WholeFit>) {
    fits.sort_by(|a, b| a.residual.total_cmp(&b.residual));
    let mut kept: Vec<WholeFit> = Vec::with_capacity(fits.len());
    for fit in fits.drain(..) {
        if kept
            .iter()
            .all(|k| k.pose.rotation_angle_deg(&fit.pose) > SAME_POSE_DEG)
        {
            kept.push(fit);
        }
    }
    *fits = kept;
}

/// Symmetric root mean square distance with nearest points from the tables; places outside a table count as its margin.
fn table_rms(source: &View, target: &View, pose: &Rigid, count: usize) -> f64 {
    let one = |moving: &View, fixed: &View, pose: &Rigid| {
        let n = count.min(moving.points.len());
        let sum: f64 = moving.points[..n]
            .iter()
            .map(|&p| {
                let q = pose.apply(p);
                fixed
                    .grid
                    .nearest(q)
                    .map_or(0.0625, |j| fixed.points[j].distance_squared(q))
            })
            .sum();
        sum / n as f64
    };
    // Both in the target's frame, as in [`Distances`].
    let scale = pose.linear.determinant().abs().cbrt();
    (0.5 * (one(source, target, pose) + one(target, source, &pose.inverse()) * scale * scale)).sqrt()
}

/// The untruncated exact fit from a near pose; the best pose on the way by symmetric distance.
fn settle(
    source: &View,
    target: &View,
    start: Rigid,
    samples: usize,
    iterations: usize,
    scale: bool,
) -> WholeFit {
    let spacing = source.spacing.min(target.spacing);
    let mut pose = start;
    let mut best = WholeFit {
        pose,
        rms: f64::INFINITY,
        residual: f64::INFINITY,
        robust: false,
        other_kind: None,
        converged: false,
    };
    let mut worse = 0;
    for _ in 0..iterations {
        let ExactRows { rows, rms, .. } = exact_rows(source, target, &pose, samples, None);
        if rms < best.rms {
            best.rms = rms;
            best.residual = rms;
            best.pose = pose;
            worse = 0;
        } else {
            worse += 1;
        }
        let Some(step) = rows.solve(scale, 0.0, 0.2) else {
            break;
        };
        // Two surfaces that fit exactly converge quadratically to rounding; others crawl, and a thousandth of the spacing is far
        // below what their samples resolve.
        if step.size < 1e-12 || worse > 4 {
            best.converged = true;
            break;
        }
        best.converged = step.size < 1e-3 * spacing;
        if rms > 0.02 * spacing && step.size < AT_REST * spacing {
            break;
        }
        pose = cleaned(step.motion.after(&pose), scale);
    }
    best
}

/// The exact system at a pose, with the size of its distances.
struct ExactRows {
    rows: NormalEquations,
    rms: f64,
    /// Distance below which [`UNCHANGED`] of the samples lie.
    close: f64,
}

/// Rows of exact nearest places in both directions, untruncated, or weighted by Geman and McClure's function of a width.
fn exact_rows(source: &View, target: &View, pose: &Rigid, samples: usize, width: Option<f64>) -> ExactRows {
    struct Row {
        place: glam::DVec3,
        offset: glam::DVec3,
        normal: glam::DVec3,
    }
    let inverse = pose.inverse();
    let turn = pose.linear * pose.linear.determinant().abs().cbrt().recip();
    let there: Vec<Row> = source.points[..samples.min(source.points.len())]
        .par_iter()
        .map(|&p| {
            let place = pose.apply(p);
            let touch = target.exact.touch(place);
            Row {
                place,
                offset: place - touch.place,
                normal: touch.normal,
            }
        })
        .collect();
    let back: Vec<Row> = target.points[..samples.min(target.points.len())]
        .par_iter()
        .map(|&x| {
            let touch = source.exact.touch(inverse.apply(x));
            let place = pose.apply(touch.place);
            Row {
                place,
                offset: place - x,
                normal: turn * touch.normal,
            }
        })
        .collect();
    let mut rows = NormalEquations::new(glam::DVec3::ZERO);
    let mut square = 0.0;
    for side in [&there, &back] {
        let share = 1.0 / side.len().max(1) as f64;
        for row in side {
            let d2 = row.offset.length_squared();
            square += 0.5 * share * d2;
            let weight = share * width.map_or(1.0, |w| (1.0 + d2 / (w * w)).powi(-2));
            // Away from the surface the distance grows along the offset; on it, along the normal.
            let direction = if d2 > 1e-12 {
                row.offset / d2.sqrt()
            } else {
                row.normal
            };
            let direction = if direction.dot(row.normal) < 0.0 {
                -direction
            } else {
                direction
            };
            rows.add(row.place, direction, row.offset.dot(direction), weight);
        }
    }
    let mut all: Vec<f64> = there.iter().chain(&back).map(|r| r.offset.length()).collect();
    let last = (all.len() as f64 * UNCHANGED) as usize;
    let close = *all.select_nth_unstable_by(last, f64::total_cmp).1;
    ExactRows {
        rows,
        rms: square.sqrt(),
        close,
    }
}

/// Fits to the part that agrees, best first; `None` when the plain fit of all agrees about as well. The best of `fits` is told where its
/// own robust fit ends.
fn robust_fits(source: &View, target: &View, fits: &mut [WholeFit], scale: bool) -> Option<Vec<WholeFit>> {
    let plain_pose = fits.first()?.pose;
    let plain = Distances::new(source, target, &plain_pose, NEAR_SAMPLES).quantile(UNCHANGED);
    // Shapes that agree to within their sampling or their noise have no part that agrees better.
    let noise = source.noise.max(target.noise);
    let indistinct = (0.02 * source.spacing.min(target.spacing)).max(0.5 * noise);
    if plain <= indistinct {
        return None;
    }
    let all: Vec<Option<WholeFit>> = fits
        .par_iter()
        .map(|fit| robust_fit(source, target, fit.pose, NEAR_SAMPLES, scale))
        .collect();
    fits[0].other_kind = all[0].as_ref().map(|fit| fit.pose);
    let mut found: Vec<WholeFit> = all.into_iter().flatten().collect();
    rank(&mut found);
    let same = SAME_SURFACE.max(0.5 * noise);
    found.retain(|fit| fit.residual < same.min(AGREES_BETTER * plain));
    let first = found.first_mut()?;
    if let Some(better) = robust_fit(source, target, first.pose, FINISH_SAMPLES, scale) {
        *first = better;
    }
    if first.residual > AGREES_CLEARLY * plain {
        first.other_kind = Some(plain_pose);
    }
    Some(found)
}

/// The fit from a pose that down-weights what does not agree.
fn robust_fit(source: &View, target: &View, start: Rigid, samples: usize, scale: bool) -> Option<WholeFit> {
    let close = |pose: &Rigid| Distances::new(source, target, pose, samples).quantile(UNCHANGED);
    let mut pose = start;
    let mut width = ROBUST_WIDTH * close(&pose);
    let mut converged = false;
    for _ in 0..ROBUST_ITERATIONS {
        let found = exact_rows(source, target, &pose, samples, Some(width));
        let step = found.rows.solve(scale, 0.0, 0.2)?;
        pose = cleaned(step.motion.after(&pose), scale);
        // Never wider than before, so that the fit settles.
        width = width.min(ROBUST_WIDTH * found.close).max(1e-6);
        converged = step.size < 1e-3 * source.spacing;
        let resting = found.close > 0.02 * source.spacing && step.size < AT_REST * source.spacing;
        if resting || step.size < 1e-10 {
            break;
        }
    }
    let distances = Distances::new(source, target, &pose, samples);
    Some(WholeFit {
        pose,
        rms: distances.rms(),
        residual: distances.quantile(UNCHANGED),
        robust: true,
        other_kind: None,
        converged,
    })
}
