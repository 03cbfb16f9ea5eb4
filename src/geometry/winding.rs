//! Generalised winding number: how often an oriented surface wraps round a point.
//!
//! In: an oriented triangle mesh, queries in mm. Out: the winding number (1 inside and 0 outside a closed, outward oriented
//! surface; fractions where it is open), and a decision against 1/2 that is the decision of the exact sum.
//!
//! 1. Triangles are split in halves along the longest side of their centroids' box, down to leaves of a few triangles.
//! 2. Every node keeps the area moments of its triangles about their area centroid up to second order.
//! 3. A query sums exact solid angles near by (van Oosterom & Strackee 1983) and a node's second-order expansion far away
//!    (Barill, Dickson, Schmidt, Levin & Jacobson 2018, "Fast winding numbers for soups and clouds").
//!
//! Departure from Barill et al.: they accept a node at a fixed ratio of distance to size, which bounds nothing. Here a node is
//! accepted when a bound on its remainder is within its share of an error budget, so the sum is within the budget always. The
//! bound: with `s = r / R` (radius of the node over distance), the order-m term of the field of a unit dipole is at most
//! `(m+1) s^m / (4 pi R^2)` (Legendre series; Bernstein-Szego inequality), so what is left out beyond order 2 is at most
//! `s^3 (4 - 3 s) / (1 - s)^2 / (4 pi R^2)` for each unit of area.
//!
//! Cost: `O(n log n)` to build, about `O(log n)` a query. A point on the surface itself has no winding number; it gets some
//! value between those of the two sides, always the same one.

use super::mesh::TriangleMesh;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Triangles in a leaf; solid angles of so few cost as much as one expansion.
const LEAF: usize = 6;

/// Error budget of [`WindingNumber::is_inside`]'s first try: on a closed surface the exact value is an integer, so any error
/// below a half decides.
const COARSE: f64 = 0.3;

/// Error budget of [`WindingNumber::winding`].
const FINE: f64 = 1e-3;

/// An oriented mesh prepared for winding number queries.
pub struct WindingNumber {
    corners: Vec<[DVec3; 3]>,
    nodes: Vec<Node>,
    total_area: f64,
}

#[derive(Clone, Debug)]
struct Node {
    /// Triangles `first..last` of `corners`.
    first: u32,
    last: u32,
    /// Index of the second child; the first follows its parent. 0 for a leaf.
    right: u32,
    centre: DVec3,
    radius: f64,
    area: f64,
    moments: Moments,
}

/// Area moments about a centre: `n`, `n (x-c)`, `n (x-c)(x-c)`, where `n` is the area vector. The derivatives they are
/// contracted with are symmetric, so only the symmetric part of each is kept.
#[derive(Clone, Debug, Default)]
struct Moments {
    zeroth: DVec3,
    first: DMat3,
    /// xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz of the symmetrised third-order tensor.
    second: [f64; 10],
}

impl WindingNumber {
    /// Prepares a mesh; `None` when it has no triangles. Coordinates must be finite and indices in range.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        if mesh.triangles.is_empty() {
            return None;
        }
        let mut corners: Vec<[DVec3; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(|i| mesh.points[i as usize]))
            .collect();
        let mut nodes = Vec::with_capacity(corners.len() / 2);
        let total = corners.len();
        build(&mut corners, 0, total, &mut nodes);
        let total_area = nodes[0].area;
        Some(Self {
            corners,
            nodes,
            total_area,
        })
    }

    /// The winding number within 0.001.
    pub fn winding(&self, query: DVec3) -> f64 {
        self.winding_within(query, FINE)
    }

    /// The winding number within `budget`; 0 asks for the exact sum of solid angles, `O(n)`.
    pub fn winding_within(&self, query: DVec3, budget: f64) -> f64 {
        // A node of area A may leave out at most budget * A / total, see the module's bound.
        let limit = if self.total_area > 0.0 {
            4.0 * PI * budget / self.total_area
        } else {
            0.0
        };
        let mut sum = 0.0;
        let mut next = 0usize;
        // Preorder with skips: the node after a subtree is the end of it.
        let mut stack: Vec<u32> = Vec::with_capacity(64);
        loop {
            let node = &self.nodes[next];
            let v = node.centre - query;
            let distance2 = v.length_squared();
            if node.remainder_per_area(distance2) <= limit {
                sum += node.moments.field(v, distance2);
            } else if node.right == 0 {
                for &[a, b, c] in &self.corners[node.first as usize..node.last as usize] {
                    sum += solid_angle(a - query, b - query, c - query);
                }
            } else {
                stack.push(node.right);
                next += 1;
                continue;
            }
            match stack.pop() {
                Some(id) => next = id as usize,
                None => return sum / (4.0 * PI),
            }
        }
    }

    /// Whether the winding number exceeds 1/2, decided as the exact sum of solid angles decides.
    ///
    /// A coarse sum is enough on closed surfaces, whose winding numbers are integers; on open ones the budget shrinks until
    /// the value is clear of 1/2, at last to the exact sum.
    pub fn is_inside(&self, query: DVec3) -> bool {
        for budget in [COARSE, COARSE / 10.0, FINE] {
            let w = self.winding_within(query, budget);
            if (w - 0.5).abs() > budget {
                return w > 0.5;
            }
        }
        self.winding_within(query, 0.0) > 0.5
    }

    /// [`Self::winding`] of many queries in parallel, in the order of the queries.
    pub fn winding_many(&self, queries: &[DVec3]) -> Vec<f64> {
        queries.par_iter().map(|&q| self.winding(q)).collect()
    }

    /// [`Self::is_inside`] of many queries in parallel, in the order of the queries.
    pub fn is_inside_many(&self, queries: &[DVec3]) -> Vec<bool> {
        queries.par_iter().map(|&q| self.is_inside(q)).collect()
    }
}

