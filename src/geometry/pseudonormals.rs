//! On which side of a closed surface a point lies, from its nearest surface point alone.
//!
//! In: a closed, consistently oriented mesh; a query with its closest point. Out: inside or not.
//!
//! 1. The closest point lies in a face, on an edge or at a vertex (by its barycentric coordinates).
//! 2. That feature's normal: the face's, the sum of both faces' at an edge, the sum over the faces weighted by their angles at a
//!    vertex. The sign of its product with the offset of the query is right for every feature of an embedded surface
//!    (Baerentzen and Aanaes 2005).
//!
//! A few operations a query, against a walk through a tree for a [winding number](super::winding::WindingNumber). Departure: where a surface
//! passes through itself the answer is that of the nearest piece, which may lie inside another; so whoever asks must compare some
//! answers with the winding number's. Cost: `O(n log n)` to build. Degenerate: a mesh with an edge that does not have two
//! opposite triangles, or with a triangle without area, has no pseudonormals.

use super::{closest::ClosestPoint, mesh::TriangleMesh};
use glam::DVec3;

/// Barycentric coordinates below this are on the opposite edge. A point taken for one of an edge though it lies in a face nearby
/// does no harm: the offset is along the face's normal, and the edge's sum agrees with it.
const ON_EDGE: f64 = 1e-7;

/// Normals of all faces, edges and vertices of a closed mesh.
pub struct Pseudonormals {
    triangles: Vec<Features>,
    vertices: Vec<DVec3>,
}

struct Features {
    ids: [u32; 3],
    corners: [DVec3; 3],
    /// Unit normal.
    face: DVec3,
    /// Normal of the edge opposite each corner, not of unit length.
    edges: [DVec3; 3],
}

impl Pseudonormals {
    /// The normals of a mesh; `None` when it is not closed and oriented or has a triangle without area. Indices must be in range.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        let mut vertices = vec![DVec3::ZERO; mesh.points.len()];
        let mut triangles = Vec::with_capacity(mesh.triangles.len());
        // Every edge from both of its sides: low vertex, high vertex, triangle, corner opposite, whether it runs upward.
        let mut sides = Vec::with_capacity(3 * mesh.triangles.len());
        for (t, &ids) in mesh.triangles.iter().enumerate() {
            let corners = ids.map(|i| mesh.points[i as usize]);
            let [a, b, c] = corners;
            let face = (b - a).cross(c - a).try_normalize()?;
            for k in 0..3 {
                let (next, last) = ((k + 1) % 3, (k + 2) % 3);
                let angle = (corners[next] - corners[k]).angle_between(corners[last] - corners[k]);
                vertices[ids[k] as usize] += face * angle;
                let (i, j) = (ids[next], ids[last]);
                sides.push((i.min(j), i.max(j), t, k, i < j));
            }
            triangles.push(Features {
                ids,
                corners,
                face,
                edges: [face; 3],
            });
        }
        sides.sort_unstable();
        for run in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            let [(.., s, k, up), (.., t, l, other_up)] = *run else {
                return None;
            };
            if up == other_up {
                return None;
            }
            let sum = triangles[s].face + triangles[t].face;
            triangles[s].edges[k] = sum;
            triangles[t].edges[l] = sum;
        }
        (!triangles.is_empty()).then_some(Self { triangles, vertices })
    }

    /// Whether `query` is inside, given its closest point on the mesh these normals are of.
    pub fn is_inside(&self, query: DVec3, closest: &ClosestPoint) -> bool {
        self.normal(closest).dot(query - closest.point) < 0.0
    }

    /// Normal of the feature the closest point lies on.
    fn normal(&self, closest: &ClosestPoint) -> DVec3 {
        let t = &self.triangles[closest.triangle as usize];
        let [a, b, c] = t.corners;
        let p = closest.point;
        let part = |x: DVec3, y: DVec3| t.face.dot((x - p).cross(y - p));
        let parts = [part(b, c), part(c, a), part(a, b)];
        let limit = ON_EDGE * (parts[0] + parts[1] + parts[2]);
        let zero = parts.map(|x| x <= limit);
        match zero {
            [false, false, false] => t.face,
            [true, false, false] => t.edges[0],
            [false, true, false] => t.edges[1],
            [false, false, true] => t.edges[2],
            _ => {
                let nearest = (0..3).max_by(|&i, &j| parts[i].total_cmp(&parts[j])).unwrap_or(0);
                self.vertices[t.ids[nearest] as usize]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ClosestOnMesh, WindingNumber};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A box with a slanted notch: convex and concave edges, sharp corners of both kinds.
    fn notched() -> TriangleMesh {
        let outline = [
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 3.0),
            (2.2, 3.0),
            (1.9, 0.7),
            (1.6, 3.0),
            (0.0, 3.0),
        ];
        let n = outline.len() as u32;
        let mut points = Vec::new();
        for z in [0.0, 2.0] {
            points.extend(outline.iter().map(|&(x, y)| DVec3::new(x, y, z)));
        }
        let mut triangles = Vec::new();
        for i in 0..n {
            let j = (i + 1) % n;
            triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
        }
        // The notch's bottom (4) sees all of the outline.
        for i in 0..n {
            let j = (i + 1) % n;
            if i != 4 && j != 4 {
                triangles.extend([[4, j, i], [n + 4, n + i, n + j]]);
            }
        }
        TriangleMesh { points, triangles }
    }

    #[test]
    fn agree_with_the_winding_number_at_faces_edges_and_corners() {
        let mesh = notched();
        assert!(mesh.topology().watertight);
        assert!((mesh.signed_volume() - 2.0 * (12.0 - 0.5 * 0.6 * 2.3)).abs() < 1e-9);
        let normals = Pseudonormals::new(&mesh).expect("closed");
        let (index, winding) = (
            ClosestOnMesh::new(&mesh).expect("triangles"),
            WindingNumber::new(&mesh).expect("triangles"),
        );
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut on_edges = 0;
        for k in 0..20_000 {
            // Half of the queries close to a corner or an edge, where the features meet.
            let random = DVec3::new(rng.random(), rng.random(), rng.random());
            let q = if k % 2 == 0 {
                random * DVec3::new(6.0, 5.0, 4.0) - 1.0
            } else {
                let (i, j) = (rng.random_range(0..14), rng.random_range(0..14));
                mesh.points[i].lerp(mesh.points[j], rng.random()) + (random - 0.5) * 0.2
            };
            let closest = index.closest(q);
            let t = &normals.triangles[closest.triangle as usize];
            on_edges += usize::from(normals.normal(&closest) != t.face);
            assert_eq!(normals.is_inside(q, &closest), winding.is_inside(q), "{q}");
        }
        assert!(on_edges > 5000, "{on_edges}");
    }

    #[test]
    fn open_and_turned_meshes_have_none() {
        let mut open = notched();
        open.triangles.pop();
        assert!(Pseudonormals::new(&open).is_none());
        let mut turned = notched();
        turned.triangles[3].swap(0, 1);
        assert!(Pseudonormals::new(&turned).is_none());
    }
}
