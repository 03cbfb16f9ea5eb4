//! Makes a marching-tetrahedra mesh even without changing its topology.
//!
//! Rounds of (after Botsch & Kobbelt, *A remeshing approach to multiresolution modeling*, 2004):
//! 1. **collapse** edges shorter than 0.8 of the target, shortest first, to their projected midpoint, when the link
//!    condition holds (Dey et al. 1999: topology is kept), no triangle turns by more than 60 degrees and no edge grows
//!    beyond 1.33 of the target;
//! 2. **flip** edges that are not Delaunay (opposite angles above 180 degrees) when the new edge does not exist yet and
//!    normals agree;
//! 3. **relax** each vertex towards the mean of its neighbours, in its tangent plane, and project it on the surface.
//!
//! Edges are visited in the total order (length, indices), so the result is deterministic. O(n log n) a round.

use super::field::Field;
use crate::mesh::TriangleMesh;
use glam::DVec3;
use rayon::prelude::*;

/// Settings of [`remesh`].
#[derive(Clone, Copy, Debug)]
pub struct RemeshSettings {
    /// Wanted edge length, mm.
    pub edge_length: f64,
    /// Rounds of collapse, flip and relax; five make the mean smallest angle 52 degrees on the bones.
    pub rounds: usize,
}

impl Default for RemeshSettings {
    fn default() -> Self {
        RemeshSettings {
            edge_length: 1.0,
            rounds: 5,
        }
    }
}

/// Edges below this share of the target are collapsed.
const SHORT: f64 = 0.8;
/// No collapse makes an edge longer than this share of the target.
const LONG: f64 = 1.33;

/// Evens out a closed mesh whose vertices lie on the surface of `field`.
pub fn remesh(mesh: &TriangleMesh, field: &Field, settings: &RemeshSettings) -> TriangleMesh {
    let mut work = Work::new(mesh);
    for round in 0..settings.rounds {
        // Collapses come in independent sets; early rounds have many.
        for _ in 0..if round == 0 { 8 } else { 3 } {
            if work.collapse_pass(field, settings.edge_length) == 0 {
                break;
            }
        }
        for _ in 0..3 {
            if work.flip_pass() == 0 {
                break;
            }
        }
        work.relax(field);
    }
    work.finish()
}

/// A mesh under change: dead triangles are marked, each vertex lists its triangles.
struct Work {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    around: Vec<Vec<u32>>,
}

/// An edge in visiting order.
struct Candidate {
    key: f64,
    ends: [u32; 2],
}

impl Work {
    fn new(mesh: &TriangleMesh) -> Self {
        let mut around = vec![Vec::with_capacity(8); mesh.points.len()];
        for (t, tri) in mesh.triangles.iter().enumerate() {
            tri.iter().for_each(|&v| around[v as usize].push(t as u32));
        }
        Work {
            points: mesh.points.clone(),
            triangles: mesh.triangles.clone(),
            alive: vec![true; mesh.triangles.len()],
            around,
        }
    }

    fn finish(self) -> TriangleMesh {
        let triangles = self
            .triangles
            .iter()
            .zip(&self.alive)
            .filter(|(_, a)| **a)
            .map(|(t, _)| *t)
            .collect();
        TriangleMesh {
            points: self.points,
            triangles,
        }
        .compacted()
    }

    /// Every edge once, with the lower index first, that `key` gives a number; sorted by that number.
    fn sorted_edges(&self, key: impl Fn(&Self, u32, u32) -> Option<f64>) -> Vec<Candidate> {
        let mut edges = Vec::new();
        for (tri, _) in self.triangles.iter().zip(&self.alive).filter(|(_, a)| **a) {
            for k in 0..3 {
                let (a, b) = (tri[k], tri[(k + 1) % 3]);
                if a < b
                    && let Some(key) = key(self, a, b)
                {
                    edges.push(Candidate { key, ends: [a, b] });
                }
            }
        }
        edges.sort_unstable_by(|x, y| x.key.total_cmp(&y.key).then(x.ends.cmp(&y.ends)));
        edges
    }

    fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut all: Vec<u32> = self.around[v as usize]
            .iter()
            .flat_map(|&t| self.triangles[t as usize])
            .filter(|&w| w != v)
            .collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    fn triangles_of_edge(&self, a: u32, b: u32) -> Vec<u32> {
        self.around[a as usize]
            .iter()
            .copied()
            .filter(|&t| self.triangles[t as usize].contains(&b))
            .collect()
    }

    fn collapse_pass(&mut self, field: &Field, target: f64) -> usize {
        let limit = SHORT * target;
        let edges = self.sorted_edges(|w, a, b| {
            let d = w.points[a as usize].distance(w.points[b as usize]);
            (d < limit).then_some(d)
        });
        let mut touched = vec![false; self.points.len()];
        let mut done = 0;
        for Candidate { ends: [a, b], .. } in edges {
            if touched[a as usize] || touched[b as usize] {
                continue;
            }
            let middle = field.project(0.5 * (self.points[a as usize] + self.points[b as usize]));
            if self.may_collapse(a, b, middle, LONG * target) {
                for v in self.neighbours(a).into_iter().chain(self.neighbours(b)) {
                    touched[v as usize] = true;
                }
                self.collapse(a, b, middle);
                done += 1;
            }
        }
        done
    }

