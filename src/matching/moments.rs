//! Moments of points, and the first guesses of a pose that follow from them.
//!
//! In: the moments of both shapes. Out: poses that join the centroids, best guesses first.
//!
//! 1. The 24 proper ways to lay one triad of principal axes on the other: the four flips of the usual recipe, and the swaps
//!    for two persons' bones whose second and third axes change places.
//! 2. When two deviations are within 25 %, twelve spins of 30 degrees about the odd axis, each with its flip: for a disc such as the
//!    patella the axes in its plane mean nothing.
//! 3. When all three are, the sixty rotations of the icosahedron: nowhere farther than 44.5 degrees from any rotation.

use crate::geometry::Rigid;
use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

/// Deviations whose ratio is below this are taken as equal.
const NEARLY_EQUAL: f64 = 1.25;

/// First and second moments of points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moments {
    pub(crate) centroid: DVec3,
    /// Standard deviations along the axes, largest first.
    pub(crate) deviations: DVec3,
    /// Principal axes as columns, right-handed.
    pub(crate) axes: DMat3,
}

/// Mean, deviations and axes of equally weighted points.
pub(crate) fn moments(points: &[DVec3]) -> Moments {
    let n = points.len().max(1) as f64;
    let centroid = points.iter().copied().sum::<DVec3>() / n;
    let mut m = Matrix3::<f64>::zeros();
    for p in points {
        let d = *p - centroid;
        for r in 0..3 {
            for c in 0..3 {
                m[(r, c)] += d[r] * d[c] / n;
            }
        }
    }
    let eigen = m.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axis = |k: usize| {
        let v = eigen.eigenvectors.column(order[k]);
        DVec3::new(v[0], v[1], v[2])
    };
    let deviation = |k: usize| eigen.eigenvalues[order[k]].max(0.0).sqrt();
    let (x, y) = (axis(0), axis(1));
    Moments {
        centroid,
        deviations: DVec3::new(deviation(0), deviation(1), deviation(2)),
        axes: DMat3::from_cols(x, y, x.cross(y)),
    }
}

/// Poses that bring the moments of `source` onto those of `target`.
pub(crate) fn from_moments(target: &Moments, source: &Moments) -> Vec<Rigid> {
    let mut turns: Vec<DMat3> = cube_group()
        .into_iter()
        .map(|g| target.axes * g * source.axes.transpose())
        .collect();
    let close = |m: &Moments, a: usize, b: usize| m.deviations[a] < NEARLY_EQUAL * m.deviations[b];
    let both = |a, b| close(target, a, b) || close(source, a, b);
    let (long, short) = (both(0, 1), both(1, 2));
    if long && short {
        turns.extend(
            icosahedral_group()
                .into_iter()
                .map(|g| target.axes * g * source.axes.transpose()),
        );
    }
    if long || short {
        let odd = if long { DVec3::Z } else { DVec3::X };
        let flip = if long { DVec3::X } else { DVec3::Z };
        for k in 1..12 {
            let spin = DMat3::from_axis_angle(odd, f64::from(k) * std::f64::consts::PI / 6.0);
            for f in [
                DMat3::IDENTITY,
                DMat3::from_axis_angle(flip, std::f64::consts::PI),
            ] {
                turns.push(target.axes * spin * f * source.axes.transpose());
            }
        }
    }
    turns
        .into_iter()
        .map(|linear| Rigid {
            linear,
            translation: target.centroid - linear * source.centroid,
        })
        .collect()
}

/// The 24 rotations that take the coordinate axes to coordinate axes; the four diagonal ones (flips) come first.
fn cube_group() -> Vec<DMat3> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut out = Vec::with_capacity(24);
    for (a, b) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
        for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let (x, y) = (axes[a] * s, axes[b] * t);
            out.push(DMat3::from_cols(x, y, x.cross(y)));
        }
    }
    out
}

/// The 60 rotations of the icosahedron, as products of its generators.
fn icosahedral_group() -> Vec<DMat3> {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let generators = [
        DMat3::from_axis_angle(
            DVec3::new(0.0, 1.0, golden).normalize(),
            std::f64::consts::TAU / 5.0,
        ),
        DMat3::from_axis_angle(DVec3::new(1.0, 1.0, 1.0).normalize(), std::f64::consts::TAU / 3.0),
    ];
    let mut group = vec![DMat3::IDENTITY];
    let mut next = 0;
    while next < group.len() && group.len() < 60 {
        for g in generators {
            let product = g * group[next];
            if group.iter().all(|m| !m.abs_diff_eq(product, 1e-9)) {
                group.push(product);
            }
        }
        next += 1;
    }
    group
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_have_their_sizes_and_hold_rotations() {
        for (group, size) in [(cube_group(), 24), (icosahedral_group(), 60)] {
            assert_eq!(group.len(), size);
            for (i, m) in group.iter().enumerate() {
                assert!((m.determinant() - 1.0).abs() < 1e-9);
                assert!(group[..i].iter().all(|o| !o.abs_diff_eq(*m, 1e-6)));
            }
        }
    }
}
