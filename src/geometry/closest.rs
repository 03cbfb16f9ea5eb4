//! The closest point of a triangle mesh, and signed distance to a closed one.
//!
//! In: a mesh and queries in mm. Out: the closest surface point, its triangle, the squared distance; with a
//! [`WindingNumber`] beside it, a sign that is right on closed meshes however sharp their edges
//! (pseudo-normals fail where a surface touches itself, the winding number does not).
//!
//! 1. parry's bounding-volume hierarchy prunes; boxes are f64.
//! 2. The closest point of one triangle by Voronoi regions (Ericson, Real-Time Collision Detection, 5.1.5), degenerate
//!    triangles by their edges.
//!
//! Cost: `O(n log n)` to build, about `O(log n)` a query. One mesh gives one answer on any number of threads.

use super::{mesh::TriangleMesh, winding::WindingNumber};
use glam::DVec3;
use parry3d_f64::{
    bounding_volume::Aabb,
    partitioning::{Bvh, BvhBuildStrategy, BvhNode},
};
use rayon::prelude::*;

/// The point of a surface closest to a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// The point, mm.
    pub point: DVec3,
    /// Index of a triangle it lies on (one of them when it lies on an edge or a vertex).
    pub triangle: u32,
    /// Squared distance from the query, mm^2.
    pub distance2: f64,
}

/// A triangle mesh with an index for closest-point queries.
pub struct ClosestOnMesh {
    corners: Vec<[DVec3; 3]>,
    bvh: Bvh,
}

impl ClosestOnMesh {
    /// Indexes a mesh; `None` when it has no triangles. Coordinates must be finite and indices in range.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        if mesh.triangles.is_empty() {
            return None;
        }
        let corners: Vec<[DVec3; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(|i| mesh.points[i as usize]))
            .collect();
        let boxes: Vec<Aabb> = corners
            .iter()
            .map(|[a, b, c]| Aabb::new(a.min(*b).min(*c), a.max(*b).max(*c)))
            .collect();
        let bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        Some(Self { corners, bvh })
    }

    /// The closest point of the surface.
    pub fn closest(&self, query: DVec3) -> ClosestPoint {
        self.closest_within(query, f64::MAX)
            .expect("a mesh with triangles has a closest point")
    }

    /// The closest point of the surface when it is nearer than `radius_mm`.
    pub fn closest_within(&self, query: DVec3, radius_mm: f64) -> Option<ClosestPoint> {
        // Costs are squared distances; the square of f64::MAX must stay finite.
        let limit2 = if radius_mm < 1e150 {
            radius_mm * radius_mm
        } else {
            f64::MAX
        };
        self.bvh
            .find_best(
                limit2,
                |node: &BvhNode, _| {
                    let outside = (node.mins() - query).max(query - node.maxs()).max(DVec3::ZERO);
                    outside.length_squared()
                },
                |triangle, _| {
                    let [a, b, c] = self.corners[triangle as usize];
                    Some((closest_on_triangle(query, a, b, c) - query).length_squared())
                },
            )
            .map(|(triangle, distance2)| {
                let [a, b, c] = self.corners[triangle as usize];
                ClosestPoint {
                    point: closest_on_triangle(query, a, b, c),
                    triangle,
                    distance2,
                }
            })
    }

    /// [`Self::closest`] of many queries in parallel, in the order of the queries.
    pub fn closest_many(&self, queries: &[DVec3]) -> Vec<ClosestPoint> {
        queries.par_iter().map(|&q| self.closest(q)).collect()
    }
}

/// A closed surface with everything a signed distance needs.
pub struct SignedDistance {
    /// Closest points.
    pub closest: ClosestOnMesh,
    /// Inside or outside.
    pub winding: WindingNumber,
}