impl Node {
    /// Bound on what the expansion leaves out, times 4 pi, for each unit of area.
    #[inline]
    fn remainder_per_area(&self, distance2: f64) -> f64 {
        let s = self.radius / distance2.sqrt();
        if s < 0.9 {
            s * s * s * (4.0 - 3.0 * s) / ((1.0 - s) * (1.0 - s) * distance2)
        } else {
            f64::INFINITY
        }
    }
}

impl Moments {
    fn add_triangle(&mut self, [a, b, c]: [DVec3; 3], centre: DVec3) {
        let n = (b - a).cross(c - a) * 0.5;
        let (a, b, c) = (a - centre, b - centre, c - centre);
        let g = (a + b + c) / 3.0;
        self.zeroth += n;
        self.first += outer(n, g);
        // Mean of x x^T over a triangle: (sum of corner squares + 9 g g^T) / 12.
        let m = (outer(a, a) + outer(b, b) + outer(c, c) + outer(g, g) * 9.0) * (1.0 / 12.0);
        let t = |i: usize, j: usize, k: usize| {
            (n[i] * m.col(j)[k] + n[j] * m.col(i)[k] + n[k] * m.col(i)[j]) / 3.0
        };
        let terms = [
            t(0, 0, 0),
            t(1, 1, 1),
            t(2, 2, 2),
            t(0, 0, 1),
            t(0, 0, 2),
            t(1, 1, 0),
            t(1, 1, 2),
            t(2, 2, 0),
            t(2, 2, 1),
            t(0, 1, 2),
        ];
        for (sum, term) in self.second.iter_mut().zip(terms) {
            *sum += term;
        }
    }

