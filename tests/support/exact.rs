//! Predicates in integers of any size: coordinates are multiplied by a common power of two until all are whole.
#![allow(dead_code)]

use glam::DVec3;
use num_bigint::BigInt;

/// A point with whole coordinates.
pub type Point = [BigInt; 3];

/// The points times a common power of two, exactly.
pub fn whole(points: &[DVec3]) -> Vec<Point> {
    let parts = |v: f64| {
        let bits = v.to_bits();
        let e = ((bits >> 52) & 0x7ff) as i64;
        let m = (bits & ((1 << 52) - 1)) as i64;
        let (m, e) = if e == 0 {
            (m, -1074)
        } else {
            (m | 1 << 52, e - 1075)
        };
        if m == 0 {
            return (0, i64::MAX);
        }
        let zeros = m.trailing_zeros();
        ((m >> zeros) * if v < 0.0 { -1 } else { 1 }, e + i64::from(zeros))
    };
    let all = || points.iter().flat_map(|p| p.to_array()).map(parts);
    let lowest = all().map(|(_, e)| e).min().unwrap_or(0);
    points
        .iter()
        .map(|p| {
            p.to_array().map(parts).map(|(m, e)| {
                if m == 0 {
                    BigInt::ZERO
                } else {
                    BigInt::from(m) << (e - lowest)
                }
            })
        })
        .collect()
}

fn sub(a: &Point, b: &Point) -> Point {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn dot(a: &Point, b: &Point) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn cross(a: &Point, b: &Point) -> Point {
    [
        &a[1] * &b[2] - &a[2] * &b[1],
        &a[2] * &b[0] - &a[0] * &b[2],
        &a[0] * &b[1] - &a[1] * &b[0],
    ]
}

fn sign(v: &BigInt) -> i8 {
    match v.sign() {
        num_bigint::Sign::Minus => -1,
        num_bigint::Sign::NoSign => 0,
        num_bigint::Sign::Plus => 1,
    }
}

/// 1 when the tetrahedron is positively oriented.
pub fn orient3d(a: &Point, b: &Point, c: &Point, d: &Point) -> i8 {
    sign(&dot(&cross(&sub(b, a), &sub(c, a)), &sub(d, a)))
}

/// Whether three points lie on a line.
pub fn collinear(a: &Point, b: &Point, c: &Point) -> bool {
    cross(&sub(b, a), &sub(c, a)).iter().all(|v| *v == BigInt::ZERO)
}

/// 1 when `p` lies inside the sphere of the positively oriented tetrahedron, by its circumcentre as a rational point:
/// not the determinant that the library uses.
pub fn insphere(a: &Point, b: &Point, c: &Point, d: &Point, p: &Point) -> i8 {
    let [u, v, w, q] = [b, c, d, p].map(|x| sub(x, a));
    // centre - a = m / (2 det); inside when |q|^2 < 2 q . (centre - a) = q . m / det, det > 0.
    let (vw, wu, uv) = (cross(&v, &w), cross(&w, &u), cross(&u, &v));
    let (uu, vv, ww) = (dot(&u, &u), dot(&v, &v), dot(&w, &w));
    let m: Point = std::array::from_fn(|k| &uu * &vw[k] + &vv * &wu[k] + &ww * &uv[k]);
    sign(&(dot(&q, &m) - dot(&q, &q) * dot(&u, &vw)))
}

/// 1 when `d` lies outside the smallest ball through the triangle `a, b, c`, by its centre as a rational point.
pub fn tri_gabriel(a: &Point, b: &Point, c: &Point, d: &Point) -> i8 {
    let [u, v, w] = [b, c, d].map(|x| sub(x, a));
    // centre - a = s u + t v with Gram's rule: s = vv (uu - uv) / (2 g), t = uu (vv - uv) / (2 g), g = uu vv - uv^2.
    let (uu, vv, uv) = (dot(&u, &u), dot(&v, &v), dot(&u, &v));
    let g = &uu * &vv - &uv * &uv;
    let (s, t) = (&vv * (&uu - &uv), &uu * (&vv - &uv));
    // outside when |w|^2 > 2 w . (centre - a).
    sign(&(dot(&w, &w) * g - s * dot(&w, &u) - t * dot(&w, &v)))
}

/// 1 when `d` lies outside the ball over the edge `a, b`.
pub fn edge_gabriel(a: &Point, b: &Point, d: &Point) -> i8 {
    sign(&dot(&sub(a, d), &sub(b, d)))
}

/// Circumcentre and radius of a tetrahedron, right to the last bits; `corners` gives the unit of the whole numbers.
pub fn circumsphere(whole: &[Point], corners: &[DVec3; 4]) -> (DVec3, f64) {
    let [u, v, w] = [1, 2, 3].map(|i| sub(&whole[i], &whole[0]));
    let (vw, wu, uv) = (cross(&v, &w), cross(&w, &u), cross(&u, &v));
    let (uu, vv, ww) = (dot(&u, &u), dot(&v, &v), dot(&w, &w));
    let m: Point = std::array::from_fn(|k| &uu * &vw[k] + &vv * &wu[k] + &ww * &uv[k]);
    let det = BigInt::from(2) * dot(&u, &vw);
    // One coordinate tells how many whole units make one.
    let unit = corners[0].x / ratio(&whole[0][0], &BigInt::from(1));
    let offset = DVec3::from_array(std::array::from_fn(|k| ratio(&m[k], &det) * unit));
    (corners[0] + offset, offset.length())
}

/// Quotient as a float, with 80 bits before rounding.
fn ratio(a: &BigInt, b: &BigInt) -> f64 {
    let shift = 80 + b.bits() as i64 - a.bits() as i64;
    let q = if shift >= 0 {
        (a << shift) / b
    } else {
        a / (b << -shift)
    };
    let digits: f64 = q.to_string().parse().expect("a number");
    digits * f64::powi(2.0, -(shift as i32))
}