    /// Link condition, normals and lengths of merging `b` into `a` at `place`.
    fn may_collapse(&self, a: u32, b: u32, place: DVec3, longest: f64) -> bool {
        let (near_a, near_b) = (self.neighbours(a), self.neighbours(b));
        let common = near_a.iter().filter(|v| near_b.binary_search(v).is_ok()).count();
        if common != 2 || near_a.len() + near_b.len() < 9 || near_a.len() + near_b.len() > 16 {
            return false;
        }
        let too_long = near_a
            .iter()
            .chain(&near_b)
            .any(|&v| v != a && v != b && self.points[v as usize].distance(place) > longest);
        if too_long {
            return false;
        }
        [(a, b), (b, a)].iter().all(|&(v, other)| {
            self.around[v as usize].iter().all(|&t| {
                let tri = self.triangles[t as usize];
                if tri.contains(&other) {
                    return true;
                }
                let old = self.normal(tri, |w| self.points[w as usize]);
                let new = self.normal(tri, |w| if w == v { place } else { self.points[w as usize] });
                new.dot(old) > 0.5 * new.length() * old.length()
            })
        })
    }

    fn normal(&self, tri: [u32; 3], place: impl Fn(u32) -> DVec3) -> DVec3 {
        let [a, b, c] = tri.map(place);
        (b - a).cross(c - a)
    }

    fn collapse(&mut self, a: u32, b: u32, place: DVec3) {
        for t in std::mem::take(&mut self.around[b as usize]) {
            if self.triangles[t as usize].contains(&a) {
                self.alive[t as usize] = false;
                for v in self.triangles[t as usize] {
                    self.around[v as usize].retain(|&s| s != t);
                }
            } else {
                self.triangles[t as usize]
                    .iter_mut()
                    .filter(|v| **v == b)
                    .for_each(|v| *v = a);
                self.around[a as usize].push(t);
            }
        }
        self.points[a as usize] = place;
    }

    fn flip_pass(&mut self) -> usize {
        let edges = self.sorted_edges(|w, a, b| {
            let excess = w.angle_excess(a, b)?;
            (excess > 1e-6).then_some(-excess)
        });
        let mut touched = vec![false; self.points.len()];
        let mut done = 0;
        for Candidate { ends: [a, b], .. } in edges {
            if touched[a as usize] || touched[b as usize] {
                continue;
            }
            if let Some([c, d]) = self.flip(a, b) {
                for v in [a, b, c, d] {
                    touched[v as usize] = true;
                }
                done += 1;
            }
        }
        done
    }

    /// The vertex of triangle `t` that is neither `a` nor `b`.
    fn apex(&self, t: u32, a: u32, b: u32) -> u32 {
        let tri = self.triangles[t as usize];
        tri.into_iter()
            .find(|&v| v != a && v != b)
            .expect("a triangle has a third vertex")
    }

    /// Sum of the two angles opposite to an edge, less 180 degrees [rad].
    fn angle_excess(&self, a: u32, b: u32) -> Option<f64> {
        let both = self.triangles_of_edge(a, b);
        let &[s, t] = both.as_slice() else { return None };
        let angle = |apex: u32| {
            let p = self.points[apex as usize];
            (self.points[a as usize] - p).angle_between(self.points[b as usize] - p)
        };
        Some(angle(self.apex(s, a, b)) + angle(self.apex(t, a, b)) - std::f64::consts::PI)
    }

    fn flip(&mut self, a: u32, b: u32) -> Option<[u32; 2]> {
        let both = self.triangles_of_edge(a, b);
        let &[s, t] = both.as_slice() else { return None };
        // s runs a -> b, t runs b -> a.
        let runs = |t: u32, u: u32, v: u32| {
            let tri = self.triangles[t as usize];
            (0..3).any(|k| tri[k] == u && tri[(k + 1) % 3] == v)
        };
        let (s, t) = if runs(s, a, b) { (s, t) } else { (t, s) };
        let (c, d) = (self.apex(s, a, b), self.apex(t, a, b));
        let exists = c == d || !self.triangles_of_edge(c, d).is_empty();
        if exists || self.around[a as usize].len() <= 4 || self.around[b as usize].len() <= 4 {
            return None;
        }
        let at = |v: u32| self.points[v as usize];
        let (new_s, new_t) = ([a, d, c], [b, c, d]);
        let old = self.normal(self.triangles[s as usize], at) + self.normal(self.triangles[t as usize], at);
        for tri in [new_s, new_t] {
            let n = self.normal(tri, at);
            if n.dot(old) < 0.8 * n.length() * old.length() {
                return None;
            }
        }
        self.triangles[s as usize] = new_s;
        self.triangles[t as usize] = new_t;
        self.around[b as usize].retain(|&x| x != s);
        self.around[a as usize].retain(|&x| x != t);
        self.around[c as usize].push(t);
        self.around[d as usize].push(s);
        Some([c, d])
    }

    fn relax(&mut self, field: &Field) {
        let moved: Vec<DVec3> = (0..self.points.len() as u32)
            .into_par_iter()
            .map(|v| {
                let p = self.points[v as usize];
                let ring = self.neighbours(v);
                if ring.is_empty() {
                    return p;
                }
                let mean = ring.iter().map(|&w| self.points[w as usize]).sum::<DVec3>() / ring.len() as f64;
                let sample = field.sample(p);
                let n = sample.gradient.normalize_or_zero();
                let step = mean - p;
                let q = field.project(p + 0.7 * (step - n * step.dot(n)));
                // Near a crease the projection may land on the other side of it; stay then.
                if q.distance(p) > 1.5 * step.length() || field.value(q).abs() > 1e-9 {
                    p
                } else {
                    q
                }
            })
            .collect();
        self.points = moved;
    }
}
