//! The last tetrahedra that stand between a segregation and the known surface's topology.
//!
//! In: labels by a known surface that are not a manifold with its components and Euler numbers, whatever the sampling. Out:
//! labels that are, and how far the surface had to move for it; or at least labels whose surface is a manifold.
//!
//! Finer sampling does not end where two parts of a surface meet at a small angle (the edge of a blade: the solid is thinner
//! than the spacing at every spacing) or nearly touch. The labels by circumcentres are then wrong in tetrahedra that are small or
//! flat, so it costs next to nothing to change them. The price of a tetrahedron is the distance of its centroid from the
//! surface: how far the surface moves when its label does.
//!
//! 1. **Openings.** Cavities that the surface does not have (a pocket whose channel the sampling closes) are opened to the outside along the
//!    way whose dearest tetrahedron is cheapest; of several cavities those with the deepest tetrahedra may stay.
//! 2. **Deepest first.** From the deepest tetrahedron of each solid part the inside is grown without a change of topology
//!    ([`super::homotopic_growth`]). What is left are walls: one across every handle at its narrowest, one in a tube from every cavity
//!    to the outside, and some where the order of growth was unlucky. They are put back, dearest first, where the topology
//!    comes no farther from the surface's: real handles are the thickest.
//! 3. **Beyond.** The growth goes on into the outside, cheapest first, up to [`MOST_MOVED`] spacings, and so reaches pieces of
//!    the inside that hang together with the rest by less than the labels show.
//! 4. **Back.** What should be outside is taken away again, dearest first, where that does not change the topology. What stays is
//!    what joins the pieces.
//! 5. **Walls.** Of the walls, which the growth beyond may not touch (it would fill a cavity whose tube is left open), comes back what
//!    can; and every set of changed tetrahedra gets its first labels again where that leaves the topology right.
//!
//! Every growth keeps the topology of the step before. The result is checked against the surface all the same, and
//! refused when it is wrong or when the surface would move by more than the limit: parts that are *missing* in the labels
//! cannot be grown. Then only the pinches are repaired ([`super::star_repair`]).
//!
//! Cost: one distance query a tetrahedron and `O(n log n)`, with `O(n)` for each set put back.

use super::homotopic_growth::{grow, walls};
use super::known_surface::{SurfaceQueries, component_eulers, enclosing_parts};
use super::labels::{boundary_triangles, mesh_of};
use super::star_repair::repair_stars;
use crate::delaunay::Triangulation;
use crate::geometry::mesh::DisjointSets;
use crate::geometry::{TetId, TriangleMesh};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// Farthest that the surface may move, in spacings (`sqrt(area / generators)`): the distance within which a surface found anew counts as right.
pub const MOST_MOVED: f64 = 2.0;

/// Sets of tetrahedra tried with another label at most, each at a cost of `O(n)`.
const MOST_TRIED: usize = 100;

/// Neighbouring tetrahedra whose label was changed for the sake of topology.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RepairedPlace {
    /// Centroid of the tetrahedron that cost most, mm.
    pub place: DVec3,
    /// Whether it is inside now.
    pub inside: bool,
    /// Tetrahedra changed.
    pub tetrahedra: usize,
    /// How far the surface moves there at most, mm.
    pub moved_mm: f64,
}

/// Labels repaired.
#[derive(Clone, Debug)]
pub(super) struct KnownRepair {
    pub inside: Vec<bool>,
    /// Whether they have the known surface's topology now.
    pub agrees: bool,
    /// Where labels were changed, the farthest first.
    pub places: Vec<RepairedPlace>,
    /// `sqrt(area / generators)`, mm.
    pub spacing_mm: f64,
}

