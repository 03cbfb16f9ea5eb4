//! Critical simplices by brute force, in whole numbers, with ties broken by actually raising the lifted points.
//!
//! Point `i` of `n` (in lexicographic order) is raised by `2^(200 (i - n))`, far less than any difference that the small
//! whole coordinates of the fixtures can make and far more than all smaller raises together; everything is multiplied by
//! `2^(200 n)`. No tie is left, and no tie rule is needed.

use glam::DVec3;
use num_bigint::BigInt;

type Vector = [i64; 3];

pub struct Oracle {
    points: Vec<Vector>,
    raise: Vec<BigInt>,
    shift: u32,
}

fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}

fn dot(a: Vector, b: Vector) -> i128 {
    (0..3).map(|k| i128::from(a[k]) * i128::from(b[k])).sum()
}

fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

impl Oracle {
    /// Points must be sorted, distinct and whole, below 1000 in magnitude.
    pub fn new(points: &[DVec3]) -> Self {
        let n = points.len() as u32;
        Self {
            points: points.iter().map(|p| p.to_array().map(|v| v as i64)).collect(),
            raise: (0..n).map(|i| BigInt::from(1) << (200 * i)).collect(),
            shift: 200 * n,
        }
    }

    /// Sign of `value * 2^shift + raised`, which is only computed when `value` is zero or nearly so.
    fn sign(&self, value: i128, raised: impl FnOnce() -> BigInt) -> bool {
        if value.abs() > 1 {
            return value > 0;
        }
        let sum = (BigInt::from(value) << self.shift) + raised();
        assert!(sum != BigInt::ZERO, "raised points have no ties");
        sum > BigInt::ZERO
    }

    fn raised(&self, i: usize, base: usize) -> BigInt {
        &self.raise[i] - &self.raise[base]
    }

    /// `d` outside the smallest ball through `a, b`.
    fn outside_edge(&self, [a, b]: [usize; 2], d: usize) -> bool {
        let [u, w] = [b, d].map(|i| sub(self.points[i], self.points[a]));
        let l = dot(u, u);
        self.sign((dot(w, w) - dot(w, u)) * l, || {
            self.raised(d, a) * l - self.raised(b, a) * dot(w, u)
        })
    }

    /// `d` outside the smallest ball through `a, b, c`.
    fn outside_triangle(&self, [a, b, c]: [usize; 3], d: usize) -> bool {
        let [u, v, w] = [b, c, d].map(|i| sub(self.points[i], self.points[a]));
        let (uu, vv, uv) = (dot(u, u), dot(v, v), dot(u, v));
        let g = uu * vv - uv * uv;
        let (wu, wv) = (dot(w, u), dot(w, v));
        let value = dot(w, w) * g - vv * (uu - uv) * wu - uu * (vv - uv) * wv;
        self.sign(value, || {
            self.raised(d, a) * g
                - self.raised(b, a) * (vv * wu - uv * wv)
                - self.raised(c, a) * (uu * wv - uv * wu)
        })
    }

    /// `q` outside the sphere through `t`, whose orientation does not matter.
    fn outside_tet(&self, t: [usize; 4], q: usize) -> bool {
        let [u, v, w, x] = [t[1], t[2], t[3], q].map(|i| sub(self.points[i], self.points[t[0]]));
        let (vw, wu, uv) = (cross(v, w), cross(w, u), cross(u, v));
        let det = dot(u, vw);
        let s = det.signum();
        let (b, c, d) = (s * dot(x, vw), s * dot(x, wu), s * dot(x, uv));
        let value = dot(x, x) * det.abs() - dot(u, u) * b - dot(v, v) * c - dot(w, w) * d;
        self.sign(value, || {
            self.raised(q, t[0]) * det.abs()
                - self.raised(t[1], t[0]) * b
                - self.raised(t[2], t[0]) * c
                - self.raised(t[3], t[0]) * d
        })
    }

    fn others<'a>(&self, simplex: &'a [usize]) -> impl Iterator<Item = usize> + use<'a> {
        (0..self.points.len()).filter(|i| !simplex.contains(i))
    }

    pub fn triangle_is_gabriel(&self, t: [usize; 3]) -> bool {
        self.others(&t).all(|d| self.outside_triangle(t, d))
    }

    pub fn triangle_is_acute(&self, [a, b, c]: [usize; 3]) -> bool {
        self.outside_edge([a, b], c) && self.outside_edge([b, c], a) && self.outside_edge([c, a], b)
    }

    /// Numbers of critical vertices, edges, triangles and tetrahedra.
    pub fn critical(&self) -> [u64; 4] {
        let n = self.points.len();
        let mut counts = [n as u64, 0, 0, 0];
        for a in 0..n {
            for b in a + 1..n {
                counts[1] += u64::from(self.others(&[a, b]).all(|d| self.outside_edge([a, b], d)));
                for c in b + 1..n {
                    let [u, v] = [b, c].map(|i| sub(self.points[i], self.points[a]));
                    if cross(u, v) == [0; 3] {
                        continue;
                    }
                    let t = [a, b, c];
                    counts[2] += u64::from(self.triangle_is_acute(t) && self.triangle_is_gabriel(t));
                    counts[3] += (c + 1..n).filter(|&d| self.is_sink([a, b, c, d])).count() as u64;
                }
            }
        }
        counts
    }

    fn is_sink(&self, t: [usize; 4]) -> bool {
        let [u, v, w] = [t[1], t[2], t[3]].map(|i| sub(self.points[i], self.points[t[0]]));
        dot(u, cross(v, w)) != 0
            && (0..4).all(|k| {
                let facet = [t[(k + 1) % 4], t[(k + 2) % 4], t[(k + 3) % 4]];
                self.outside_triangle(facet, t[k])
            })
            && self.others(&t).all(|q| self.outside_tet(t, q))
    }
}
