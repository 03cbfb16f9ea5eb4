//! Exact predicates: the sign of every result is the sign of the exact polynomial in the given `f64` coordinates.
//!
//! In: points. Out: an `f64` of which only the sign counts. Each predicate tries plain arithmetic under a forward error
//! bound first and goes on to Shewchuk's expansions when that cannot decide (Shewchuk 1997; crate `robust`).
//! The crate's own signs are turned once, here, so that the whole library shares one convention:
//!
//! * [`orient3d`]`(a, b, c, d) > 0` when `(b - a) x (c - a) . (d - a) > 0`: the tetrahedron is positively oriented, `d` lies
//!   on the side from which `a, b, c` run counter-clockwise.
//! * [`insphere`]`(a, b, c, d, p) > 0` when `p` lies strictly inside the sphere of a positively oriented tetrahedron.
//! * [`insphere_perturbed`] never answers zero: cospherical ties are broken by an infinitesimal change of the lifted points
//!   in the lexicographic order of their coordinates (Devillers & Teillaud 2011, "Perturbations for Delaunay and weighted
//!   Delaunay 3D triangulations"), so the answer depends on coordinates alone.
//! * [`tri_gabriel`] and [`edge_gabriel`] are positive when the point lies strictly outside the smallest ball through the
//!   triangle or edge, negative inside, zero on it; [`tri_gabriel_perturbed`] and [`edge_gabriel_perturbed`] break that tie
//!   by the same change of the lifted points, so that the flow they decide is that of one generic (weighted) point set.
//!
//! Exact while no product over- or underflows: coordinates of magnitude `2^-178` to `2^168` with differences that are
//! multiples of `2^-178` are safe; [`crate::delaunay::door::Frame`] brings any cloud there by a power of two.

use super::expansion::{Vector, two_sum};
use glam::DVec3;
use robust::Coord3D;
use std::cmp::Ordering;

/// Half a unit in the last place of 1: the relative error of one rounded operation.
pub(crate) const EPSILON: f64 = f64::EPSILON / 2.0;

/// Results below this may have lost bits to underflow; it is far above `2^-1022 / EPSILON` times the number of terms.
pub(crate) const UNDERFLOW: f64 = 1e-280;

#[inline]
fn coord(p: DVec3) -> Coord3D<f64> {
    Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    }
}

/// Sign of `(b - a) x (c - a) . (d - a)`: positive when the tetrahedron `a, b, c, d` is positively oriented.
///
/// ```
/// # use glam::DVec3;
/// # use medial_scaffold::geometry::predicates::orient3d;
/// assert!(orient3d(DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z) > 0.0);
/// ```
#[inline]
pub fn orient3d(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    -robust::orient3d(coord(a), coord(b), coord(c), coord(d))
}

/// Positive when `p` lies strictly inside the sphere through the positively oriented tetrahedron `a, b, c, d`, negative
/// outside, zero on it. The sign turns with the orientation of the tetrahedron.
#[inline]
pub fn insphere(a: DVec3, b: DVec3, c: DVec3, d: DVec3, p: DVec3) -> f64 {
    -robust::insphere(coord(a), coord(b), coord(c), coord(d), coord(p))
}

/// Order of two points by x, then y, then z. Finite coordinates; `-0.0` equals `0.0`.
#[inline]
pub fn lexicographic(a: DVec3, b: DVec3) -> Ordering {
    let by = |x: f64, y: f64| {
        if x < y {
            Ordering::Less
        } else if x > y {
            Ordering::Greater
        } else {
            Ordering::Equal
        }
    };
    by(a.x, b.x).then_with(|| by(a.y, b.y)).then_with(|| by(a.z, b.z))
}

/// [`insphere`] of a positively oriented tetrahedron with ties broken by the coordinates: never zero for five distinct
/// points.
///
/// The lifted points are raised by infinitesimals, the lexicographically largest by the greatest; the sign is that of the
/// first non-zero coefficient, which is an orientation (Devillers & Teillaud 2011).
#[inline]
pub fn insphere_perturbed(a: DVec3, b: DVec3, c: DVec3, d: DVec3, p: DVec3) -> f64 {
    let s = insphere(a, b, c, d, p);
    if s != 0.0 { s } else { perturbation(a, b, c, d, p) }
}

/// Tie break of [`insphere_perturbed`], for five cospherical points.
#[cold]
#[inline(never)]
pub fn perturbation(a: DVec3, b: DVec3, c: DVec3, d: DVec3, p: DVec3) -> f64 {
    perturbation_by(orient3d, [a, b, c, d], p)
}

