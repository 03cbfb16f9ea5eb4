//! Corners of ribs: a rib that turns sharply is cut there, and a node stands in the corner.
//!
//! In: the network. Out: the fine vertices where ribs are cut, and after the ribs have been fitted the place of each corner.
//!
//! Where three faces of a surface meet in a convex corner, two edges of it do, and the rib that follows them turns from the one into the
//! other at a point. A smooth border may turn as far, but it takes its way. So around each point of a rib two models with as many
//! parameters are compared, both by least squares over a window of several tolerances: two straight pieces that meet in the point, and a
//! parabola, after the rib was laid into the plane it lies in best. A place that may be a corner is where the pieces meet at [`ANGLE`] to [`HAIRPIN`]
//! and leave at most [`SHARE`] of the square residual that the parabola leaves. A circle, an ellipse or a wavy border has hardly such a place.
//! Arc lengths are those of a smoother rib: one that grew back now on this and now on that side of a blunt edge zigzags to twice its length.
//!
//! How significant a corner is, is its angle times the length of its arms, against what the rib is off the pieces. The parabola's residual grows
//! with the one, the pieces' is the other, so that the share says it, and it falls as the arms get longer where there is a corner,
//! while it rises where a border merely bends. So a corner is one only if the share falls to [`CLEAR`] in that window or in one
//! [`WIDER`] times as wide, and the angle is the same in both: that of a bend, the end of an ellipse say, grows with the window. Of corners within half a window the sharpest counts.
//!
//! Measured: the corners of hexagonal plates, slabs and L-blocks leave 0.04 to 0.15 in the window and 0.02 to 0.08 in the wider one. On 16 tarsals with
//! two seeds the least in either is 0.18 (a patella 0.20, at the same place with the other seed 0.23; a talus 0.18 with one seed, nothing below 0.27
//! with the other): what is there depends on the sampling, and is no corner.
//!
//! The fit of ribs looks at a neighbourhood and rounds corners, so a corner is put where the straight pieces on both
//! sides, seen from outside that neighbourhood, come nearest to each other, and the rounded ends are drawn straight to it. Cost:
//! `O(rib points x points in a window)`.

use super::attributes::smooth;
use super::hypergraph::{CurveKind, MedialPoint};
use super::network::{Chain, Network};
use glam::DVec3;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::f64::consts::PI;

/// What counts as near a corner, in tolerances and in spacings, whichever is more: the scale of everything here.
const NEAR: [f64; 2] = [5.0, 8.0];
/// Half the window over which models are compared, in those.
const WINDOW: f64 = 2.5;
/// Least angle between the pieces: the outline of a hexagon turns by a third of pi.
const ANGLE: f64 = 0.22 * PI;
/// Largest angle: a rib that turns back goes round the tip of a strip.
const HAIRPIN: f64 = 0.8 * PI;
/// Largest share of the parabola's square residual for a place to be looked at.
const SHARE: f64 = 0.27;
/// Largest share at a corner, in the window or in a wider one: between 0.08 and 0.18, see the module.
const CLEAR: f64 = 0.12;
/// Largest difference of the angles in both windows: that of a bend grows with the window.
const STEADY: f64 = 0.05 * PI;
/// The wider window in windows.
const WIDER: f64 = 1.6;
/// Width that positions are smoothed with, and twice that for arc lengths, in what counts as near.
const LIGHT: f64 = 0.2;
const HEAVY: f64 = 0.3;
/// What a rib is off its line anyway, in spacings: below it models are not told apart.
const NOISE: f64 = 0.1;
/// Ends of fitted ribs nearer to a corner than this share of the window are rounded.
const ROUNDED: f64 = 0.5;
/// A corner may lie this many windows from where the fitted ribs end.
const FURTHEST: f64 = 0.6;

/// Marks the corners of ribs in the network.
pub(crate) fn cut_at_corners(network: &mut Network) {
    let mut found = Vec::new();
    for chain in network.chains().iter().filter(|c| c.kind == CurveKind::Rib) {
        found.extend(corners_of(network, chain));
    }
    for v in found {
        network.corner[v as usize] = true;
    }
}

