//! Triangle meshes and their topology.
//!
//! In: points in mm and triangles by point index. Out: area, signed volume, Euler number, open and non-manifold edges and
//! vertices, components, orientability. All counts come from the triangles alone, so they hold for soups too.
//! Cost: `O(n log n)` (edges are sorted, not hashed, so results do not depend on a hash order).

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A triangle mesh or soup; counter-clockwise seen from outside when it is oriented. Units mm, frame LPS.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriangleMesh {
    /// Vertex positions, mm.
    pub points: Vec<DVec3>,
    /// Triangles as indices into `points`.
    pub triangles: Vec<[u32; 3]>,
}

/// What the triangles alone say of a mesh. Vertices that no triangle uses are not counted.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshTopology {
    /// Vertices used by a triangle.
    pub vertices: usize,
    /// Distinct edges.
    pub edges: usize,
    /// Triangles.
    pub triangles: usize,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Edges with three or more triangles.
    pub nonmanifold_edges: usize,
    /// Vertices whose triangles do not form a single fan or ring.
    pub nonmanifold_vertices: usize,
    /// Connected components (through shared vertices).
    pub components: usize,
    /// `vertices - edges + triangles`.
    pub euler: i64,
    /// Closed: every edge has exactly two triangles.
    pub watertight: bool,
    /// A consistent orientation exists.
    pub orientable: bool,
    /// The triangles as given are consistently oriented.
    pub oriented: bool,
}

impl TriangleMesh {
    /// Sum of the triangle areas, mm^2.
    pub fn area(&self) -> f64 {
        self.triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| self.points[i as usize]);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum()
    }

    /// Signed volume by the divergence theorem, mm^3, positive when oriented outward. Meaningful for closed, oriented
    /// meshes only; measured from the first point so that a shape far from the origin keeps its digits.
    pub fn signed_volume(&self) -> f64 {
        let Some(&origin) = self.points.first() else {
            return 0.0;
        };
        self.triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| self.points[i as usize] - origin);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    /// Corners of the axis-aligned bounding box of all points, or `None` without points.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        bounds(&self.points)
    }

    /// Diagonal of the bounding box, mm; 0 without points.
    pub fn diagonal_mm(&self) -> f64 {
        self.bounds().map_or(0.0, |[lo, hi]| (hi - lo).length())
    }

    /// Reverses every triangle.
    pub fn flip(&mut self) {
        for t in &mut self.triangles {
            t.swap(1, 2);
        }
    }

    /// Area-weighted vertex normals, unit length; zero where no triangle has area.
    pub fn vertex_normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.points.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.points[i as usize]);
            let n = (b - a).cross(c - a);
            for &i in t {
                normals[i as usize] += n;
            }
        }
        normals.iter().map(|n| n.normalize_or_zero()).collect()
    }

    /// Counts and flags of the whole mesh; see [`MeshTopology`]. `O(n log n)`.
    pub fn topology(&self) -> MeshTopology {
        topology(&self.triangles, self.points.len())
    }

    /// The components that enclose some volume, as [`Self::components`]: not the pairs of triangles back to back, or the needles, that files
    /// hold beside the surface. `O(n log n)`.
    pub fn solid_components(&self) -> Vec<Vec<u32>> {
        /// A ball encloses 0.09 of its area to the power of 1.5, and a plate of a thousandth of its width 0.0004.
        const NOTHING: f64 = 1e-9;
        let mut parts = self.components();
        if parts.len() > 1 {
            parts.retain(|part| {
                let part = self.submesh(part);
                part.signed_volume().abs() > NOTHING * part.area().powf(1.5)
            });
        }
        parts
    }

    /// Connected components as lists of triangle indices, in order of their smallest triangle.
    pub fn components(&self) -> Vec<Vec<u32>> {
        let mut sets = DisjointSets::new(self.points.len());
        for t in &self.triangles {
            sets.union(t[0], t[1]);
            sets.union(t[0], t[2]);
        }
        let mut slot = vec![u32::MAX; self.points.len()];
        let mut out: Vec<Vec<u32>> = Vec::new();
        for (i, t) in self.triangles.iter().enumerate() {
            let root = sets.find(t[0]) as usize;
            if slot[root] == u32::MAX {
                slot[root] = out.len() as u32;
                out.push(Vec::new());
            }
            out[slot[root] as usize].push(i as u32);
        }
        out
    }

    /// The mesh of some triangles, with unused points dropped and the rest in their old order.
    pub fn submesh(&self, triangles: &[u32]) -> TriangleMesh {
        let mut slot = vec![u32::MAX; self.points.len()];
        for &t in triangles {
            for i in self.triangles[t as usize] {
                slot[i as usize] = 0;
            }
        }
        let mut points = Vec::new();
        for (i, s) in slot.iter_mut().enumerate().filter(|(_, s)| **s == 0) {
            *s = points.len() as u32;
            points.push(self.points[i]);
        }
        let triangles = triangles
            .iter()
            .map(|&t| self.triangles[t as usize].map(|i| slot[i as usize]))
            .collect();
        TriangleMesh { points, triangles }
    }
}

/// Corners of the axis-aligned bounding box of points, or `None` without points.
pub fn bounds(points: &[DVec3]) -> Option<[DVec3; 2]> {
    let first = *points.first()?;
    Some(
        points
            .iter()
            .fold([first, first], |[lo, hi], &p| [lo.min(p), hi.max(p)]),
    )
}