/// Changes labels until they have the surface's topology; see the module.
pub(super) fn repair_topology(
    triangulation: &Triangulation,
    surface: &TriangleMesh,
    queries: &impl SurfaceQueries,
    inside: &[bool],
) -> KnownRepair {
    let mut price_mm: Vec<f64> = (0..triangulation.num_finite() as u32)
        .into_par_iter()
        .map(|t| queries.distance_mm(centroid(triangulation, TetId(t))))
        .collect();
    price_mm.resize(triangulation.num_tets(), f64::INFINITY);
    let spacing_mm = (surface.area() / triangulation.points.len() as f64).sqrt();
    let repair = Repair {
        triangulation,
        wanted: Wanted::of(surface),
        price_mm,
        spacing_mm,
        first: inside,
    };
    let grown = repair.grow_and_shrink();
    let agrees = repair.is_right(&grown);
    let inside = if agrees { grown } else { repair.manifold() };
    KnownRepair {
        places: repair.places(&inside),
        agrees,
        inside,
        spacing_mm,
    }
}

/// What a known surface asks of labels.
struct Wanted {
    /// Solid parts.
    parts: usize,
    cavities: usize,
    /// Euler numbers of the surface's components, sorted.
    eulers: Vec<i64>,
}

impl Wanted {
    fn of(surface: &TriangleMesh) -> Self {
        let components = enclosing_parts(surface);
        Self {
            parts: components.iter().filter(|p| !p.cavity).count(),
            cavities: components.iter().filter(|p| p.cavity).count(),
            eulers: components.into_iter().map(|p| p.euler).collect(),
        }
    }
}

/// What does not change during a repair.
struct Repair<'a> {
    triangulation: &'a Triangulation,
    wanted: Wanted,
    /// Distance of every finite tetrahedron's centroid from the surface, mm; infinite for ghosts.
    price_mm: Vec<f64>,
    spacing_mm: f64,
    /// The labels to start from.
    first: &'a [bool],
}

