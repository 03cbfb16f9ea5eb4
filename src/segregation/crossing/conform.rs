//! Triangles made facets: points are added until every triangle of a surface is a facet of the triangulation of its points.
//!
//! In: points and triangles. Out: more of both, the triangulation, and how many triangles are still no facets.
//!
//! 1. Triangulate; find the triangles that are no facets.
//! 2. An edge between two of them that is no Delaunay edge is flipped where its counterpart is one and the fold is small.
//! 3. Other edges that are no Delaunay edges are halved; of a triangle whose edges all are, the longest is. Every triangle at a halved
//!    edge is cut with it, so that nothing opens; edges of a crossing stay edges of a crossing.
//! 4. Again, until all are facets or the edges are short; the round with the fewest that are none is taken.
//!
//! The surface stays where it is up to the folds that are flipped: points are added on its triangles only. Halving edges until all
//! are there is the oldest way to a conforming triangulation (Shewchuk 2002, constrained Delaunay tetrahedralizations and provably good
//! boundary recovery); its proof needs wide angles between sheets, hence the limits.

use super::{edges, sorted};
use crate::delaunay::{DelaunayError, DelaunaySettings, Triangulation, delaunay};
use crate::segregation::prepare::compare;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// Most rounds.
const ROUNDS: usize = 10;
/// Passes of flips a round.
const PASSES: usize = 8;
/// Edges shorter than this share of the spacing are not halved.
const SHORT: f64 = 0.15;
/// Least cosine between the triangles of an edge that is flipped.
const FLAT: f64 = 0.85;

/// A surface and the triangulation of its points.
#[derive(Clone, Debug, Default)]
pub(super) struct Conforming {
    pub triangulation: Triangulation,
    /// Over the triangulation's points.
    pub triangles: Vec<[u32; 3]>,
    /// For every point of the triangulation the point given, or the nearer end of the edge it was added on.
    pub origin: Vec<u32>,
    /// Edges of crossings with their line, over the triangulation's points.
    pub line_edges: BTreeMap<(u32, u32), u32>,
    pub added: usize,
    pub loose: usize,
}

#[derive(Clone)]
struct Surface {
    points: Vec<DVec3>,
    origin: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    line_edges: BTreeMap<(u32, u32), u32>,
}

/// One triangulation of a surface's points.
struct Round {
    triangulation: Triangulation,
    /// Place in the triangulation of every point.
    place: Vec<u32>,
    facets: HashSet<[u32; 3]>,
    edges: HashSet<(u32, u32)>,
}

impl Round {
    fn has_edge(&self, (a, b): (u32, u32)) -> bool {
        self.edges
            .contains(&pair(self.place[a as usize], self.place[b as usize]))
    }

    fn missing(&self, surface: &Surface) -> Vec<usize> {
        let there = |t: [u32; 3]| self.facets.contains(&sorted(t.map(|v| self.place[v as usize])));
        (0..surface.triangles.len())
            .filter(|&i| !there(surface.triangles[i]))
            .collect()
    }
}

/// Adds points until all triangles are facets; see the module. Coincident points become one.
pub(super) fn conform(
    points: Vec<DVec3>,
    used: &[bool],
    triangles: Vec<[u32; 3]>,
    line_edges: BTreeMap<(u32, u32), u32>,
    spacing_mm: f64,
) -> Result<Conforming, DelaunayError> {
    let given = points.len();
    let mut surface = Surface {
        origin: (0..given as u32).collect(),
        points,
        triangles,
        line_edges,
    };
    let mut best: Option<(usize, Surface, Round)> = None;
    for _ in 0..ROUNDS {
        let round = surface.triangulate(used)?;
        surface.flip(&round);
        let missing = round.missing(&surface);
        let mut next = surface.clone();
        let halves = next.edges_to_halve(&round, &missing, SHORT * spacing_mm);
        next.halve(&halves);
        if best.as_ref().is_none_or(|(least, ..)| missing.len() < *least) {
            best = Some((missing.len(), surface, round));
        }
        if halves.is_empty() {
            break;
        }
        surface = next;
    }
    let (
        loose,
        surface,
        Round {
            triangulation, place, ..
        },
    ) = best.expect("there was a round");
    let mut origin = vec![0; triangulation.points.len()];
    for (v, &at) in place.iter().enumerate().rev().filter(|(_, at)| **at != u32::MAX) {
        origin[at as usize] = surface.origin[v];
    }
    Ok(Conforming {
        triangles: surface
            .triangles
            .iter()
            .map(|t| t.map(|v| place[v as usize]))
            .collect(),
        line_edges: surface
            .line_edges
            .iter()
            .map(|(&(a, b), &l)| (pair(place[a as usize], place[b as usize]), l))
            .collect(),
        added: surface.points.len() - given,
        loose,
        triangulation,
        origin,
    })
}