/// Union-find with path halving, by smaller root: the representative of a set is its smallest member.
#[derive(Clone, Debug)]
pub struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// `n` singletons.
    pub fn new(n: usize) -> Self {
        Self {
            parent: (0..n as u32).collect(),
        }
    }

    /// The smallest member of the set that holds `x`.
    pub fn find(&mut self, mut x: u32) -> u32 {
        while self.parent[x as usize] != x {
            let up = self.parent[self.parent[x as usize] as usize];
            self.parent[x as usize] = up;
            x = up;
        }
        x
    }

    /// Joins two sets; `true` when they were apart.
    pub fn union(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b) as usize] = a.min(b);
        a != b
    }
}

/// One side of a triangle: the edge by its smaller and larger vertex, the triangle, and whether it runs low to high.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Side {
    pub edge: (u32, u32),
    pub triangle: u32,
    pub forward: bool,
}

/// The sides of all triangles, those of one edge together, in order.
pub(crate) fn sides(triangles: &[[u32; 3]]) -> Vec<Side> {
    let mut sides: Vec<Side> = triangles
        .iter()
        .enumerate()
        .flat_map(|(i, t)| {
            [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| Side {
                edge: (a.min(b), a.max(b)),
                triangle: i as u32,
                forward: a < b,
            })
        })
        .collect();
    sides.sort_unstable();
    sides
}

fn topology(triangles: &[[u32; 3]], points: usize) -> MeshTopology {
    let sides = sides(triangles);
    let mut out = MeshTopology {
        triangles: triangles.len(),
        orientable: true,
        oriented: true,
        ..Default::default()
    };
    // Orientation: a triangle and its flip are two nodes; non-orientable iff some pair is joined.
    let n = triangles.len() as u32;
    let mut flips = DisjointSets::new(2 * triangles.len());
    let mut corners = DisjointSets::new(3 * triangles.len());
    let corner = |triangle: u32, vertex: u32| {
        let t = triangles[triangle as usize];
        3 * triangle + t.iter().position(|&v| v == vertex).unwrap_or(0) as u32
    };
    for run in sides.chunk_by(|a, b| a.edge == b.edge) {
        out.edges += 1;
        match run {
            [_] => out.boundary_edges += 1,
            [a, b] => {
                let same = a.forward == b.forward;
                out.oriented &= !same;
                let offset = if same { n } else { 0 };
                flips.union(a.triangle, b.triangle + offset);
                flips.union(a.triangle + n, (b.triangle + n + offset) % (2 * n));
            }
            _ => {
                out.nonmanifold_edges += 1;
                out.oriented &= run.iter().filter(|s| s.forward).count() * 2 == run.len();
            }
        }
        for pair in run.windows(2) {
            for v in [pair[0].edge.0, pair[0].edge.1] {
                corners.union(corner(pair[0].triangle, v), corner(pair[1].triangle, v));
            }
        }
    }
    out.orientable = (0..n).all(|t| flips.find(t) != flips.find(t + n));
    let mut fans = vec![0u32; points];
    let mut parts = DisjointSets::new(points);
    for (i, t) in triangles.iter().enumerate() {
        parts.union(t[0], t[1]);
        parts.union(t[0], t[2]);
        for (k, &v) in t.iter().enumerate() {
            let c = (3 * i + k) as u32;
            fans[v as usize] += u32::from(corners.find(c) == c);
        }
    }
    for v in 0..points {
        if fans[v] > 0 {
            out.vertices += 1;
            out.nonmanifold_vertices += usize::from(fans[v] > 1);
            out.components += usize::from(parts.find(v as u32) == v as u32);
        }
    }
    out.euler = out.vertices as i64 - out.edges as i64 + out.triangles as i64;
    out.watertight = out.triangles > 0 && out.boundary_edges == 0 && out.nonmanifold_edges == 0;
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        }
    }

    #[test]
    fn tetrahedron_is_closed_and_oriented() {
        let m = tetrahedron();
        let t = m.topology();
        assert_eq!((t.vertices, t.edges, t.triangles, t.euler), (4, 6, 4, 2));
        assert!(t.watertight && t.orientable && t.oriented);
        assert_eq!(t.components, 1);
        assert!((m.signed_volume() - 1.0 / 6.0).abs() < 1e-15);
        assert!((m.area() - (1.5 + 0.75f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn a_flipped_face_is_seen_and_a_missing_one_too() {
        let mut m = tetrahedron();
        m.triangles[0].swap(0, 1);
        let t = m.topology();
        assert!(!t.oriented && t.orientable && t.watertight);
        m.triangles.pop();
        let t = m.topology();
        assert_eq!(t.boundary_edges, 3);
        assert!(!t.watertight);
    }

    #[test]
    fn a_moebius_band_is_not_orientable() {
        let n = 6u32;
        let mut triangles = Vec::new();
        for i in 0..n {
            let (a, b) = (2 * i, 2 * i + 1);
            let (c, d) = if i + 1 < n { (2 * i + 2, 2 * i + 3) } else { (1, 0) };
            triangles.push([a, b, c]);
            triangles.push([b, d, c]);
        }
        let t = topology(&triangles, 2 * n as usize);
        assert!(!t.orientable && !t.oriented);
        assert_eq!(
            (t.euler, t.boundary_edges, t.nonmanifold_edges),
            (0, 2 * n as usize, 0)
        );
    }

    #[test]
    fn two_tetrahedra_touching_at_a_vertex_pinch_it() {
        let mut triangles = tetrahedron().triangles;
        triangles.extend(
            tetrahedron()
                .triangles
                .iter()
                .map(|t| t.map(|i| if i == 0 { 0 } else { i + 3 })),
        );
        let t = topology(&triangles, 7);
        assert_eq!(
            (t.nonmanifold_vertices, t.components, t.boundary_edges),
            (1, 1, 0)
        );
    }
}