impl Repair<'_> {
    fn price(&self, tet: TetId) -> f64 {
        self.price_mm[tet.index()]
    }

    /// Steps 1 to 5.
    fn grow_and_shrink(&self) -> Vec<bool> {
        let t = self.triangulation;
        let opened = self.openings();
        let first = |tet: TetId| self.first[tet.index()] && !opened[tet.index()];
        let price = |tet: TetId| self.price(tet);
        let mut parts = self.parts(true);
        let seeds = self.seeds(&mut parts);
        let solid = grow(t, &seeds, first, price);
        let left = walls(t, &solid, first);
        let mut core = solid;
        self.put_back(left, &mut core, |_| true);
        let mut seeded = vec![false; t.num_tets()];
        for seed in seeds {
            seeded[parts.find(seed.0) as usize] = true;
        }
        let mut near = |tet: TetId| match (t.is_finite(tet), first(tet)) {
            (true, true) => !seeded[parts.find(tet.0) as usize],
            (finite, _) => finite && !opened[tet.index()] && self.price(tet) <= MOST_MOVED * self.spacing_mm,
        };
        let may: Vec<bool> = t.tets().map(&mut near).collect();
        let depth = |tet: TetId| if first(tet) { price(tet) } else { -price(tet) };
        let reached = grow(t, &members(t, &core), |tet| may[tet.index()], depth);
        let beyond: Vec<bool> = reached.iter().map(|r| !r).collect();
        let surplus = |tet: TetId| reached[tet.index()] && !first(tet);
        let outside = grow(t, &members(t, &beyond), surplus, price);
        let mut inside: Vec<bool> = outside.into_iter().map(|o| !o).collect();
        inside = grow(t, &members(t, &inside), first, price);
        self.put_back(self.changed_sets(&inside), &mut inside, first);
        inside
    }

    /// Gives sets of tetrahedra the labels `to`, the dearest first, where the topology comes no farther from the surface's.
    fn put_back(&self, mut sets: Vec<Vec<TetId>>, labels: &mut [bool], to: impl Fn(TetId) -> bool) {
        let dearest = |set: &Vec<TetId>| set.iter().map(|x| self.price(*x)).fold(0.0, f64::max);
        sets.sort_by(|a, b| dearest(b).total_cmp(&dearest(a)).then_with(|| a.cmp(b)));
        let Some(mut off) = self.off(labels) else {
            return;
        };
        for set in sets.into_iter().take(MOST_TRIED) {
            let before: Vec<bool> = set.iter().map(|x| labels[x.index()]).collect();
            for &tet in &set {
                labels[tet.index()] = to(tet);
            }
            match self.off(labels) {
                Some(now) if now <= off => off = now,
                _ => {
                    for (tet, label) in set.iter().zip(before) {
                        labels[tet.index()] = label;
                    }
                }
            }
        }
    }

    /// How far the topology of labels is from the surface's: differences of the numbers of components and of the sums of Euler
    /// numbers. `None` when their surface is no closed manifold.
    fn off(&self, labels: &[bool]) -> Option<u64> {
        let found = self.eulers(labels)?;
        let sum = |eulers: &[i64]| eulers.iter().sum::<i64>();
        Some(
            found.len().abs_diff(self.wanted.eulers.len()) as u64
                + sum(&found).abs_diff(sum(&self.wanted.eulers)),
        )
    }

    /// Euler numbers of the components of the surface of labels, sorted; `None` when it is no closed manifold.
    fn eulers(&self, labels: &[bool]) -> Option<Vec<i64>> {
        let mesh = mesh_of(
            self.triangulation,
            &boundary_triangles(self.triangulation, labels),
        );
        let topology = mesh.topology();
        (topology.watertight && topology.nonmanifold_edges == 0 && topology.nonmanifold_vertices == 0)
            .then(|| component_eulers(&mesh))
    }

    /// Connected parts of a side, as sets of tetrahedra.
    fn parts(&self, side: bool) -> DisjointSets {
        let t = self.triangulation;
        let mut sets = DisjointSets::new(t.num_tets());
        for facet in t.facets() {
            let other = t.mirror(facet).tet;
            if self.first[facet.tet.index()] == side && self.first[other.index()] == side {
                sets.union(facet.tet.0, other.0);
            }
        }
        sets
    }

    /// Step 1: the inside tetrahedra on the cheapest ways from the cavities that should not be to the outside.
    fn openings(&self) -> Vec<bool> {
        let t = self.triangulation;
        let mut sets = self.parts(false);
        let mut opened = vec![false; t.num_tets()];
        let Some(ghost) = t.tets().nth(t.num_finite()) else {
            return opened;
        };
        let mut order: Vec<TetId> = t.finite_tets().filter(|x| !self.first[x.index()]).collect();
        order.sort_by(|a, b| self.price(*b).total_cmp(&self.price(*a)).then(a.cmp(b)));
        let mut met = vec![false; t.num_tets()];
        met[sets.find(ghost.0) as usize] = true;
        let cavities: Vec<TetId> = order
            .into_iter()
            .filter(|tet| !std::mem::replace(&mut met[sets.find(tet.0) as usize], true))
            .skip(self.wanted.cavities)
            .collect();
        for cavity in cavities {
            let way = self.way_out(cavity, |tet| sets.find(tet.0) == sets.find(ghost.0));
            for tet in way {
                opened[tet.index()] = self.first[tet.index()];
            }
        }
        opened
    }

    /// The tetrahedra on the way from one to the first that is `out`, whose dearest inside tetrahedron is cheapest, and of those ways a short
    /// one. Dijkstra's, with the maximum for the sum.
    fn way_out(&self, from: TetId, mut out: impl FnMut(TetId) -> bool) -> Vec<TetId> {
        let t = self.triangulation;
        let mut came = vec![None; t.num_tets()];
        came[from.index()] = Some(from);
        let mut queue = Queue::new();
        queue.push(0.0, 0, from);
        while let Some((dearest, steps, tet)) = queue.pop() {
            if out(tet) {
                let mut way = vec![tet];
                let mut at = tet;
                while let Some(before) = came[at.index()].filter(|&b| b != at) {
                    way.push(before);
                    at = before;
                }
                return way;
            }
            for next in (0..4).map(|k| t.neighbour(tet, k)) {
                if came[next.index()].is_none() {
                    came[next.index()] = Some(tet);
                    let inside = self.first[next.index()];
                    let price = if inside { self.price(next) } else { 0.0 };
                    queue.push(f64::max(dearest, price), steps + 1, next);
                }
            }
        }
        Vec::new()
    }

    /// The deepest tetrahedra of as many inside parts as are wanted, the deepest parts first.
    fn seeds(&self, parts: &mut DisjointSets) -> Vec<TetId> {
        let t = self.triangulation;
        let mut order: Vec<TetId> = t.finite_tets().filter(|x| self.first[x.index()]).collect();
        order.sort_by(|a, b| self.price(*b).total_cmp(&self.price(*a)).then(a.cmp(b)));
        let mut met = vec![false; t.num_tets()];
        order
            .into_iter()
            .filter(|tet| !std::mem::replace(&mut met[parts.find(tet.0) as usize], true))
            .take(self.wanted.parts)
            .collect()
    }

    /// Whether labels have the surface's topology, and the surface moved no farther than it may.
    fn is_right(&self, inside: &[bool]) -> bool {
        let limit_mm = MOST_MOVED * self.spacing_mm;
        self.eulers(inside)
            .is_some_and(|found| found == self.wanted.eulers)
            && self.changed(inside).all(|tet| self.price(tet) <= limit_mm)
    }

    /// The first labels with their pinches repaired, against the price.
    fn manifold(&self) -> Vec<bool> {
        let pull: Vec<f32> = self
            .price_mm
            .iter()
            .zip(self.first)
            .map(|(&mm, &inside)| (mm / self.spacing_mm).min(1e3) as f32 * if inside { 1.0 } else { -1.0 })
            .collect();
        let mut inside = self.first.to_vec();
        repair_stars(self.triangulation, &pull, &mut inside);
        inside
    }

    /// Tetrahedra whose label is not the first one.
    fn changed<'b>(&'b self, inside: &'b [bool]) -> impl Iterator<Item = TetId> + 'b {
        self.triangulation
            .finite_tets()
            .filter(|t| inside[t.index()] != self.first[t.index()])
    }

    /// The tetrahedra changed, in sets that share a vertex.
    fn changed_sets(&self, inside: &[bool]) -> Vec<Vec<TetId>> {
        let unchanged: Vec<bool> = inside.iter().zip(self.first).map(|(a, b)| a == b).collect();
        walls(self.triangulation, &unchanged, |_| true)
    }

    /// Where labels were changed, the farthest first.
    fn places(&self, inside: &[bool]) -> Vec<RepairedPlace> {
        let mut out: Vec<RepairedPlace> = self
            .changed_sets(inside)
            .into_iter()
            .filter_map(|set| {
                let worst = set
                    .iter()
                    .copied()
                    .max_by(|a, b| self.price(*a).total_cmp(&self.price(*b)).then(b.cmp(a)))?;
                Some(RepairedPlace {
                    place: centroid(self.triangulation, worst),
                    inside: inside[worst.index()],
                    tetrahedra: set.len(),
                    moved_mm: self.price(worst),
                })
            })
            .collect();
        out.sort_by(|a, b| b.moved_mm.total_cmp(&a.moved_mm));
        out
    }
}

/// Tetrahedra by the dearest on the way to them, then by steps, then by id.
struct Queue(BinaryHeap<Reverse<(OrderedPrice, u32, TetId)>>);

/// A price in its total order.
#[derive(Clone, Copy, Debug, PartialEq)]
struct OrderedPrice(f64);

impl Eq for OrderedPrice {}

impl Ord for OrderedPrice {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for OrderedPrice {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Queue {
    fn new() -> Self {
        Self(BinaryHeap::new())
    }

    fn push(&mut self, dearest: f64, steps: u32, tet: TetId) {
        self.0.push(Reverse((OrderedPrice(dearest), steps, tet)));
    }

    fn pop(&mut self) -> Option<(f64, u32, TetId)> {
        let Reverse((OrderedPrice(dearest), steps, tet)) = self.0.pop()?;
        Some((dearest, steps, tet))
    }
}

/// The tetrahedra of a set, in order.
fn members(triangulation: &Triangulation, set: &[bool]) -> Vec<TetId> {
    triangulation.tets().filter(|t| set[t.index()]).collect()
}

fn centroid(triangulation: &Triangulation, tet: TetId) -> DVec3 {
    triangulation.corners(tet).iter().sum::<DVec3>() / 4.0
}
