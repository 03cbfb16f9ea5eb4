//! Poses from oriented point pairs.
//!
//! In: two views. Out: as many candidate poses as asked for.
//!
//! 1. Of each view an evenly spread subset without border points: 300 of the source, 800 of the target (farthest point
//!    sampling).
//! 2. The feature of an ordered pair (Drost et al. 2010, with the signed dihedral angle in place of the angle between the
//!    normals, so that mirror images differ): length, the angles of both normals to the line, the dihedral angle between the
//!    normals about it. Pairs whose normals lie within 20 degrees of the line are skipped: their dihedral angle is noise.
//! 3. Target pairs go into a table of bins (3 % of the diagonal, 15 degrees).
//! 4. A random source pair looks into the sixteen nearest bins, takes pairs within half a bin in every feature, and each of
//!    them gives one pose: both lines and, evenly, both normals are laid on each other.
//!
//! Cost: `O(800^2)` for the table, then `O(1)` a pose.

use super::oriented::View;
use crate::geometry::Rigid;
use glam::{DMat3, DVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::PI;

const SOURCE_SUBSET: usize = 300;
const TARGET_SUBSET: usize = 800;
/// Lengths of the pairs, in units.
const SHORTEST: f64 = 0.2;
const LONGEST: f64 = 0.6;
/// Least sine of the angle of a normal to the line.
const LEAST_SINE: f64 = 0.35;
const LENGTH_BIN: f64 = 0.03;
const ANGLE_BIN: f64 = PI / 12.0;
const BINS: [usize; 4] = [14, 12, 12, 24];
/// Most poses one source pair may give.
const MOST_A_PAIR: usize = 400;

/// Feature of an ordered pair, in bins.
type Feature = [f32; 4];

struct Pair {
    first: u32,
    second: u32,
    feature: Feature,
}

/// Target pairs by feature.
pub(crate) struct PairTable {
    starts: Vec<u32>,
    pairs: Vec<Pair>,
    source_subset: Vec<u32>,
}

impl PairTable {
    /// Fills the table with the pairs of `target` and picks the points of `source` to draw from.
    pub(crate) fn new(source: &View, target: &View) -> Self {
        let subset = spread(target, TARGET_SUBSET);
        let rows: Vec<Vec<Pair>> = subset
            .par_iter()
            .map(|&i| {
                let pair = |&j: &u32| {
                    let feature = feature(target, i, j)?;
                    Some(Pair {
                        first: i,
                        second: j,
                        feature,
                    })
                };
                subset.iter().filter(|&&j| j != i).filter_map(pair).collect()
            })
            .collect();
        let count = BINS.iter().product::<usize>();
        let mut starts = vec![0u32; count + 1];
        for p in rows.iter().flatten() {
            starts[slot(&p.feature) + 1] += 1;
        }
        for k in 0..count {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        let mut order: Vec<Option<Pair>> = Vec::new();
        order.resize_with(starts[count] as usize, || None);
        for p in rows.into_iter().flatten() {
            let k = slot(&p.feature);
            order[next[k] as usize] = Some(p);
            next[k] += 1;
        }
        let pairs = order.into_iter().flatten().collect();
        Self {
            starts,
            pairs,
            source_subset: spread(source, SOURCE_SUBSET),
        }
    }

    /// Draws source pairs until `count` poses are found (fewer when the shapes share hardly any pair).
    pub(crate) fn poses(
        &self,
        source: &View,
        target: &View,
        count: usize,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Rigid> {
        let n = self.source_subset.len();
        let mut out = Vec::with_capacity(count);
        if n < 2 || self.pairs.is_empty() {
            return out;
        }
        // Far more draws than any real pair of shapes needs; it only ends a hopeless search.
        for _ in 0..count.saturating_mul(4).max(100_000) {
            if out.len() >= count {
                break;
            }
            let i = self.source_subset[rng.random_range(0..n)];
            let j = self.source_subset[rng.random_range(0..n)];
            if i == j {
                continue;
            }
            let Some(wanted) = feature(source, i, j) else {
                continue;
            };
            let mut found = self.similar(&wanted);
            let take = found.len().min(MOST_A_PAIR).min(count - out.len());
            for k in 0..take {
                let pick = rng.random_range(k..found.len());
                found.swap(k, pick);
            }
            let from = frame(source, i, j);
            out.extend(found[..take].iter().map(|&p| {
                let pair = &self.pairs[p as usize];
                let to = frame(target, pair.first, pair.second);
                let linear = to.linear * from.linear.transpose();
                Rigid {
                    linear,
                    translation: to.translation - linear * from.translation,
                }
            }));
        }
        out
    }

    /// Table pairs within half a bin in all four features.
    fn similar(&self, wanted: &Feature) -> Vec<u32> {
        let mut out = Vec::new();
        for corner in 0..16usize {
            let mut bin = [0usize; 4];
            let mut inside = true;
            for k in 0..4 {
                let low = (wanted[k] - 0.5).floor() as i64 + ((corner >> k) & 1) as i64;
                let bins = BINS[k] as i64;
                // The dihedral angle is periodic, the others end.
                let low = if k == 3 { low.rem_euclid(bins) } else { low };
                inside &= (0..bins).contains(&low);
                bin[k] = low.max(0) as usize;
            }
            if !inside {
                continue;
            }
            let slot = index(bin);
            for p in self.starts[slot]..self.starts[slot + 1] {
                let f = &self.pairs[p as usize].feature;
                let turn = (f[3] - wanted[3]).abs();
                let near =
                    (0..3).all(|k| (f[k] - wanted[k]).abs() <= 0.5) && turn.min(BINS[3] as f32 - turn) <= 0.5;
                if near {
                    out.push(p);
                }
            }
        }
        out
    }
}

fn index(bin: [usize; 4]) -> usize {
    ((bin[0] * BINS[1] + bin[1]) * BINS[2] + bin[2]) * BINS[3] + bin[3]
}

fn slot(f: &Feature) -> usize {
    let mut bin = [0; 4];
    for k in 0..4 {
        bin[k] = (f[k].max(0.0) as usize).min(BINS[k] - 1);
    }
    index(bin)
}

/// Feature of the ordered pair in bins, or `None` when it is too short, too long or too steep.
fn feature(view: &View, i: u32, j: u32) -> Option<Feature> {
    let (i, j) = (i as usize, j as usize);
    let offset = view.points[j] - view.points[i];
    let length2 = offset.length_squared();
    if !(SHORTEST * SHORTEST..LONGEST * LONGEST).contains(&length2) {
        return None;
    }
    let length = length2.sqrt();
    let d = offset / length;
    let (n, m) = (view.normals[i], view.normals[j]);
    let (cn, cm) = (n.dot(d), m.dot(d));
    let steepest = 1.0 - LEAST_SINE * LEAST_SINE;
    if cn * cn > steepest || cm * cm > steepest {
        return None;
    }
    Some([
        ((length - SHORTEST) / LENGTH_BIN) as f32,
        (cn.acos() / ANGLE_BIN) as f32,
        (cm.acos() / ANGLE_BIN) as f32,
        ((dihedral(n, m, d) + PI) / ANGLE_BIN) as f32,
    ])
}

/// Signed angle from `n` to `m` about `d`, rad.
fn dihedral(n: DVec3, m: DVec3, d: DVec3) -> f64 {
    let a = n - d * n.dot(d);
    let b = m - d * m.dot(d);
    a.cross(b).dot(d).atan2(a.dot(b))
}

/// Frame of a pair: x along the line, z half way between the normals about it, origin half way.
fn frame(view: &View, i: u32, j: u32) -> Rigid {
    let (i, j) = (i as usize, j as usize);
    let (p, q) = (view.points[i], view.points[j]);
    let x = (q - p).normalize();
    let (n, m) = (view.normals[i], view.normals[j]);
    let half = DMat3::from_axis_angle(x, 0.5 * dihedral(n, m, x));
    let z = half * (n - x * n.dot(x)).normalize();
    Rigid {
        linear: DMat3::from_cols(x, z.cross(x), z),
        translation: 0.5 * (p + q),
    }
}

/// Evenly spread points away from the border, by farthest point sampling.
fn spread(view: &View, count: usize) -> Vec<u32> {
    let inner: Vec<u32> = (0..view.points.len() as u32)
        .filter(|&i| !view.border[i as usize])
        .collect();
    let mut distance = vec![f64::INFINITY; inner.len()];
    let mut out = Vec::with_capacity(count.min(inner.len()));
    let mut next = 0;
    while out.len() < count.min(inner.len()) {
        out.push(inner[next]);
        let p = view.points[inner[next] as usize];
        distance[next] = -1.0;
        let mut far = (-1.0, next);
        for (k, d) in distance.iter_mut().enumerate() {
            let near = view.points[inner[k] as usize].distance_squared(p);
            if near < *d {
                *d = near;
            }
            if *d > far.0 {
                far = (*d, k);
            }
        }
        next = far.1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dihedral_angle_is_signed() {
        assert!((dihedral(DVec3::Y, DVec3::Z, DVec3::X) - PI / 2.0).abs() < 1e-12);
        assert!((dihedral(DVec3::Z, DVec3::Y, DVec3::X) + PI / 2.0).abs() < 1e-12);
    }

    #[test]
    fn bins_are_numbered_once() {
        assert_eq!(
            slot(&[13.9, 11.9, 11.9, 23.9]),
            BINS.iter().product::<usize>() - 1
        );
        assert_eq!(slot(&[0.0; 4]), 0);
    }
}