impl SignedDistance {
    /// Indexes a closed, outward oriented mesh; `None` when it has no triangles.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        Some(Self {
            closest: ClosestOnMesh::new(mesh)?,
            winding: WindingNumber::new(mesh)?,
        })
    }

    /// Distance to the surface, mm, negative inside.
    pub fn signed_distance(&self, query: DVec3) -> f64 {
        let distance = self.closest.closest(query).distance2.sqrt();
        if self.winding.is_inside(query) {
            -distance
        } else {
            distance
        }
    }

    /// [`Self::signed_distance`] of many queries in parallel, in the order of the queries.
    pub fn signed_distance_many(&self, queries: &[DVec3]) -> Vec<f64> {
        queries.par_iter().map(|&q| self.signed_distance(q)).collect()
    }
}

/// The point of triangle `abc` closest to `p`. A triangle without area is treated as its three edges.
pub fn closest_on_triangle(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let normal = ab.cross(ac);
    let area2 = normal.length_squared();
    // Below this the barycentric coordinates are noise: the triangle is a segment as far as f64 can tell.
    if area2 <= 1e-24 * ab.length_squared() * ac.length_squared() {
        return closest_on_edges(p, a, b, c);
    }
    let bc = c - b;
    let w = normal.dot(ab.cross(ap));
    let v = -normal.dot(ac.cross(cp));
    let u = normal.dot(bc.cross(bp));
    if w <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return closest_on_segment(p, a, b);
    }
    if v <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return closest_on_segment(p, a, c);
    }
    if u <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return closest_on_segment(p, b, c);
    }
    a + (ab * v + ac * w) / (u + v + w)
}

/// The point of segment `ab` closest to `p`.
pub fn closest_on_segment(p: DVec3, a: DVec3, b: DVec3) -> DVec3 {
    let ab = b - a;
    let length2 = ab.length_squared();
    if length2 == 0.0 {
        return a;
    }
    a + ab * ((p - a).dot(ab) / length2).clamp(0.0, 1.0)
}

fn closest_on_edges(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    let candidates = [
        closest_on_segment(p, a, b),
        closest_on_segment(p, b, c),
        closest_on_segment(p, c, a),
    ];
    candidates
        .into_iter()
        .min_by(|x, y| (*x - p).length_squared().total_cmp(&(*y - p).length_squared()))
        .expect("three candidates")
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn random_point(rng: &mut ChaCha8Rng) -> DVec3 {
        DVec3::new(rng.random(), rng.random(), rng.random()) * 2.0 - 1.0
    }

    /// The closest point of a triangle by dense sampling is never closer than ours, and nearly as close.
    #[test]
    fn one_triangle_against_dense_sampling() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for case in 0..300 {
            let (a, b, mut c) = (
                random_point(&mut rng),
                random_point(&mut rng),
                random_point(&mut rng),
            );
            if case % 5 == 0 {
                c = a + (b - a) * rng.random::<f64>(); // degenerate
            }
            let p = random_point(&mut rng) * 2.0;
            let ours = (closest_on_triangle(p, a, b, c) - p).length();
            let n = 60;
            let mut sampled = f64::MAX;
            for i in 0..=n {
                for j in 0..=n - i {
                    let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
                    let x = a + (b - a) * u + (c - a) * v;
                    sampled = sampled.min((x - p).length());
                }
            }
            assert!(ours <= sampled + 1e-9, "case {case}: {ours} > {sampled}");
            assert!(sampled - ours < 0.06, "case {case}: {ours} << {sampled}");
        }
    }

    #[test]
    fn a_soup_against_brute_force() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let points: Vec<DVec3> = (0..300).map(|_| random_point(&mut rng)).collect();
        let triangles: Vec<[u32; 3]> = (0..200)
            .map(|_| [0; 3].map(|_: u32| rng.random_range(0..300)))
            .collect();
        let mesh = TriangleMesh { points, triangles };
        let index = ClosestOnMesh::new(&mesh).expect("triangles");
        for _ in 0..500 {
            let q = random_point(&mut rng) * 1.5;
            let best = mesh
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|i| mesh.points[i as usize]);
                    (closest_on_triangle(q, a, b, c) - q).length_squared()
                })
                .fold(f64::MAX, f64::min);
            let hit = index.closest(q);
            assert_eq!(hit.distance2, best);
            assert!(index.closest_within(q, best.sqrt() * 0.999).is_none());
            assert!(index.closest_within(q, best.sqrt() * 1.001).is_some());
        }
    }
}