/// What counts as near a corner on a chain, mm.
fn near(network: &Network, vertices: &[u32]) -> f64 {
    let tau = network.regularised.tolerance_over(vertices);
    (NEAR[0] * tau).max(NEAR[1] * network.fine.scale.spacing_mm)
}

/// A rib as a line with arc lengths.
struct Arc {
    points: Vec<DVec3>,
    at: Vec<f64>,
    closed: bool,
    /// Length all round, or from end to end.
    whole: f64,
}

fn corners_of(network: &Network, chain: &Chain) -> Vec<u32> {
    let fine = network.fine;
    let closed = !network.is_node(chain.vertices[0]);
    let vertices = &chain.vertices[..chain.vertices.len() - usize::from(closed)];
    let mut line: Vec<MedialPoint> = vertices
        .iter()
        .map(|&v| MedialPoint {
            position: fine.vertex_position[v as usize],
            radius: fine.vertex_radius[v as usize],
        })
        .collect();
    let half = near(network, vertices);
    let mut smoother = line.clone();
    smooth(&mut smoother, closed, HEAVY * half);
    smooth(&mut smoother, closed, HEAVY * half);
    smooth(&mut line, closed, LIGHT * half);
    let positions = |line: &[MedialPoint]| line.iter().map(|p| p.position).collect::<Vec<_>>();
    let arc = Arc::new(positions(&line), &positions(&smoother), closed);
    if closed && arc.whole < 4.0 * WINDOW * half {
        return Vec::new();
    }
    let noise = (NOISE * fine.scale.spacing_mm).powi(2);
    let mut candidates: Vec<(f64, usize)> = (0..vertices.len())
        .filter_map(|i| Some((arc.sharpness(i, half, noise)?, i)))
        .collect();
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut kept: Vec<usize> = Vec::new();
    for (_, i) in candidates {
        if kept.iter().all(|&k| arc.way(i, k) >= half) {
            kept.push(i);
        }
    }
    kept.into_iter().map(|i| vertices[i]).collect()
}

impl Arc {
    /// Points, at the arc lengths of the points of a smoother line.
    fn new(points: Vec<DVec3>, smoother: &[DVec3], closed: bool) -> Self {
        let mut at = vec![0.0; smoother.len()];
        for i in 1..smoother.len() {
            at[i] = at[i - 1] + smoother[i].distance(smoother[i - 1]);
        }
        let mut whole = at.last().copied().unwrap_or(0.0);
        if let (true, [first, .., last]) = (closed, smoother) {
            whole += first.distance(*last);
        }
        Self {
            points,
            at,
            closed,
            whole,
        }
    }

    /// Way along the rib between two of its points.
    fn way(&self, i: usize, j: usize) -> f64 {
        let way = (self.at[i] - self.at[j]).abs();
        if self.closed {
            way.min(self.whole - way)
        } else {
            way
        }
    }

    /// How sharp a corner there is at a point, the smaller the sharper; `None` where there is none.
    fn sharpness(&self, i: usize, half: f64, noise: f64) -> Option<f64> {
        let room = if self.closed {
            f64::INFINITY
        } else {
            self.at[i].min(self.whole - self.at[i])
        };
        if room < half {
            return None;
        }
        let window = WINDOW * half;
        let (angle, share) = self.compare(i, window.min(room), noise)?;
        if !(ANGLE..=HAIRPIN).contains(&angle) || share > SHARE {
            return None;
        }
        let (wide_angle, wider) = self.compare(i, (WIDER * window).min(room), noise)?;
        let steady = (wide_angle - angle).abs() <= STEADY;
        (steady && share.min(wider) <= CLEAR).then_some(share)
    }

