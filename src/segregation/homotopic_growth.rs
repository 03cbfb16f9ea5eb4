//! Growing a set of tetrahedra without changing its topology.
//!
//! In: the triangulation (topology only), where to start, where the set may grow, and a depth for every tetrahedron. Out: the
//! grown set, deepest first, and what it could not take.
//!
//! A tetrahedron is added only when it meets the set in a disk: in one facet whose opposite vertex the set does not touch,
//! in two whose opposite edge it does not touch, or in three. The set is then homeomorphic to what it was before (an
//! elementary expansion in each case), so what grows from one tetrahedron is a ball.
//!
//! What is left over stands where the fronts of the set meet: one wall across every handle of the place it grew in, at
//! the handle's narrowest, as everything deeper was taken before. The depth of the deepest tetrahedron of a wall is the depth
//! of that narrow place: what cutting the handle there costs. A wall may also stand in a ball (not every ball can be
//! built in every order), so who cuts along a wall has to look whether a handle went.
//!
//! Cost `O(n log n)` and a walk round an edge for every tetrahedron that meets the set in two facets. Same thinning by
//! simple cells as in digital topology (Bertrand & Malandain, Pattern Recognition Letters 15, 1994), on tetrahedra.

use crate::delaunay::{Facet, INFINITE, Triangulation};
use crate::geometry::mesh::DisjointSets;
use crate::geometry::{TetId, VertexId};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A tetrahedron waiting; the deepest first, of equal ones that of smaller id.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Waiting {
    depth: f64,
    tet: TetId,
}

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.depth
            .total_cmp(&other.depth)
            .then_with(|| other.tet.cmp(&self.tet))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// A set of tetrahedra and how many of them each vertex has.
struct Region<'a> {
    triangulation: &'a Triangulation,
    has: Vec<bool>,
    /// By vertex, the one at infinity last.
    touched: Vec<u32>,
}

impl<'a> Region<'a> {
    fn new(triangulation: &'a Triangulation) -> Self {
        Self {
            triangulation,
            has: vec![false; triangulation.num_tets()],
            touched: vec![0; triangulation.points.len() + 1],
        }
    }

    fn slot(&self, vertex: VertexId) -> usize {
        if vertex == INFINITE {
            self.touched.len() - 1
        } else {
            vertex.index()
        }
    }

    fn add(&mut self, tet: TetId) {
        self.has[tet.index()] = true;
        for vertex in self.triangulation.tet(tet) {
            let slot = self.slot(vertex);
            self.touched[slot] += 1;
        }
    }

    fn touches(&self, vertex: VertexId) -> bool {
        self.touched[self.slot(vertex)] > 0
    }

    /// Whether any tetrahedron round the edge between two places of `tet` is in the set.
    fn touches_edge(&self, tet: TetId, [i, j]: [usize; 2]) -> bool {
        let ends = [i, j].map(|k| self.triangulation.tet(tet)[k]);
        let Some(first) = (0..4).find(|&k| k != i && k != j) else {
            return false;
        };
        let (mut at, mut crossed) = (tet, first);
        loop {
            if self.has[at.index()] {
                return true;
            }
            let entered = self.triangulation.mirror(Facet {
                tet: at,
                index: crossed as u8,
            });
            at = entered.tet;
            if at == tet {
                return false;
            }
            // Out again through the facet that holds the edge and is not the one come in by.
            let corners = self.triangulation.tet(at);
            match (0..4).find(|&k| k != entered.index as usize && !ends.contains(&corners[k])) {
                Some(next) => crossed = next,
                None => return false,
            }
        }
    }

    /// Whether adding a tetrahedron leaves the topology of the set as it is.
    fn is_simple(&self, tet: TetId) -> bool {
        let held = [0, 1, 2, 3].map(|k| self.has[self.triangulation.neighbour(tet, k).index()]);
        match held.iter().filter(|h| **h).count() {
            // The facet opposite place k is in the set: is the vertex there too?
            1 => (0..4)
                .filter(|&k| held[k])
                .all(|k| !self.touches(self.triangulation.tet(tet)[k])),
            // The two facets share the edge of the places that are not theirs; the edge opposite joins their own places.
            2 => {
                let mut own = (0..4).filter(|&k| held[k]);
                match (own.next(), own.next()) {
                    (Some(i), Some(j)) => !self.touches_edge(tet, [i, j]),
                    _ => false,
                }
            }
            3 => true,
            _ => false,
        }
    }
}

/// Grows the set `from` inside `within`, deepest first; see the module. Returns the set, `from` included.
pub(super) fn grow(
    triangulation: &Triangulation,
    from: &[TetId],
    within: impl Fn(TetId) -> bool,
    depth: impl Fn(TetId) -> f64,
) -> Vec<bool> {
    let mut region = Region::new(triangulation);
    for &tet in from {
        region.add(tet);
    }
    let mut queue = BinaryHeap::new();
    let wait = |region: &Region, tet: TetId, queue: &mut BinaryHeap<Waiting>| {
        for index in 0..4 {
            let next = triangulation.neighbour(tet, index);
            if !region.has[next.index()] && within(next) {
                queue.push(Waiting {
                    depth: depth(next),
                    tet: next,
                });
            }
        }
    };
    for &tet in from {
        wait(&region, tet, &mut queue);
    }
    while let Some(Waiting { tet, .. }) = queue.pop() {
        // One that is not simple now is asked again when a neighbour joins.
        if region.has[tet.index()] || !region.is_simple(tet) {
            continue;
        }
        region.add(tet);
        wait(&region, tet, &mut queue);
    }
    region.has
}