/// [`perturbation`] with a given exact orientation.
pub(crate) fn perturbation_by(
    orient3d: impl Fn(DVec3, DVec3, DVec3, DVec3) -> f64,
    tet: [DVec3; 4],
    p: DVec3,
) -> f64 {
    // Corners from the largest down; past p itself nothing counts, since its own coefficient is not zero.
    let mut tried = [false; 4];
    for _ in 0..4 {
        let mut largest = 4;
        for i in (0..4).filter(|&i| !tried[i]) {
            let best = if largest == 4 { p } else { tet[largest] };
            if lexicographic(tet[i], best).is_gt() {
                largest = i;
            }
        }
        if largest == 4 {
            break;
        }
        tried[largest] = true;
        let mut t = tet;
        t[largest] = p;
        let o = orient3d(t[0], t[1], t[2], t[3]);
        if o != 0.0 {
            return o;
        }
    }
    -1.0
}

/// Positive when `d` lies strictly outside the ball whose diameter is the edge `a, b`; negative inside; zero on it.
///
/// The sign of `(a - d) . (b - d)`, degree 2.
pub fn edge_gabriel(a: DVec3, b: DVec3, d: DVec3) -> f64 {
    let (u, v) = (a - d, b - d);
    let dot = u.dot(v);
    // Two rounded differences, one product and at most two sums a term: (1 + e)^5 - 1 < 6e, and 8e covers the bound itself.
    let bound = 8.0 * EPSILON * u.abs().dot(v.abs()) + UNDERFLOW;
    if dot.abs() > bound || exact_on_lattice(&[(a, d, u), (b, d, v)], 24) {
        return dot;
    }
    Vector::difference(a, d).dot(&Vector::difference(b, d)).sign()
}

/// [`edge_gabriel`] with ties broken by the coordinates: never zero for three distinct points.
///
/// With heights `e` added to the lifted points the power of `d` is
/// `(d - a).(d - b) + e_d - (1 - t) e_a - t e_b`, where `t` in (0, 1) places the foot of `d` on the edge when the angle is
/// right. The largest height decides: outside exactly when `d` is lexicographically the largest of the three.
#[inline]
pub fn edge_gabriel_perturbed(a: DVec3, b: DVec3, d: DVec3) -> f64 {
    let s = edge_gabriel(a, b, d);
    if s != 0.0 {
        s
    } else if lexicographic(d, a).is_gt() && lexicographic(d, b).is_gt() {
        1.0
    } else {
        -1.0
    }
}

/// Positive when the angle of the triangle `a, b, c` at `a` is acute, zero when it is right. Same polynomial as
/// [`edge_gabriel`] of the edge `b, c` seen from `a`.
#[inline]
pub fn acute_at(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    edge_gabriel(b, c, a)
}

/// Positive when `d` lies strictly outside the smallest ball through the corners of the triangle `a, b, c` (centre in the
/// triangle's plane); negative inside; zero on it. The triangle must not be degenerate; its orientation does not count.
///
/// With `u = b - a`, `v = c - a`, `w = d - a`, `n = u x v` the sign of
/// `|w|^2 |n|^2 - w . (|v|^2 (n x u) + |u|^2 (v x n))`, degree 6.
pub fn tri_gabriel(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let (u, v, w) = (b - a, c - a, d - a);
    let n = u.cross(v);
    let (uu, vv, ww) = (u.length_squared(), v.length_squared(), w.length_squared());
    let m = vv * n.cross(u) + uu * v.cross(n);
    let g = ww * n.length_squared() - w.dot(m);
    // Forward bound with magnitudes: every factor replaced by its absolute value, minuses by pluses. A term passes six
    // rounded differences and at most 14 further operations on its way (cross 2, cross 2, square 3, product 1, sum 1, dot 3,
    // final 2), so its relative error is below 20e / (1 - 20e); 32e leaves room for the rounding of the bound.
    let (au, av, aw) = (u.abs(), v.abs(), w.abs());
    let an = cross_magnitude(au, av);
    let am = vv * cross_magnitude(an, au) + uu * cross_magnitude(av, an);
    let bound = 32.0 * EPSILON * (ww * an.length_squared() + aw.dot(am)) + UNDERFLOW;
    if g.abs() > bound || exact_on_lattice(&[(b, a, u), (c, a, v), (d, a, w)], 7) {
        g
    } else {
        tri_gabriel_exact(a, b, c, d)
    }
}

