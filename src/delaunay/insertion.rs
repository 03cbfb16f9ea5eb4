//! Incremental insertion: one point at a time, the tetrahedra whose spheres hold it are replaced by a star.
//!
//! In: normalised distinct points in insertion order that span space. Out: tetrahedra, neighbours and ghosts, numbered as
//! they happened to arise. Steps for each point (Bowyer 1981; Watson 1981; ghosts after Shewchuk's lecture notes):
//! 1. **Walk** from the last tetrahedron across any facet that separates it from the point (visibility walk that never turns
//!    back; it ends because a perturbed Delaunay triangulation is regular).
//! 2. **Cavity**: breadth-first over tetrahedra in conflict. A finite one conflicts when the point lies in its sphere, ties
//!    broken by coordinates; a ghost when the point lies beyond its hull triangle, or in its plane and in the sphere of the
//!    finite tetrahedron behind it.
//! 3. **Star**: one new tetrahedron a boundary facet, linked to its siblings through a table indexed by the two local
//!    vertex numbers of an edge.
//!
//! Cost: expected `O(n)` after sorting for points spread evenly or on surfaces; `O(n^2)` tetrahedra in the worst case.

use crate::geometry::predicates::{insphere_perturbed, orient3d};
use glam::DVec3;

/// The vertex at infinity while building.
pub(super) const INF: u32 = u32::MAX;

/// Vertex places of facet `i`, counter-clockwise seen from outside.
const FACET: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Cavities of more vertices than this are linked by sorting their edges instead of by the table.
const TABLE: usize = 64;

/// A facet between the cavity and the rest.
#[derive(Clone, Copy)]
struct Boundary {
    /// Its vertices, counter-clockwise seen from outside the cavity; the infinite one last.
    vertices: [u32; 3],
    /// The facet as seen from outside, packed.
    outside: u32,
}

/// The triangulation under construction.
pub(super) struct Builder<'a> {
    points: &'a [DVec3],
    pub(super) vertices: Vec<[u32; 4]>,
    pub(super) neighbours: Vec<[u32; 4]>,
    /// Last round a tetrahedron was tested in: `2 * round + conflict`.
    stamps: Vec<u32>,
    round: u32,
    /// Slots of deleted tetrahedra.
    pub(super) free: Vec<u32>,
    last: u32,
    cavity: Vec<u32>,
    boundary: Vec<Boundary>,
    star: Vec<u32>,
    /// Local number of a vertex, valid when `local[slot[v]] == v`.
    slot: Vec<u8>,
    local: Vec<u32>,
    table: Vec<u32>,
}

impl<'a> Builder<'a> {
    /// Starts with the tetrahedron of four points, which must be positively oriented.
    pub(super) fn new(points: &'a [DVec3], first: [u32; 4]) -> Self {
        let mut builder = Self {
            points,
            vertices: Vec::new(),
            neighbours: Vec::new(),
            stamps: Vec::new(),
            round: 0,
            free: Vec::new(),
            last: 0,
            cavity: Vec::new(),
            boundary: Vec::new(),
            star: Vec::new(),
            slot: vec![0; points.len()],
            local: Vec::new(),
            table: vec![0; TABLE * TABLE],
        };
        builder.vertices.push(first);
        for facet in FACET {
            let [a, b, c] = facet.map(|k| first[k]);
            builder.vertices.push([a, b, c, INF]);
        }
        builder.stamps = vec![0; 5];
        builder.neighbours = vec![[0; 4]; 5];
        let mut sides = Vec::new();
        for (t, v) in builder.vertices.iter().enumerate() {
            for (k, facet) in FACET.iter().enumerate() {
                let mut key = facet.map(|p| v[p]);
                key.sort_unstable();
                sides.push((key, 4 * t as u32 + k as u32));
            }
        }
        sides.sort_unstable();
        for pair in sides.chunks(2) {
            builder.link(pair[0].1, pair[1].1);
        }
        builder
    }

    #[inline]
    fn link(&mut self, a: u32, b: u32) {
        self.neighbours[(a >> 2) as usize][(a & 3) as usize] = b;
        self.neighbours[(b >> 2) as usize][(b & 3) as usize] = a;
    }

    #[inline]
    fn point(&self, v: u32) -> DVec3 {
        self.points[v as usize]
    }

    /// Inserts a point that is not yet a vertex.
    pub(super) fn insert(&mut self, v: u32) {
        let p = self.point(v);
        let start = self.locate(p);
        self.find_cavity(start, p);
        self.fill(v);
    }