    /// Angle between two straight pieces that meet in a point, and the share of a parabola's square residual that they leave.
    fn compare(&self, i: usize, half: f64, noise: f64) -> Option<(f64, f64)> {
        let mut samples: Vec<(f64, f64, DVec3)> = Vec::new();
        let n = self.points.len() as isize;
        let mut add = |k: isize| -> bool {
            if !self.closed && !(0..n).contains(&k) {
                return false;
            }
            let place = |k: isize| {
                let turns = k.div_euclid(n) as f64;
                self.at[k.rem_euclid(n) as usize] + if self.closed { turns * self.whole } else { 0.0 }
            };
            let t = (place(k) - self.at[i]) / half;
            if t.abs() > 1.0 {
                return false;
            }
            let step = |a: isize, b: isize| {
                if self.closed || (0..n).contains(&a) && (0..n).contains(&b) {
                    place(b) - place(a)
                } else {
                    0.0
                }
            };
            // Each point stands for half the way to its neighbours.
            let weight = 0.5 * (step(k - 1, k) + step(k, k + 1)) / half;
            samples.push((t, weight, self.points[k.rem_euclid(n) as usize] - self.points[i]));
            true
        };
        let here = i as isize;
        let (mut up, mut down) = (here, here - 1);
        while add(up) && up - here < n {
            up += 1;
        }
        while add(down) && here - down < n {
            down -= 1;
        }
        if samples.len() < 8 {
            return None;
        }
        flatten(&mut samples);
        let (pieces, left) = least_squares(&samples, |t| Vector3::new(1.0, t.min(0.0), t.max(0.0)))?;
        let (_, left_by_parabola) = least_squares(&samples, |t| Vector3::new(1.0, t, t * t))?;
        let (before, after) = (pieces[1], pieces[2]);
        Some((
            before.angle_between(after),
            (left + noise) / (left_by_parabola + noise),
        ))
    }
}

/// Takes away what samples are off the plane they lie in best: a rib wavers across its sheet more than along it, and turns along it.
fn flatten(samples: &mut [(f64, f64, DVec3)]) {
    let sum: f64 = samples.iter().map(|s| s.1).sum();
    let centre: DVec3 = samples.iter().map(|s| s.1 * s.2).sum::<DVec3>() / sum;
    let mut spread = Matrix3::<f64>::zeros();
    for s in samples.iter() {
        let d: Vector3<f64> = (s.2 - centre).into();
        spread += d * d.transpose() * s.1;
    }
    let eigen = SymmetricEigen::new(spread);
    let least = (0..3).min_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let across = eigen.eigenvectors.column(least.unwrap_or(0));
    let across = DVec3::new(across[0], across[1], across[2]);
    for s in samples {
        s.2 -= (s.2 - centre).dot(across) * across;
    }
}

/// Coefficients of three functions of the arc length, and the mean square residual.
fn least_squares(
    samples: &[(f64, f64, DVec3)],
    basis: impl Fn(f64) -> Vector3<f64>,
) -> Option<([DVec3; 3], f64)> {
    let mut normal = Matrix3::<f64>::zeros();
    let mut right = Matrix3::<f64>::zeros();
    let (mut square, mut sum) = (0.0, 0.0);
    for &(t, w, p) in samples {
        let row = basis(t);
        let p: Vector3<f64> = p.into();
        normal += row * row.transpose() * w;
        right += row * p.transpose() * w;
        square += w * p.norm_squared();
        sum += w;
    }
    let solution = normal.cholesky()?.solve(&right);
    let left = (square - solution.component_mul(&right).sum()).max(0.0) / sum;
    let row = |k: usize| DVec3::new(solution[(k, 0)], solution[(k, 1)], solution[(k, 2)]);
    Some(([row(0), row(1), row(2)], left))
}

