//! Filters in front of the exact predicates, tuned to one cloud.
//!
//! In: the box of the normalised points. Out: signs. Steps, each tried when the one before cannot decide:
//! 1. the determinant in plain arithmetic against a bound that costs next to nothing: for orientations one for the whole box,
//!    known beforehand; for spheres one from the largest distance;
//! 2. the same value against a bound from all differences;
//! 3. whole numbers of fixed size ([`Grid`]), exact for almost every cloud;
//! 4. Shewchuk's expansions, always exact.
//!
//! Bounds: Shewchuk 1997 proves that his stage-A evaluation errs by at most `(7 + 56 e) e` times the permanent for orient3d
//! and `(16 + 224 e) e` times for insphere, `e = 2^-53`, the permanent being the same sum with absolute values. We evaluate
//! in his order. With `X, Y, Z` the largest magnitudes of the (rounded) differences the permanent of orient3d has six
//! products and is at most `6 X Y Z`. That of insphere is the sum, over the four points, of a lift times the permanent of the
//! three other rows; a permanent of three rows is at most `3! / 3^(3/2) = 1.1548` times the product of their lengths (Carlen,
//! Lieb & Loss 2006, "An inequality of Hadamard type for permanents"), so with `r` the lengths the permanent is at most
//! `1.1548 abcd (a + b + c + d)`, and at most `4.62 L^(5/2)` with `L` the largest lift. The factors below exceed the products
//! of these constants by more than the rounding of lengths and bounds.

use super::lanes::{Corners, Lanes, Site};
use crate::geometry::fixed::Grid;
use crate::geometry::predicates::{self, EPSILON};
use glam::DVec3;

const ORIENT: f64 = 43.0 * EPSILON;
/// `16 * 1.1548`, and room.
const INSPHERE: f64 = 18.6 * EPSILON;
/// The square of `4 * INSPHERE`: squares are compared, which saves the root.
const INSPHERE_SQUARED: f64 = 16.0 * INSPHERE * INSPHERE;

/// Exact predicates for the points of one box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    orient: f64,
    grid: Grid,
}

impl Filter {
    /// For points within the box `[lo, hi]`.
    pub(super) fn new([lo, hi]: [DVec3; 2]) -> Self {
        // Rounding is monotonic, so no rounded difference of two points exceeds the rounded extent.
        let e = hi - lo;
        Self {
            orient: orient_bound(e),
            grid: Grid::new(lo.abs().max(hi.abs()).max_element()),
        }
    }

    /// Positive when the tetrahedron `a, b, c, d` is positively oriented; zero only when it is flat.
    #[inline(always)]
    pub(super) fn orient3d(&self, a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
        let [ad, bd, cd] = [a - d, b - d, c - d];
        let det = ad.z * (cd.x * bd.y - bd.x * cd.y)
            + bd.z * (ad.x * cd.y - cd.x * ad.y)
            + cd.z * (bd.x * ad.y - ad.x * bd.y);
        if det.abs() > self.orient {
            det
        } else {
            self.orient3d_near([a, b, c, d], det)
        }
    }

    #[inline(never)]
    fn orient3d_near(&self, [a, b, c, d]: [DVec3; 4], det: f64) -> f64 {
        let extent = max((a - d).abs(), max((b - d).abs(), (c - d).abs()));
        if det.abs() > orient_bound(extent) {
            return det;
        }
        self.grid
            .orient3d(a, b, c, d)
            .unwrap_or_else(|| predicates::orient3d(a, b, c, d))
    }

    /// Positive when `p` lies inside the sphere of the positively oriented tetrahedron `a, b, c, d`, ties broken by
    /// coordinates: never zero for distinct points.
    #[inline(always)]
    pub(super) fn insphere<L: Lanes>(&self, lanes: L, tet: Corners, p: &Site) -> f64 {
        let (det, lift) = lanes.insphere(tet, p);
        let square = lift * lift;
        // An overflow makes the bound infinite, which is not certain.
        if det * det > INSPHERE_SQUARED * (square * square * lift) {
            det
        } else {
            self.insphere_near(tet.map(Site::point), p.point(), det)
        }
    }

    #[inline(never)]
    fn insphere_near(&self, [a, b, c, d]: [DVec3; 4], p: DVec3, det: f64) -> f64 {
        let [la, lb, lc, ld] = [a, b, c, d].map(|q| (q - p).length());
        if det.abs() > INSPHERE * ((la * lb) * (lc * ld)) * ((la + lb) + (lc + ld)) {
            return det;
        }
        let exact = self
            .grid
            .insphere(a, b, c, d, p)
            .unwrap_or_else(|| predicates::insphere(a, b, c, d, p));
        if exact != 0.0 {
            return exact;
        }
        predicates::perturbation_by(|a, b, c, d| self.orient3d(a, b, c, d), [a, b, c, d], p)
    }
}

/// Componentwise maximum, without the care that `DVec3::max` takes of NaN.
#[inline(always)]
fn max(a: DVec3, b: DVec3) -> DVec3 {
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    DVec3::new(larger(a.x, b.x), larger(a.y, b.y), larger(a.z, b.z))
}

#[inline(always)]
fn orient_bound(e: DVec3) -> f64 {
    ORIENT * e.x * e.y * e.z
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Scalar, Task, with_lanes};
    use super::*;

    struct Inside<'a>(&'a Filter, Corners<'a>, &'a Site);
    impl Task for Inside<'_> {
        type Output = bool;
        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) -> bool {
            self.0.insphere(lanes, self.1, self.2) > 0.0
        }
    }

    /// Every step against expansions, on points from general to flat and cospherical.
    #[test]
    fn signs_agree_with_expansions() {
        let mut state = 3u64;
        let mut next = |flat: f64| {
            DVec3::from_array(std::array::from_fn(|k| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                let v = (state >> 12) as f64 / (1u64 << 52) as f64 - 0.5;
                if k == 2 { v * flat } else { v }
            }))
        };
        let filter = Filter::new([DVec3::splat(-1.0), DVec3::splat(1.0)]);
        for round in 0..40_000 {
            let flat = [1.0, 1e-7, 1e-15, 1e-30][round % 4];
            let q: [DVec3; 5] = std::array::from_fn(|_| {
                let p = next(flat);
                if round % 3 == 0 { p.normalize() } else { p }
            });
            let [a, b, c, d, p] = q;
            let side = predicates::orient3d(a, b, c, d);
            assert_eq!(filter.orient3d(a, b, c, d) > 0.0, side > 0.0);
            if side <= 0.0 {
                continue;
            }
            let exact = predicates::insphere_perturbed(a, b, c, d, p) > 0.0;
            let [a, b, c, d, p] = q.map(|p| Site::new(p, 7.0));
            let corners = [&a, &b, &c, &d];
            assert_eq!(filter.insphere(Scalar, corners, &p) > 0.0, exact, "{q:?}");
            assert_eq!(with_lanes(Inside(&filter, corners, &p)), exact, "{q:?}");
        }
    }
}
