//! Triangle meshes: the common currency of the crate.
//!
//! A [`TriangleMesh`] is a list of points and a list of index triples, counter-clockwise seen from
//! outside. Everything that a test asks of a surface is computed here from the triangles alone:
//! volume (divergence theorem), area, Euler number, border loops, manifoldness and orientation, so
//! that these numbers never share code with the analytic values they are compared with.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// An indexed triangle mesh, mm. Closed meshes are oriented outwards.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriangleMesh {
    /// Vertex positions, mm.
    pub points: Vec<DVec3>,
    /// Vertex indices of every triangle, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// An axis-aligned box, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Least corner.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
}

impl Bounds {
    /// The box around some points; `None` when there are none.
    pub fn of(points: &[DVec3]) -> Option<Self> {
        let first = *points.first()?;
        let start = Bounds {
            min: first,
            max: first,
        };
        Some(points.iter().fold(start, |b, &p| Bounds {
            min: b.min.min(p),
            max: b.max.max(p),
        }))
    }

    /// Box of the given half sizes around the origin.
    pub fn centred(half: DVec3) -> Self {
        Bounds {
            min: -half,
            max: half,
        }
    }

    /// Edge lengths.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        self.size().length()
    }

    /// Middle point.
    pub fn centre(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// The box grown by `margin` on every side.
    pub fn inflated(&self, margin: f64) -> Self {
        Bounds {
            min: self.min - DVec3::splat(margin),
            max: self.max + DVec3::splat(margin),
        }
    }

    /// The smallest box around two.
    pub fn union(&self, other: &Bounds) -> Self {
        Bounds {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|k| {
            DVec3::new(
                if k & 1 == 0 { self.min.x } else { self.max.x },
                if k & 2 == 0 { self.min.y } else { self.max.y },
                if k & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}

/// What the triangles of a mesh say about its topology, counted edge by edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshTopology {
    /// Vertices used by at least one triangle.
    pub vertices: usize,
    /// Distinct edges.
    pub edges: usize,
    /// Triangles.
    pub triangles: usize,
    /// `vertices - edges + triangles`.
    pub euler: i64,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Closed chains of border edges (components of the border graph).
    pub boundary_loops: usize,
    /// Edges with three triangles or more.
    pub nonmanifold_edges: usize,
    /// Vertices whose triangles do not form one fan or disk.
    pub nonmanifold_vertices: usize,
    /// Connected components (through shared vertices).
    pub components: usize,
    /// Every inner edge is run through once in each direction.
    pub oriented: bool,
}

impl MeshTopology {
    /// Closed, manifold and oriented: the mesh bounds a solid.
    pub fn is_closed_oriented_manifold(&self) -> bool {
        self.boundary_edges == 0
            && self.nonmanifold_edges == 0
            && self.nonmanifold_vertices == 0
            && self.oriented
    }
}

/// Union-find with path halving; the smaller index is always the root, so that results do not depend on order.
pub(crate) struct Sets(Vec<u32>);

impl Sets {
    pub(crate) fn new(n: usize) -> Self {
        Sets((0..n as u32).collect())
    }

    pub(crate) fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high as usize] = low;
    }
}

impl TriangleMesh {
    /// Corner positions of triangle `t`.
    pub fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|v| self.points[v as usize])
    }

    /// Twice the area times the unit normal of triangle `t`.
    pub fn double_area_normal(&self, t: usize) -> DVec3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(c - a)
    }

    /// Enclosed volume, mm^3, by the divergence theorem; positive for a closed mesh oriented outwards.
    pub fn volume(&self) -> f64 {
        // Relative to one vertex, so that a mesh far from the origin does not lose digits.
        let Some(&o) = self.points.first() else { return 0.0 };
        let six: f64 = (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                (a - o).dot((b - o).cross(c - o))
            })
            .sum();
        six / 6.0
    }

    /// Surface area, mm^2.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| 0.5 * self.double_area_normal(t).length())
            .sum()
    }

    /// Box around the points.
    ///
    /// # Panics
    /// When the mesh has no points.
    pub fn bounds(&self) -> Bounds {
        Bounds::of(&self.points).expect("a mesh has points")
    }

    /// Mean edge length over triangle sides, mm.
    pub fn mean_edge_length(&self) -> f64 {
        let sum: f64 = (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                a.distance(b) + b.distance(c) + c.distance(a)
            })
            .sum();
        sum / (3 * self.triangles.len().max(1)) as f64
    }

    /// Centroid of the enclosed solid.
    pub fn solid_centroid(&self) -> DVec3 {
        let Some(&o) = self.points.first() else {
            return DVec3::ZERO;
        };
        let mut moment = DVec3::ZERO;
        let mut six = 0.0;
        for t in 0..self.triangles.len() {
            let [a, b, c] = self.corners(t).map(|p| p - o);
            let v = a.dot(b.cross(c));
            six += v;
            moment += v * (a + b + c) / 4.0;
        }
        o + moment / six
    }

    /// Unit normals of the vertices (area-weighted mean of the triangles around).
    pub fn vertex_normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.points.len()];
        for t in 0..self.triangles.len() {
            let n = self.double_area_normal(t);
            for v in self.triangles[t] {
                normals[v as usize] += n;
            }
        }
        normals.into_iter().map(|n| n.normalize_or_zero()).collect()
    }

    /// The mesh with every point moved by `map`; correspondence is by index.
    pub fn mapped(&self, map: impl Fn(DVec3) -> DVec3) -> Self {
        TriangleMesh {
            points: self.points.iter().map(|&p| map(p)).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// The mesh with its orientation reversed.
    pub fn flipped(&self) -> Self {
        TriangleMesh {
            points: self.points.clone(),
            triangles: self.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
        }
    }

    /// Adds another mesh as separate components.
    pub fn append(&mut self, other: &TriangleMesh) {
        let base = self.points.len() as u32;
        self.points.extend_from_slice(&other.points);
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|v| v + base)));
    }

    /// Drops points that no triangle uses, keeping order.
    pub fn compacted(&self) -> Self {
        let mut used = vec![false; self.points.len()];
        self.triangles
            .iter()
            .flatten()
            .for_each(|&v| used[v as usize] = true);
        let mut new_id = vec![u32::MAX; self.points.len()];
        let mut points = Vec::new();
        for (v, &p) in self.points.iter().enumerate() {
            if used[v] {
                new_id[v] = points.len() as u32;
                points.push(p);
            }
        }
        let triangles = self
            .triangles
            .iter()
            .map(|t| t.map(|v| new_id[v as usize]))
            .collect();
        TriangleMesh { points, triangles }
    }

    /// Counts vertices, edges, borders, components and defects. O(n log n).
    pub fn topology(&self) -> MeshTopology {
        let mut half_edges: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            for (u, v) in [(a, b), (b, c), (c, a)] {
                half_edges.push((u.min(v), u.max(v), u < v));
            }
        }
        half_edges.sort_unstable();
        let mut components = Sets::new(self.points.len());
        let mut border = Sets::new(self.points.len());
        let mut on_border = vec![false; self.points.len()];
        let (mut edges, mut boundary_edges, mut nonmanifold_edges, mut oriented) = (0, 0, 0, true);
        for run in half_edges.chunk_by(|x, y| x.0 == y.0 && x.1 == y.1) {
            edges += 1;
            components.join(run[0].0, run[0].1);
            match run.len() {
                1 => {
                    boundary_edges += 1;
                    border.join(run[0].0, run[0].1);
                    on_border[run[0].0 as usize] = true;
                    on_border[run[0].1 as usize] = true;
                }
                2 => oriented &= run[0].2 != run[1].2,
                _ => nonmanifold_edges += 1,
            }
        }
        let mut used = vec![false; self.points.len()];
        self.triangles
            .iter()
            .flatten()
            .for_each(|&v| used[v as usize] = true);
        let vertices = used.iter().filter(|&&u| u).count();
        let roots = |sets: &mut Sets, member: &[bool]| {
            (0..member.len() as u32)
                .filter(|&v| member[v as usize] && sets.root(v) == v)
                .count()
        };
        MeshTopology {
            vertices,
            edges,
            triangles: self.triangles.len(),
            euler: vertices as i64 - edges as i64 + self.triangles.len() as i64,
            boundary_edges,
            boundary_loops: roots(&mut border, &on_border),
            nonmanifold_edges,
            nonmanifold_vertices: self.nonmanifold_vertices(),
            components: roots(&mut components, &used),
            oriented,
        }
    }

    /// Vertices around which the triangles, joined across shared edges, fall into several pieces.
    fn nonmanifold_vertices(&self) -> usize {
        // (vertex, far end of the shared edge, triangle corner): triangles meeting in an edge at v are joined.
        let mut spokes: Vec<(u32, u32, u32)> = Vec::with_capacity(6 * self.triangles.len());
        for (t, tri) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let corner = (3 * t + k) as u32;
                spokes.push((tri[k], tri[(k + 1) % 3], corner));
                spokes.push((tri[k], tri[(k + 2) % 3], corner));
            }
        }
        spokes.sort_unstable();
        let mut corners = Sets::new(3 * self.triangles.len());
        for pair in spokes.windows(2) {
            if pair[0].0 == pair[1].0 && pair[0].1 == pair[1].1 {
                corners.join(pair[0].2, pair[1].2);
            }
        }
        let mut fans = vec![0u32; self.points.len()];
        for (t, tri) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let corner = (3 * t + k) as u32;
                if corners.root(corner) == corner {
                    fans[tri[k] as usize] += 1;
                }
            }
        }
        fans.iter().filter(|&&f| f > 1).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    #[test]
    fn tetrahedron_has_the_numbers_of_a_tetrahedron() {
        let mesh = tetrahedron();
        assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
        assert!((mesh.area() - (1.5 + 0.75f64.sqrt())).abs() < 1e-15);
        assert!(mesh.solid_centroid().distance(DVec3::splat(0.25)) < 1e-15);
        let topology = mesh.topology();
        assert!(topology.is_closed_oriented_manifold());
        assert_eq!((topology.euler, topology.edges, topology.components), (2, 6, 1));
        assert!((mesh.flipped().volume() + mesh.volume()).abs() < 1e-15);
    }

    #[test]
    fn defects_are_counted() {
        let mut open = tetrahedron();
        open.triangles.pop();
        let t = open.topology();
        assert_eq!((t.boundary_edges, t.boundary_loops, t.euler), (3, 1, 1));
        // Two tetrahedra that share one vertex only: closed, but that vertex is pinched.
        let mut pinched = tetrahedron();
        let other = tetrahedron().mapped(|p| -p).flipped();
        pinched.append(&other);
        pinched
            .triangles
            .iter_mut()
            .flatten()
            .filter(|v| **v == 4)
            .for_each(|v| *v = 0);
        let t = pinched.compacted().topology();
        assert_eq!(
            (t.nonmanifold_vertices, t.boundary_edges, t.components),
            (1, 0, 1)
        );
        let mut badly_oriented = tetrahedron();
        badly_oriented.triangles[0] = [0, 1, 2];
        assert!(!badly_oriented.topology().oriented);
        let mut fin = tetrahedron();
        fin.points.push(DVec3::splat(5.0));
        fin.triangles.push([0, 1, 4]);
        assert_eq!(fin.topology().nonmanifold_edges, 1);
    }
}