/// Whether the differences `d = p - q` are exact and are multiples of one unit, at most `2^bits` of it: a polynomial of degree
/// `n` and with few terms is then exact in plain arithmetic as long as `n * bits` stays well below 53. The case of lattices.
#[inline(never)]
pub(crate) fn exact_on_lattice(differences: &[(DVec3, DVec3, DVec3)], bits: i32) -> bool {
    let largest = differences
        .iter()
        .fold(0.0f64, |m, (_, _, d)| m.max(d.abs().max_element()));
    let exponent = ((largest.to_bits() >> 52) & 0x7ff) as i32 - 1022;
    if !(-150..=161).contains(&exponent) {
        return false;
    }
    // A power of two by its bits, and whole numbers as those that come back from where numbers have no fractions: without
    // calls into the mathematical library.
    let units = f64::from_bits(((bits - exponent + 1023) as u64) << 52);
    const NO_FRACTIONS: f64 = 1.5 * (1u64 << 52) as f64;
    differences.iter().all(|&(p, q, d)| {
        let exact = |p: f64, q: f64| two_sum(p, -q)[0] == 0.0;
        let whole = |v: f64| (v * units + NO_FRACTIONS) - NO_FRACTIONS == v * units;
        exact(p.x, q.x) & exact(p.y, q.y) & exact(p.z, q.z) & whole(d.x) & whole(d.y) & whole(d.z)
    })
}

/// The cross product with every minus a plus: bounds the magnitudes of its terms.
#[inline]
fn cross_magnitude(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(
        a.y * b.z + a.z * b.y,
        a.z * b.x + a.x * b.z,
        a.x * b.y + a.y * b.x,
    )
}

#[cold]
#[inline(never)]
fn tri_gabriel_exact(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let [u, v, w] = [b, c, d].map(|p| Vector::difference(p, a));
    let n = u.cross(&v);
    let m = n.cross(&u).scale(&v.dot(&v)).add(&v.cross(&n).scale(&u.dot(&u)));
    w.dot(&w).mul(&n.dot(&n)).sub(&w.dot(&m)).sign()
}

/// [`tri_gabriel`] with ties broken by the coordinates: never zero for four distinct points that span space.
///
/// With heights `e` added to the lifted points the power of `d` gains `e_d - alpha e_a - beta e_b - gamma e_c`, where
/// `alpha, beta, gamma` are the barycentric coordinates of the foot of `d` in the triangle's plane. The sign is that of the
/// first coefficient that is not zero, heights in lexicographic order, largest first.
#[inline]
pub fn tri_gabriel_perturbed(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let s = tri_gabriel(a, b, c, d);
    if s != 0.0 { s } else { tri_gabriel_tie(a, b, c, d) }
}

#[cold]
#[inline(never)]
fn tri_gabriel_tie(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let corners = [a, b, c];
    let mut order = [0usize, 1, 2];
    order.sort_unstable_by(|&i, &j| lexicographic(corners[j], corners[i]));
    for i in order {
        if lexicographic(d, corners[i]).is_gt() {
            return 1.0;
        }
        // Barycentric coordinate of the foot of d at corner i: with u from the next corner to corner i, v to the third and
        // w to d it is ((w.u)(v.v) - (w.v)(u.v)) / |u x v|^2.
        let base = corners[(i + 1) % 3];
        let (p, q) = (corners[i], corners[(i + 2) % 3]);
        let (u, v, w) = (p - base, q - base, d - base);
        let weight = if exact_on_lattice(&[(p, base, u), (q, base, v), (d, base, w)], 11) {
            w.dot(u) * v.dot(v) - w.dot(v) * u.dot(v)
        } else {
            let [u, v, w] = [p, q, d].map(|p| Vector::difference(p, base));
            w.dot(&u).mul(&v.dot(&v)).sub(&w.dot(&v).mul(&u.dot(&v))).sign()
        };
        if weight != 0.0 {
            return -weight;
        }
    }
    1.0
}

/// Whether three points lie on one line, exactly.
pub fn collinear(a: DVec3, b: DVec3, c: DVec3) -> bool {
    let flat = |f: fn(DVec3) -> (f64, f64)| {
        let [p, q, r] = [a, b, c].map(|v| {
            let (x, y) = f(v);
            robust::Coord { x, y }
        });
        robust::orient2d(p, q, r) == 0.0
    };
    flat(|v| (v.x, v.y)) && flat(|v| (v.y, v.z)) && flat(|v| (v.z, v.x))
}
