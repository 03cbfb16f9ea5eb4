//! Centre and radius of the sphere through the corners of a triangle or tetrahedron.
//!
//! In: points. Out: [`Sphere`]. The solve works on differences from the first corner; when its condition says that more
//! than five digits would be lost (slivers), numerator and denominator are formed exactly as expansions and divided once,
//! so the result is right to a few units in the last place of the offset from that corner however flat the simplex is.
//! Cost: about 60 operations, some microseconds for a sliver.

use super::expansion::Vector;
use glam::DVec3;

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, mm.
    pub centre: DVec3,
    /// Radius, mm.
    pub radius: f64,
}

/// Smallest ratio of numerator and denominator to the products of lengths that bound their terms at which the plain solve is
/// kept. Neither has more than 17 roundings, so the quotient's relative error stays below `2 * 17 * 2^-53 * 2^14 = 6e-11`.
pub(crate) const WELL_CONDITIONED: f64 = 1.0 / 16384.0;

/// The sphere through the corners of a tetrahedron of non-zero volume (either orientation).
///
/// ```
/// # use glam::DVec3;
/// # use medial_scaffold::geometry::circumsphere::tetrahedron;
/// let s = tetrahedron([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
/// assert_eq!(s.centre, DVec3::splat(0.5));
/// ```
pub fn tetrahedron(corners: [DVec3; 4]) -> Sphere {
    let a = corners[0];
    let [u, v, w] = [corners[1] - a, corners[2] - a, corners[3] - a];
    let (uu, vv, ww) = (u.length_squared(), v.length_squared(), w.length_squared());
    let vw = v.cross(w);
    let m = uu * vw + vv * w.cross(u) + ww * u.cross(v);
    let [lu, lv, lw] = [uu.sqrt(), vv.sqrt(), ww.sqrt()];
    tetrahedron_from(corners, m, u.dot(vw), lu * lv * lw, lu + lv + lw)
}

/// [`tetrahedron`] with the numerator `m`, the determinant, the product and the sum of the lengths of the three edges from the
/// first corner at hand.
#[inline]
pub(crate) fn tetrahedron_from(corners: [DVec3; 4], m: DVec3, det: f64, volume: f64, lengths: f64) -> Sphere {
    let least = WELL_CONDITIONED * volume;
    let well = det.abs() > least && m.length_squared() > (least * lengths).powi(2);
    let offset = if well {
        m * (0.5 / det)
    } else {
        tetrahedron_exact(corners)
    };
    Sphere {
        centre: corners[0] + offset,
        radius: offset.length(),
    }
}

/// Offset of the centre from the first corner, each coordinate within two units in its last place.
#[cold]
#[inline(never)]
fn tetrahedron_exact(corners: [DVec3; 4]) -> DVec3 {
    let [u, v, w] = [1, 2, 3].map(|i| Vector::difference(corners[i], corners[0]));
    let vw = v.cross(&w);
    let det = 2.0 * u.dot(&vw).approximate();
    let m = vw
        .scale(&u.dot(&u))
        .add(&w.cross(&u).scale(&v.dot(&v)))
        .add(&u.cross(&v).scale(&w.dot(&w)));
    let [x, y, z] = m.0.map(|e| e.approximate() / det);
    DVec3::new(x, y, z)
}

/// The smallest sphere through the corners of a triangle of non-zero area: its centre lies in the triangle's plane.
pub fn triangle(corners: [DVec3; 3]) -> Sphere {
    let a = corners[0];
    let (u, v) = (corners[1] - a, corners[2] - a);
    let n = u.cross(v);
    let nn = n.length_squared();
    let (uu, vv) = (u.length_squared(), v.length_squared());
    let m = vv * n.cross(u) + uu * v.cross(n);
    let area = uu * vv;
    let well = nn > WELL_CONDITIONED * area
        && m.length_squared() > WELL_CONDITIONED.powi(2) * area * area * (uu.sqrt() + vv.sqrt()).powi(2);
    let offset = if well {
        m / (2.0 * nn)
    } else {
        triangle_exact(corners)
    };
    Sphere {
        centre: a + offset,
        radius: offset.length(),
    }
}

#[cold]
#[inline(never)]
fn triangle_exact(corners: [DVec3; 3]) -> DVec3 {
    let [u, v] = [1, 2].map(|i| Vector::difference(corners[i], corners[0]));
    let n = u.cross(&v);
    let det = 2.0 * n.dot(&n).approximate();
    let m = n.cross(&u).scale(&v.dot(&v)).add(&v.cross(&n).scale(&u.dot(&u)));
    let [x, y, z] = m.0.map(|e| e.approximate() / det);
    DVec3::new(x, y, z)
}