/// Puts corners where the straight pieces of the two fitted ribs that end there come nearest to each other, and draws their rounded ends
/// straight to them. `ends[i]` are the nodes at which chain `i` starts and ends, `is_corner` tells nodes that are corners.
pub(crate) fn straighten(
    network: &Network,
    chains: &[Chain],
    ends: &[Option<[usize; 2]>],
    is_corner: &[bool],
    lines: &mut [Vec<MedialPoint>],
    points: &mut [MedialPoint],
) {
    let mut pieces: Vec<Vec<(usize, bool)>> = vec![Vec::new(); points.len()];
    for (i, ends) in ends.iter().enumerate() {
        let Some(ends) = ends.filter(|_| chains[i].kind == CurveKind::Rib) else {
            continue;
        };
        for (node, from_start) in ends.into_iter().zip([true, false]) {
            if is_corner[node] {
                pieces[node].push((i, from_start));
            }
        }
    }
    for (node, pieces) in pieces.into_iter().enumerate() {
        let [(a, a_start), (b, b_start)] = pieces[..] else {
            continue;
        };
        let half = near(network, &chains[a].vertices);
        let tail = |chain: usize, from_start: bool| Tail::new(&lines[chain], from_start, half);
        let (Some(first), Some(second)) = (tail(a, a_start), tail(b, b_start)) else {
            continue;
        };
        let Some(corner) = first
            .meets(&second)
            .filter(|c| c.position.distance(points[node].position) <= FURTHEST * half)
        else {
            continue;
        };
        points[node] = corner;
        for (chain, from_start) in [(a, a_start), (b, b_start)] {
            draw_straight(&mut lines[chain], from_start, ROUNDED * half, corner);
        }
    }
}

/// The straight piece of a rib near one of its ends: position and radius along it.
struct Tail {
    middle: MedialPoint,
    direction: DVec3,
    slope: f64,
}

impl Tail {
    fn new(line: &[MedialPoint], from_start: bool, half: f64) -> Option<Self> {
        let mut way = 0.0;
        let mut samples: Vec<(f64, f64, DVec3)> = Vec::new();
        let mut radii = Vec::new();
        let mut last: Option<DVec3> = None;
        for k in 0..line.len() {
            let p = line[if from_start { k } else { line.len() - 1 - k }];
            let step = last.map_or(0.0, |l| l.distance(p.position));
            way += step;
            last = Some(p.position);
            if way > half {
                break;
            }
            if way >= ROUNDED * half {
                samples.push((way / half, step, p.position));
                radii.push(p.radius);
            }
        }
        let sum: f64 = samples.iter().map(|s| s.1).sum();
        if samples.len() < 4 || sum <= 0.0 {
            return None;
        }
        let mean = |value: &dyn Fn(usize) -> f64| {
            (0..samples.len()).map(|k| samples[k].1 * value(k)).sum::<f64>() / sum
        };
        let t = mean(&|k| samples[k].0);
        let radius = mean(&|k| radii[k]);
        let spread = mean(&|k| (samples[k].0 - t).powi(2));
        let position: DVec3 = samples.iter().map(|s| s.1 * s.2).sum::<DVec3>() / sum;
        let run: DVec3 = samples.iter().map(|s| s.1 * (s.0 - t) * s.2).sum::<DVec3>() / sum;
        let length = run.length();
        if length <= 0.0 || spread <= 0.0 {
            return None;
        }
        Some(Self {
            middle: MedialPoint { position, radius },
            direction: run / length,
            slope: mean(&|k| (samples[k].0 - t) * radii[k]) / length,
        })
    }

    /// The point halfway between two straight pieces where they are nearest to each other; none when they run side by side.
    fn meets(&self, other: &Self) -> Option<MedialPoint> {
        let (u, v) = (self.direction, other.direction);
        let between = other.middle.position - self.middle.position;
        let cos = u.dot(v);
        let sin2 = 1.0 - cos * cos;
        if sin2 < 0.1 {
            return None;
        }
        let s = (between.dot(u) - cos * between.dot(v)) / sin2;
        let t = (cos * between.dot(u) - between.dot(v)) / sin2;
        let (p, q) = (self.middle.position + s * u, other.middle.position + t * v);
        let radius = 0.5 * (self.middle.radius + s * self.slope + other.middle.radius + t * other.slope);
        Some(MedialPoint {
            position: 0.5 * (p + q),
            radius: radius.max(0.0),
        })
    }
}