    /// A tetrahedron that holds the point, or a ghost whose hull triangle it lies beyond.
    fn locate(&self, p: DVec3) -> u32 {
        let mut tet = self.last;
        if self.vertices[tet as usize][3] == INF {
            tet = self.neighbours[tet as usize][3] >> 2;
        }
        let mut from = 4;
        'walk: loop {
            let v = self.vertices[tet as usize];
            if v[3] == INF {
                return tet;
            }
            let corners = v.map(|i| self.point(i));
            for k in 0..4 {
                if k == from {
                    continue;
                }
                let [a, b, c] = FACET[k].map(|i| corners[i]);
                if orient3d(a, b, c, p) > 0.0 {
                    let next = self.neighbours[tet as usize][k];
                    tet = next >> 2;
                    from = (next & 3) as usize;
                    continue 'walk;
                }
            }
            return tet;
        }
    }

    fn in_conflict(&self, tet: u32, p: DVec3) -> bool {
        let v = self.vertices[tet as usize];
        let [a, b, c] = [v[0], v[1], v[2]].map(|i| self.point(i));
        if v[3] != INF {
            return insphere_perturbed(a, b, c, self.point(v[3]), p) > 0.0;
        }
        let side = orient3d(a, b, c, p);
        side > 0.0 || (side == 0.0 && self.in_conflict(self.neighbours[tet as usize][3] >> 2, p))
    }

    /// Collects the tetrahedra in conflict with `p` and the facets around them.
    fn find_cavity(&mut self, start: u32, p: DVec3) {
        self.round += 1;
        let (outside, inside) = (2 * self.round, 2 * self.round + 1);
        self.cavity.clear();
        self.boundary.clear();
        self.cavity.push(start);
        self.stamps[start as usize] = inside;
        let mut next = 0;
        while next < self.cavity.len() {
            let tet = self.cavity[next] as usize;
            next += 1;
            for k in 0..4 {
                let across = self.neighbours[tet][k];
                let other = across >> 2;
                let stamp = self.stamps[other as usize];
                if stamp == inside {
                    continue;
                }
                if stamp != outside && self.in_conflict(other, p) {
                    self.stamps[other as usize] = inside;
                    self.cavity.push(other);
                } else {
                    self.stamps[other as usize] = outside;
                    let v = self.vertices[tet];
                    let vertices = infinite_last(FACET[k].map(|i| v[i]));
                    self.boundary.push(Boundary {
                        vertices,
                        outside: across,
                    });
                }
            }
        }
    }

    /// Replaces the cavity by the star of `v`.
    fn fill(&mut self, v: u32) {
        self.free.append(&mut self.cavity);
        self.star.clear();
        for i in 0..self.boundary.len() {
            let Boundary { vertices, outside } = self.boundary[i];
            let [a, b, c] = vertices;
            let tet = match self.free.pop() {
                Some(tet) => {
                    self.vertices[tet as usize] = [v, a, b, c];
                    tet
                }
                None => {
                    self.vertices.push([v, a, b, c]);
                    self.neighbours.push([0; 4]);
                    self.stamps.push(0);
                    (self.vertices.len() - 1) as u32
                }
            };
            self.star.push(tet);
            self.link(4 * tet, outside);
        }
        self.last = self.star[0];
        if !self.link_by_table() {
            self.link_by_sorting();
        }
    }

    /// Links the star's tetrahedra through the edges they share; `false` when there are too many vertices.
    fn link_by_table(&mut self) -> bool {
        self.local.clear();
        self.local.push(INF);
        for i in 0..self.star.len() {
            let tet = self.star[i];
            let mut places = [0; 3];
            for (place, v) in places.iter_mut().zip(self.boundary[i].vertices) {
                if v == INF {
                    continue;
                }
                let s = self.slot[v as usize] as usize;
                *place = if self.local.get(s) == Some(&v) {
                    s
                } else if self.local.len() == TABLE {
                    return false;
                } else {
                    self.slot[v as usize] = self.local.len() as u8;
                    self.local.push(v);
                    self.local.len() - 1
                };
            }
            let [a, b, c] = places;
            self.table[a * TABLE + b] = 4 * tet + 3;
            self.table[b * TABLE + c] = 4 * tet + 1;
            self.table[c * TABLE + a] = 4 * tet + 2;
            self.boundary[i].vertices = places.map(|p| p as u32);
        }
        for i in 0..self.star.len() {
            let tet = self.star[i] as usize;
            let [a, b, c] = self.boundary[i].vertices.map(|p| p as usize);
            self.neighbours[tet][1] = self.table[c * TABLE + b];
            self.neighbours[tet][2] = self.table[a * TABLE + c];
            self.neighbours[tet][3] = self.table[b * TABLE + a];
        }
        true
    }

    fn link_by_sorting(&mut self) {
        let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * self.star.len());
        for &tet in &self.star {
            let [_, a, b, c] = self.vertices[tet as usize];
            for (x, y, k) in [(b, c, 1), (c, a, 2), (a, b, 3)] {
                edges.push(([x.min(y), x.max(y)], 4 * tet + k));
            }
        }
        edges.sort_unstable();
        for pair in edges.chunks(2) {
            debug_assert_eq!(pair[0].0, pair[1].0);
            self.link(pair[0].1, pair[1].1);
        }
    }
}

/// Rotates a facet so that the infinite vertex, if it is one of the three, comes last.
#[inline]
fn infinite_last([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a == INF {
        [b, c, a]
    } else if b == INF {
        [c, a, b]
    } else {
        [a, b, c]
    }
}