    /// Solid angle of the expansion seen from a point at `-v` of the centre.
    fn field(&self, v: DVec3, r2: f64) -> f64 {
        let r = r2.sqrt();
        let r3 = r2 * r;
        let r5 = r3 * r2;
        let zeroth = self.zeroth.dot(v) / r3;
        let q = &self.first;
        let trace = q.x_axis.x + q.y_axis.y + q.z_axis.z;
        let first = trace / r3 - 3.0 * v.dot(*q * v) / r5;
        let [xxx, yyy, zzz, xxy, xxz, yyx, yyz, zzx, zzy, xyz] = self.second;
        let DVec3 { x, y, z } = v;
        let traced = (xxx + yyx + zzx) * x + (xxy + yyy + zzy) * y + (xxz + yyz + zzz) * z;
        let cubic = xxx * x * x * x
            + yyy * y * y * y
            + zzz * z * z * z
            + 3.0
                * (xxy * x * x * y
                    + xxz * x * x * z
                    + yyx * y * y * x
                    + yyz * y * y * z
                    + zzx * z * z * x
                    + zzy * z * z * y)
            + 6.0 * xyz * x * y * z;
        let second = 0.5 * (15.0 * cubic / (r5 * r2) - 9.0 * traced / r5);
        zeroth + first + second
    }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Builds the subtree of `corners[first..last]` in preorder and returns its index.
fn build(corners: &mut [[DVec3; 3]], first: usize, last: usize, nodes: &mut Vec<Node>) -> u32 {
    let here = &corners[first..last];
    let area_of = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let area: f64 = here.iter().map(|&t| area_of(t)).sum();
    let middle = |t: &[DVec3; 3]| (t[0] + t[1] + t[2]) / 3.0;
    let centre = if area > 0.0 {
        here.iter().map(|t| middle(t) * area_of(*t)).sum::<DVec3>() / area
    } else {
        middle(&here[0])
    };
    let radius = here
        .iter()
        .flatten()
        .map(|x| (*x - centre).length_squared())
        .fold(0.0, f64::max)
        .sqrt();
    let mut moments = Moments::default();
    for &t in here {
        moments.add_triangle(t, centre);
    }
    let id = nodes.len();
    nodes.push(Node {
        first: first as u32,
        last: last as u32,
        right: 0,
        centre,
        radius,
        area,
        moments,
    });
    if last - first > LEAF {
        let (lo, hi) = here
            .iter()
            .map(middle)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), m| {
                (lo.min(m), hi.max(m))
            });
        let axis = (hi - lo).max_position();
        // A stable sort: equal centroids keep their order, so the tree is a function of the mesh.
        corners[first..last].sort_by(|s, t| middle(s)[axis].total_cmp(&middle(t)[axis]));
        let half = first.midpoint(last);
        build(corners, first, half, nodes);
        nodes[id].right = build(corners, half, last, nodes);
    }
    id as u32
}

/// Signed solid angle of a triangle seen from the origin (van Oosterom & Strackee 1983), in `(-2 pi, 2 pi]`.
fn solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let numerator = a.dot(b.cross(c));
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    if numerator == 0.0 && denominator <= 0.0 {
        return 0.0; // on the triangle's plane: on the triangle itself the angle is undefined, half-way is 0
    }
    2.0 * numerator.atan2(denominator)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn torus(n: u32, m: u32) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for i in 0..n {
            for j in 0..m {
                let (u, v) = (i as f64 / n as f64 * 2.0 * PI, j as f64 / m as f64 * 2.0 * PI);
                let r = 3.0 + v.cos();
                mesh.points.push(DVec3::new(r * u.cos(), r * u.sin(), v.sin()));
                let at = |i: u32, j: u32| (i % n) * m + j % m;
                mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        mesh
    }

    #[test]
    fn every_budget_is_kept_near_and_far() {
        let mesh = torus(60, 30);
        assert!(mesh.signed_volume() > 0.0);
        let winding = WindingNumber::new(&mesh).expect("triangles");
        let open = TriangleMesh {
            triangles: mesh.triangles[..2500].to_vec(),
            ..mesh.clone()
        };
        let open = WindingNumber::new(&open).expect("triangles");
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for i in 0..600 {
            let mut q = (DVec3::new(rng.random(), rng.random(), rng.random()) * 2.0 - 1.0) * 5.0;
            if i % 3 == 0 {
                let t = mesh.triangles[i * 5].map(|v| mesh.points[v as usize]);
                let n = (t[1] - t[0]).cross(t[2] - t[0]).normalize();
                let side = if i % 2 == 0 { 1.0 } else { -1.0 };
                q = (t[0] + t[1] + t[2]) / 3.0 + n * side * 10f64.powi(-(i as i32 % 9));
            }
            for tree in [&winding, &open] {
                let exact = tree.winding_within(q, 0.0);
                for budget in [0.3, 0.03, 1e-3] {
                    let w = tree.winding_within(q, budget);
                    assert!((w - exact).abs() <= budget, "{q}: {w} against {exact}");
                }
                assert_eq!(tree.is_inside(q), exact > 0.5);
            }
            let exact = winding.winding_within(q, 0.0);
            assert!((exact - exact.round()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_hair_above_and_below_a_face_differ() {
        let mesh = torus(60, 30);
        let winding = WindingNumber::new(&mesh).expect("triangles");
        for t in mesh.triangles.iter().step_by(17) {
            let [a, b, c] = t.map(|v| mesh.points[v as usize]);
            let n = (b - a).cross(c - a).normalize();
            let on = a * 0.2 + b * 0.3 + c * 0.5;
            assert!(winding.is_inside(on - n * 1e-12));
            assert!(!winding.is_inside(on + n * 1e-12));
        }
    }
}
