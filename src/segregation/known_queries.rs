//! The queries of a known surface, answered by its closest-point index and its winding number.

use super::known_surface::SurfaceQueries;
use crate::geometry::{SignedDistance, TriangleMesh};
use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

/// Two crossings nearer than this share of the segment are one (a crossing through an edge is found in both triangles).
const SAME_CROSSING: f64 = 1e-9;

/// A known surface with its indices.
pub struct KnownSurface {
    signed: SignedDistance,
    corners: Vec<[DVec3; 3]>,
    boxes: Bvh,
}

impl KnownSurface {
    /// Indexes a closed, outward oriented surface; `None` when it has no triangles. `O(n log n)`.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        let signed = SignedDistance::new(mesh)?;
        let corners: Vec<[DVec3; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(|i| mesh.points[i as usize]))
            .collect();
        let leaves: Vec<Aabb> = corners
            .iter()
            .map(|[a, b, c]| Aabb::new(a.min(*b).min(*c), a.max(*b).max(*c)))
            .collect();
        Some(Self {
            signed,
            corners,
            boxes: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves),
        })
    }
}

impl SurfaceQueries for KnownSurface {
    fn distance_mm(&self, point: DVec3) -> f64 {
        self.signed.closest.closest(point).distance2.sqrt()
    }

    fn is_inside(&self, point: DVec3) -> bool {
        self.signed.winding.is_inside(point)
    }

    fn crossings(&self, from: DVec3, to: DVec3) -> Vec<f64> {
        let along = to - from;
        let inverse = along.recip();
        let mut hits: Vec<f64> = self
            .boxes
            .leaves(|node: &BvhNode| meets_box(from, inverse, node.mins(), node.maxs()))
            .filter_map(|t| meets_triangle(from, along, self.corners[t as usize]))
            .collect();
        hits.sort_unstable_by(f64::total_cmp);
        hits.dedup_by(|a, b| (*a - *b).abs() <= SAME_CROSSING);
        hits
    }
}

/// Slab test of the segment `from + s / inverse`, `s` in 0..1, with a box.
fn meets_box(from: DVec3, inverse: DVec3, low: DVec3, high: DVec3) -> bool {
    let (a, b) = ((low - from) * inverse, (high - from) * inverse);
    let mut enter: f64 = 0.0;
    let mut leave: f64 = 1.0;
    for k in 0..3 {
        // A segment that does not move along an axis: inside the slab or not, never NaN arithmetic.
        if inverse[k].is_infinite() {
            if from[k] < low[k] || from[k] > high[k] {
                return false;
            }
            continue;
        }
        enter = enter.max(a[k].min(b[k]));
        leave = leave.min(a[k].max(b[k]));
    }
    enter <= leave
}

/// Where the segment meets a triangle, borders included (Moeller & Trumbore 1997); `None` when parallel.
fn meets_triangle(from: DVec3, along: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = along.cross(ac);
    let det = ab.dot(p);
    if det == 0.0 {
        return None;
    }
    let offset = from - a;
    let u = offset.dot(p) / det;
    let q = offset.cross(ab);
    let v = along.dot(q) / det;
    let s = ac.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&s)).then_some(s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_crosses_a_tetrahedron_twice() {
        let mesh = TriangleMesh {
            points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        };
        let known = KnownSurface::new(&mesh).expect("four triangles");
        let hits = known.crossings(DVec3::new(0.1, 0.1, -1.0), DVec3::new(0.1, 0.1, 3.0));
        assert_eq!(hits.len(), 2);
        assert!((hits[0] - 0.25).abs() < 1e-12 && (hits[1] - 0.45).abs() < 1e-12);
        assert!(known.is_inside(DVec3::splat(0.1)) && !known.is_inside(DVec3::splat(0.5)));
    }
}