fn pair(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

impl Surface {
    fn triangulate(&self, used: &[bool]) -> Result<Round, DelaunayError> {
        let mut order: Vec<u32> = (0..self.points.len() as u32)
            .filter(|&v| used.get(v as usize).copied().unwrap_or(true))
            .collect();
        order.sort_unstable_by(|&a, &b| {
            compare(self.points[a as usize], self.points[b as usize]).then(a.cmp(&b))
        });
        let mut place = vec![u32::MAX; self.points.len()];
        let mut points: Vec<DVec3> = Vec::new();
        for &v in &order {
            if points.last() != Some(&self.points[v as usize]) {
                points.push(self.points[v as usize]);
            }
            place[v as usize] = points.len() as u32 - 1;
        }
        let triangulation = delaunay(&points, &DelaunaySettings::default())?;
        let facets = triangulation
            .facets()
            .map(|f| sorted(triangulation.facet_vertices(f).map(|v| v.0)))
            .collect();
        let mut all = HashSet::new();
        for tet in triangulation.finite_tets() {
            let v = triangulation.tet(tet).map(|v| v.0);
            all.extend([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| pair(v[i], v[j])));
        }
        Ok(Round {
            triangulation,
            place,
            facets,
            edges: all,
        })
    }

    /// Step 2.
    fn flip(&mut self, round: &Round) {
        for _ in 0..PASSES {
            let missing = round.missing(self);
            let near: HashSet<u32> = missing.iter().flat_map(|&i| self.triangles[i]).collect();
            let mut sides: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
            for (i, t) in self.triangles.iter().enumerate() {
                for e in edges(*t) {
                    if near.contains(&e.0) && near.contains(&e.1) {
                        sides.entry(e).or_default().push(i);
                    }
                }
            }
            let mut touched = HashSet::new();
            for (&(a, b), both) in &sides {
                let &[i, j] = both.as_slice() else { continue };
                if round.has_edge((a, b)) || touched.contains(&i) || touched.contains(&j) {
                    continue;
                }
                let third = |i: usize| self.triangles[i].into_iter().find(|&v| v != a && v != b);
                let (Some(c), Some(d)) = (third(i), third(j)) else {
                    continue;
                };
                if c == d
                    || !round.has_edge((c, d))
                    || sides.contains_key(&pair(c, d))
                    || !self.convex(a, b, c, d)
                {
                    continue;
                }
                touched.extend([i, j]);
                self.triangles[i] = [c, d, b];
                self.triangles[j] = [d, c, a];
            }
            if touched.is_empty() {
                break;
            }
        }
    }

    /// Whether the triangles `a b c` and `a b d` are nearly one plane and can be cut the other way.
    fn convex(&self, a: u32, b: u32, c: u32, d: u32) -> bool {
        let [pa, pb, pc, pd] = [a, b, c, d].map(|v| self.points[v as usize]);
        let normal = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).normalize_or_zero();
        let n = normal(pa, pb, pc);
        n.dot(normal(pb, pa, pd)) >= FLAT
            && n.dot(normal(pc, pd, pb)).abs() >= FLAT
            && normal(pc, pd, pb).dot(normal(pd, pc, pa)) >= FLAT
    }

    /// Step 3: edges of triangles that are no facets, unless they are short.
    fn edges_to_halve(&self, round: &Round, missing: &[usize], short_mm: f64) -> BTreeSet<(u32, u32)> {
        let length = |e: &(u32, u32)| self.points[e.0 as usize].distance(self.points[e.1 as usize]);
        let mut out = BTreeSet::new();
        for &i in missing {
            let all = edges(self.triangles[i]);
            let absent: Vec<(u32, u32)> = all.into_iter().filter(|&e| !round.has_edge(e)).collect();
            if absent.is_empty() {
                out.extend(all.into_iter().max_by(|a, b| length(a).total_cmp(&length(b))));
            } else {
                out.extend(absent);
            }
        }
        out.retain(|e| length(e) > short_mm);
        out
    }

    /// Halves edges and cuts the triangles at them.
    fn halve(&mut self, halves: &BTreeSet<(u32, u32)>) {
        let mut middle: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for &(a, b) in halves {
            let m = self.points.len() as u32;
            self.points
                .push(0.5 * (self.points[a as usize] + self.points[b as usize]));
            self.origin.push(self.origin[a as usize]);
            middle.insert((a, b), m);
            if let Some(line) = self.line_edges.remove(&(a, b)) {
                self.line_edges.insert(pair(a, m), line);
                self.line_edges.insert(pair(b, m), line);
            }
        }
        let triangles = std::mem::take(&mut self.triangles);
        for t in triangles {
            self.cut(t, &middle);
        }
    }

    /// One triangle, cut where its edges are halved; turned so that the number of halved edges decides the pattern.
    fn cut(&mut self, [a, b, c]: [u32; 3], middle: &BTreeMap<(u32, u32), u32>) {
        let at = |i: u32, j: u32| middle.get(&pair(i, j)).copied();
        match (at(a, b), at(b, c), at(c, a)) {
            (None, None, None) => self.triangles.push([a, b, c]),
            (Some(m), None, None) => self.triangles.extend([[a, m, c], [m, b, c]]),
            (None, Some(m), None) => self.triangles.extend([[b, m, a], [m, c, a]]),
            (None, None, Some(m)) => self.triangles.extend([[c, m, b], [m, a, b]]),
            (Some(m), Some(n), None) => self.two(a, b, c, m, n),
            (None, Some(m), Some(n)) => self.two(b, c, a, m, n),
            (Some(n), None, Some(m)) => self.two(c, a, b, m, n),
            (Some(l), Some(m), Some(n)) => {
                self.triangles
                    .extend([[a, l, n], [b, m, l], [c, n, m], [l, m, n]]);
            }
        }
    }

    /// `a b` halved at `m`, `b c` at `n`; the quadrangle left is cut along its shorter diagonal.
    fn two(&mut self, a: u32, b: u32, c: u32, m: u32, n: u32) {
        let d = |i: u32, j: u32| self.points[i as usize].distance_squared(self.points[j as usize]);
        let rest = if d(a, n) <= d(m, c) {
            [[a, m, n], [a, n, c]]
        } else {
            [[a, m, c], [m, n, c]]
        };
        self.triangles.push([m, b, n]);
        self.triangles.extend(rest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles that cut through each other but for a common edge of a flat lattice are no facets at first.
    #[test]
    fn triangles_between_near_sheets_become_facets() {
        // A large triangle, and a row of points close over its middle that part its corners.
        let mut points = vec![DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(2.0, 4.0, 0.0)];
        points.extend((0..5).map(|i| DVec3::new(1.2 + 0.4 * f64::from(i), 1.5, 0.3)));
        points.push(DVec3::new(2.0, 1.5, -2.0));
        let used = vec![true; points.len()];
        let found =
            conform(points, &used, vec![[0, 1, 2]], BTreeMap::new(), 1.0).expect("points that span space");
        assert!(found.added > 0);
        assert_eq!(found.loose, 0);
        let mesh = crate::geometry::TriangleMesh {
            points: found.triangulation.points.clone(),
            triangles: found.triangles.clone(),
        };
        assert!((mesh.area() - 8.0).abs() < 1e-12);
        let t = mesh.topology();
        assert_eq!((t.euler, t.nonmanifold_edges, t.components), (1, 0, 1));
    }
}