/// Draws the points within a length of an end on the straight way from the corner to the first point beyond.
pub(crate) fn draw_straight(line: &mut [MedialPoint], from_start: bool, length: f64, corner: MedialPoint) {
    if !from_start {
        line.reverse();
    }
    let mut way = vec![0.0; line.len()];
    for k in 1..line.len() {
        way[k] = way[k - 1] + line[k].position.distance(line[k - 1].position);
    }
    if let Some(good) = way.iter().position(|&w| w >= length) {
        let to = line[good];
        for k in 0..good {
            let share = way[k] / way[good];
            line[k] = MedialPoint {
                position: corner.position.lerp(to.position, share),
                radius: corner.radius + share * (to.radius - corner.radius),
            };
        }
    }
    if !from_start {
        line.reverse();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners that a closed outline has, with noise of a share of its step.
    fn corners(outline: impl Fn(f64) -> DVec3, noise: f64) -> Vec<f64> {
        let n = 400;
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1u64 << 31) as f64 - 0.5
        };
        let step = outline(0.0).distance(outline(1.0 / n as f64));
        let points: Vec<DVec3> = (0..n)
            .map(|i| {
                let off = DVec3::new(random(), random(), random());
                outline(i as f64 / n as f64) + noise * step * off
            })
            .collect();
        let arc = Arc::new(points.clone(), &points, true);
        let half = 12.0 * step;
        let mut found: Vec<(f64, usize)> = (0..n)
            .filter_map(|i| Some((arc.sharpness(i, half, (0.1 * step).powi(2))?, i)))
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut kept: Vec<usize> = Vec::new();
        for (_, i) in found {
            if kept.iter().all(|&k| arc.way(i, k) >= half) {
                kept.push(i);
            }
        }
        kept.sort_unstable();
        kept.into_iter().map(|i| i as f64 / n as f64).collect()
    }

    fn polygon(sides: usize) -> impl Fn(f64) -> DVec3 {
        move |t| {
            let x = t.rem_euclid(1.0) * sides as f64;
            let corner = |k: f64| {
                let (s, c) = (std::f64::consts::TAU * k / sides as f64).sin_cos();
                DVec3::new(c, s, 0.0)
            };
            corner(x.floor()).lerp(corner(x.floor() + 1.0), x.fract())
        }
    }

    #[test]
    fn polygons_are_cut_at_their_corners() {
        for sides in [3, 4, 5, 6] {
            for noise in [0.0, 0.5, 1.0] {
                let found = corners(polygon(sides), noise);
                assert_eq!(found.len(), sides, "{sides} {noise}: {found:?}");
                for (k, at) in found.iter().enumerate() {
                    let off = (at - k as f64 / sides as f64).abs();
                    assert!(off.min(1.0 - off) <= 0.0076, "{found:?}");
                }
            }
        }
    }

    #[test]
    fn bends_and_tips_of_strips_are_not_cut() {
        for noise in [0.0, 0.5, 1.0] {
            // A square with corners as round as half a side, and a strip with ends that are half circles.
            for round in [
                |c: f64, s: f64| DVec3::new(c.cbrt(), s.cbrt(), 0.0),
                |c: f64, s: f64| DVec3::new(c + 6.0 * (4.0 * c).clamp(-1.0, 1.0), s, 0.0),
            ] {
                let outline = |t: f64| {
                    let (s, c) = (std::f64::consts::TAU * t).sin_cos();
                    round(c, s)
                };
                assert_eq!(corners(outline, noise), [0.0; 0], "{noise}");
            }
        }
    }

    #[test]
    fn smooth_outlines_are_not_cut() {
        for noise in [0.0, 0.5, 1.0] {
            for ratio in [1.0, 0.6, 0.3, 0.15] {
                let ellipse = |t: f64| {
                    let (s, c) = (std::f64::consts::TAU * t).sin_cos();
                    DVec3::new(c, ratio * s, 0.1 * c * s)
                };
                assert_eq!(corners(ellipse, noise), [0.0; 0], "{ratio} {noise}");
            }
            for lobes in [3.0, 5.0] {
                let wavy = |t: f64| {
                    let a = std::f64::consts::TAU * t;
                    let r = 1.0 + 0.15 * (lobes * a).cos();
                    DVec3::new(r * a.cos(), r * a.sin(), 0.0)
                };
                assert_eq!(corners(wavy, noise), [0.0; 0], "{lobes} {noise}");
            }
        }
    }
}