/// The tetrahedra of `within` that `grown` lacks, in sets that share a vertex, each in order, the sets by their first.
pub(super) fn walls(
    triangulation: &Triangulation,
    grown: &[bool],
    within: impl Fn(TetId) -> bool,
) -> Vec<Vec<TetId>> {
    let left: Vec<TetId> = triangulation
        .finite_tets()
        .filter(|&t| within(t) && !grown[t.index()])
        .collect();
    let mut sets = DisjointSets::new(triangulation.points.len());
    for &tet in &left {
        let [a, b, c, d] = triangulation.tet(tet);
        for other in [b, c, d] {
            sets.union(a.0, other.0);
        }
    }
    let mut of: Vec<(u32, TetId)> = left
        .into_iter()
        .map(|tet| (sets.find(triangulation.tet(tet)[0].0), tet))
        .collect();
    of.sort_unstable();
    let mut out: Vec<Vec<TetId>> = of
        .chunk_by(|a, b| a.0 == b.0)
        .map(|run| run.iter().map(|x| x.1).collect())
        .collect();
    out.sort_unstable();
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delaunay::{DelaunaySettings, delaunay};
    use crate::geometry::MeshTopology;
    use crate::segregation::balls::Balls;
    use crate::segregation::labels::{boundary_triangles, mesh_of};
    use glam::DVec3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::TAU;

    const MAJOR: f64 = 1.0;
    const MINOR: f64 = 0.35;

    struct Labelled {
        triangulation: Triangulation,
        inside: Vec<bool>,
        depth: Vec<f64>,
    }

    /// Points on a torus, and labels by the exact torus at the circumcentres.
    fn torus(n: usize, seed: u64) -> Labelled {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let points: Vec<DVec3> = (0..n)
            .map(|_| {
                let [u, v] = [TAU * rng.random::<f64>(), TAU * rng.random::<f64>()];
                let r = MAJOR + MINOR * v.cos();
                DVec3::new(r * u.cos(), r * u.sin(), MINOR * v.sin())
            })
            .collect();
        let level = |p: DVec3| MINOR - ((p.x.hypot(p.y) - MAJOR).hypot(p.z));
        let triangulation = delaunay(&points, &DelaunaySettings::default()).expect("points in space");
        let balls = Balls::new(&triangulation);
        let mut inside: Vec<bool> = balls.centres.iter().map(|&c| level(c) > 0.0).collect();
        inside.resize(triangulation.num_tets(), false);
        let depth = (0..triangulation.num_tets())
            .map(|t| {
                let tet = TetId(t as u32);
                if triangulation.is_finite(tet) {
                    level(triangulation.corners(tet).iter().sum::<DVec3>() / 4.0).abs()
                } else {
                    f64::INFINITY
                }
            })
            .collect();
        Labelled {
            triangulation,
            inside,
            depth,
        }
    }

    fn boundary(triangulation: &Triangulation, set: &[bool]) -> MeshTopology {
        mesh_of(triangulation, &boundary_triangles(triangulation, set)).topology()
    }

    fn is_sphere(topology: &MeshTopology) -> bool {
        topology.euler == 2
            && topology.components == 1
            && topology.nonmanifold_edges == 0
            && topology.nonmanifold_vertices == 0
    }

    #[test]
    fn a_solid_torus_grows_to_a_ball_and_a_wall_across_it() {
        for seed in 0..4 {
            let torus = torus(3000, seed);
            let t = &torus.triangulation;
            assert_eq!(boundary(t, &torus.inside).euler, 0);
            let within = |tet: TetId| torus.inside[tet.index()];
            let deepest = t
                .finite_tets()
                .filter(|&tet| within(tet))
                .max_by(|a, b| torus.depth[a.index()].total_cmp(&torus.depth[b.index()]))
                .expect("a torus has an inside");
            let grown = grow(t, &[deepest], within, |tet| torus.depth[tet.index()]);
            assert!(is_sphere(&boundary(t, &grown)), "{:?}", boundary(t, &grown));
            let walls = walls(t, &grown, within);
            // The wall goes through the whole section: its deepest tetrahedron is at the axis.
            let thickest = walls
                .iter()
                .map(|w| w.iter().map(|x| torus.depth[x.index()]).fold(0.0, f64::max))
                .fold(0.0, f64::max);
            assert!(thickest > 0.5 * MINOR, "{thickest}");
            let left: usize = walls.iter().map(Vec::len).sum();
            let all = torus.inside.iter().filter(|i| **i).count();
            assert!(left < all / 10, "{left} of {all} left");
        }
    }

    #[test]
    fn the_outside_of_a_torus_grows_from_infinity_up_to_a_wall_in_its_hole() {
        let torus = torus(3000, 9);
        let t = &torus.triangulation;
        let ghosts: Vec<TetId> = t.tets().skip(t.num_finite()).collect();
        let within = |tet: TetId| t.is_finite(tet) && !torus.inside[tet.index()];
        let grown = grow(t, &ghosts, within, |tet| torus.depth[tet.index()]);
        let rest: Vec<bool> = grown.iter().map(|g| !g).collect();
        assert!(is_sphere(&boundary(t, &rest)), "{:?}", boundary(t, &rest));
    }
}
