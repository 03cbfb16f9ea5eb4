//! Greedy gap transforms: the surface triangles that a cloud shows by itself.
//!
//! In: triangulation, circumspheres, local spacing. Out: which facets were accepted, as a set of triangles that is a manifold
//! with border wherever the points allow one. A gap transform removes a curve of the full scaffold and inserts its dual
//! triangle (Leymarie & Kimia 2007; Chang, Leymarie & Kimia 2009).
//!
//! 1. *Cost* of a facet with vertices at distances within a few spacings: `perimeter / (R c^2)`, `c` its compactness (1 when
//!    equilateral), `R` the shorter of the two parts of its dual curve measured from the facet; small for a triangle whose
//!    curve runs far to both sides, as that of a surface triangle does.
//! 2. *Pass 1*, cheapest first, takes facets whose curve starts on the facet (its smallest sphere is empty). *Pass 2* takes
//!    the others round open edges and unused points, with half the spacing in place of `R`.
//! 3. *Continuity*: an accepted triangle makes flat continuations across its edges cheaper and folds dearer by
//!    `((exp theta - 1)^2 - 1) |e| / (R c^2)`. The parts of a cost are kept apart by edge and added anew, so undoing a
//!    triangle restores every cost exactly.
//! 4. *Topology*: an edge has at most two triangles (a dearer one gives way, at most five times each); a point with a closed
//!    ring takes no more; a triangle that would touch the surface in a point only waits, five times at most.
//! 5. Between the passes triangles that hang on one edge or none are undone.
//!
//! Departures: the local spacing replaces the median over all Voronoi facets, so that uneven clouds stay whole
//! ([`CostRule::Authors`] keeps the published rule); the queue is ordered by (cost, facet), a total order, so the result
//! does not depend on insertion order. Cost: `O(n log n)`; each triangle is undone a bounded number of times.

use super::balls::Balls;
use super::diffusion::slot;
use super::facets::FacetDepths;
use super::stars::{StarBuffer, Stars};
use crate::delaunay::{Facet, INFINITE, Triangulation};
use crate::geometry::{TetId, VertexId};
use glam::DVec3;
use ordered_float::OrderedFloat;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Which lengths the cost is measured against.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CostRule {
    /// Half the local spacing, and edges of at most five local spacings.
    #[default]
    Local,
    /// The authors': the median of half the length of all Delaunay edges, and edges of at most six times that.
    Authors,
}

/// Longest edge over the local spacing.
const LOCAL_REACH: f64 = 5.0;
/// Longest edge over the median half edge, authors' rule.
const AUTHORS_REACH: f64 = 6.0;
/// Times a triangle may be undone.
const MOST_UNDONE: u8 = 5;
/// Times a triangle that touches in a point may wait.
const MOST_DELAYS: u8 = 5;
/// Factor on the cost of a triangle that waits.
const DELAY: f64 = 1.2;

/// The accepted facets.
#[derive(Clone, Debug, Default)]
pub struct GapTransforms {
    /// For every facet side (`4 * tet + index`) whether its facet was accepted.
    pub accepted: Vec<bool>,
    /// Each accepted facet once, in the order of the tetrahedra.
    pub facets: Vec<Facet>,
    /// Triangles undone on the way.
    pub undone: usize,
}

/// Runs the greedy loop. `preset` facets (of a mesh to be repaired) are accepted first, at no cost, and never undone.
pub fn gap_transforms(
    triangulation: &Triangulation,
    balls: &Balls,
    depths: &FacetDepths,
    spacing_mm: &[f64],
    rule: CostRule,
    preset: &[Facet],
) -> GapTransforms {
    let mut greedy = Greedy::new(triangulation, balls, depths, spacing_mm, rule);
    greedy.accept_preset(preset);
    greedy.first_pass();
    greedy.drop_dangling();
    greedy.second_pass();
    greedy.finish()
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Has an entry in the queue (or had one and may get another).
    Waiting,
    Accepted,
    Refused,
}

#[derive(Clone, Debug)]
struct Candidate {
    facet: Facet,
    vertices: [VertexId; 3],
    /// Cost without continuity.
    base: f64,
    /// `R c^2` of the current pass.
    divisor: f64,
    /// Continuity by edge (edge `k` is opposite vertex `k`).
    continuity: [f64; 3],
    state: State,
    preset: bool,
    undone: u8,
    delays: u8,
}

impl Candidate {
    fn cost(&self) -> f64 {
        let sum = self.base + (self.continuity[0] + self.continuity[1] + self.continuity[2]);
        sum.max(0.0) * DELAY.powi(i32::from(self.delays)) + 0.0
    }

    fn edge(&self, k: usize) -> [VertexId; 2] {
        [self.vertices[(k + 1) % 3], self.vertices[(k + 2) % 3]]
    }
}

/// Queue key: cheapest first, then the facet.
type Key = Reverse<(OrderedFloat<f64>, u32)>;

struct Greedy<'a> {
    triangulation: &'a Triangulation,
    balls: &'a Balls,
    depths: &'a FacetDepths,
    spacing_mm: &'a [f64],
    rule: CostRule,
    /// Median half Delaunay edge, authors' rule only, mm.
    median_half_edge: f64,
    second: bool,
    /// Candidate of each facet by the slot of its smaller side.
    candidate_of: Vec<u32>,
    candidates: Vec<Candidate>,
    /// Accepted candidates at each vertex.
    at_vertex: Vec<Vec<u32>>,
    queue: BinaryHeap<Key>,
    undone: usize,
}

const NONE: u32 = u32::MAX;

impl<'a> Greedy<'a> {
    fn new(
        triangulation: &'a Triangulation,
        balls: &'a Balls,
        depths: &'a FacetDepths,
        spacing_mm: &'a [f64],
        rule: CostRule,
    ) -> Self {
        let median_half_edge = match rule {
            CostRule::Local => 0.0,
            CostRule::Authors => median_half_edge(triangulation),
        };
        Self {
            triangulation,
            balls,
            depths,
            spacing_mm,
            rule,
            median_half_edge,
            second: false,
            candidate_of: vec![NONE; 4 * triangulation.num_tets()],
            candidates: Vec::new(),
            at_vertex: vec![Vec::new(); triangulation.points.len()],
            queue: BinaryHeap::new(),
            undone: 0,
        }
    }

    fn position(&self, v: VertexId) -> DVec3 {
        self.triangulation.points[v.index()]
    }

    /// Half the spacing at a triangle (or its authors' stand-in), mm.
    fn half_spacing(&self, vertices: [VertexId; 3]) -> f64 {
        match self.rule {
            CostRule::Local => vertices.iter().map(|v| self.spacing_mm[v.index()]).sum::<f64>() / 6.0,
            CostRule::Authors => self.median_half_edge,
        }
    }

    /// The candidate of a facet, without continuity; `None` when it is infinite, oversized or has no area.
    fn candidate(&self, facet: Facet, second: bool) -> Option<Candidate> {
        let vertices = self.triangulation.facet_vertices(facet);
        if vertices.contains(&INFINITE) {
            return None;
        }
        let [a, b, c] = vertices.map(|v| self.position(v));
        let sides = [(c - b).length(), (a - c).length(), (b - a).length()];
        let longest = sides[0].max(sides[1]).max(sides[2]);
        let half = self.half_spacing(vertices);
        let reach = match self.rule {
            CostRule::Local => 2.0 * LOCAL_REACH * half,
            CostRule::Authors => AUTHORS_REACH * half,
        };
        if longest > reach {
            return None;
        }
        let area = 0.5 * (b - a).cross(c - a).length();
        let squares: f64 = sides.iter().map(|s| s * s).sum();
        let compactness = 4.0 * 3f64.sqrt() * area / squares;
        if compactness <= 1e-6 {
            return None;
        }
        let reach_mm = if second { half } else { self.shorter_curve(facet) };
        let divisor = (reach_mm * compactness * compactness).max(f64::MIN_POSITIVE);
        Some(Candidate {
            facet,
            vertices,
            base: sides.iter().sum::<f64>() / divisor,
            divisor,
            continuity: [0.0; 3],
            state: State::Waiting,
            preset: false,
            undone: 0,
            delays: 0,
        })
    }

    /// The shorter part of the dual curve, measured from the facet, mm.
    fn shorter_curve(&self, facet: Facet) -> f64 {
        let part = |f: Facet| {
            if self.triangulation.is_finite(f.tet) && !self.balls.flat[f.tet.index()] {
                f64::from(self.depths.depth(f)).abs() * self.balls.radii[f.tet.index()]
            } else {
                f64::INFINITY
            }
        };
        part(facet).min(part(self.triangulation.mirror(facet)))
    }

    fn canonical(&self, facet: Facet) -> Facet {
        facet.min(self.triangulation.mirror(facet))
    }

    /// The candidate index of a facet, made when it has none yet.
    fn ensure(&mut self, facet: Facet) -> Option<u32> {
        let facet = self.canonical(facet);
        let known = self.candidate_of[slot(facet)];
        if known != NONE {
            return Some(known);
        }
        let candidate = self.candidate(facet, self.second)?;
        Some(self.insert(candidate))
    }

    fn insert(&mut self, candidate: Candidate) -> u32 {
        let index = self.candidates.len() as u32;
        self.candidate_of[slot(candidate.facet)] = index;
        self.candidates.push(candidate);
        index
    }

    fn push(&mut self, index: u32) {
        let c = &self.candidates[index as usize];
        self.queue
            .push(Reverse((OrderedFloat(c.cost()), slot(c.facet) as u32)));
    }

    fn accept_preset(&mut self, preset: &[Facet]) {
        for &facet in preset {
            let facet = self.canonical(facet);
            if self.candidate_of[slot(facet)] != NONE {
                continue;
            }
            let index = self.insert(Candidate {
                facet,
                vertices: self.triangulation.facet_vertices(facet),
                base: 0.0,
                divisor: 1.0,
                continuity: [0.0; 3],
                state: State::Waiting,
                preset: true,
                undone: 0,
                delays: 0,
            });
            self.accept(index);
        }
    }

    /// Pass 1: facets whose dual curve starts on them.
    fn first_pass(&mut self) {
        let found: Vec<Vec<Candidate>> = (0..self.triangulation.num_tets() as u32)
            .into_par_iter()
            .map(|t| {
                (0..4u8)
                    .map(|index| Facet { tet: TetId(t), index })
                    .filter(|&f| {
                        f < self.triangulation.mirror(f) && self.depths.is_gabriel(self.triangulation, f)
                    })
                    .filter_map(|f| self.candidate(f, false))
                    .collect()
            })
            .collect();
        let mut indices = Vec::new();
        for candidate in found.into_iter().flatten() {
            if self.candidate_of[slot(candidate.facet)] == NONE {
                indices.push(self.insert(candidate));
            }
        }
        for &index in &indices {
            self.renew_continuity(index);
            self.push(index);
        }
        self.drain();
    }

    /// Pass 2: everything round open edges and unused points.
    fn second_pass(&mut self) {
        self.second = true;
        for index in 0..self.candidates.len() {
            let old = &self.candidates[index];
            if old.preset {
                continue;
            }
            let fresh = self
                .candidate(old.facet, true)
                .expect("it was a candidate before");
            let old = &mut self.candidates[index];
            (old.base, old.divisor, old.delays) = (fresh.base, fresh.divisor, 0);
            if old.state == State::Refused {
                old.state = State::Waiting;
            }
        }
        for index in 0..self.candidates.len() as u32 {
            self.renew_continuity(index);
        }
        let accepted: Vec<u32> = (0..self.candidates.len() as u32)
            .filter(|&i| self.candidates[i as usize].state == State::Accepted)
            .collect();
        for index in accepted {
            self.offer_round(index);
        }
        self.offer_unused_points();
        self.drain();
    }

    /// Queues the candidates round the open edges of an accepted triangle.
    fn offer_round(&mut self, index: u32) {
        for k in 0..3 {
            let [a, b] = self.candidates[index as usize].edge(k);
            let third = self.candidates[index as usize].vertices[k];
            let facet = self.candidates[index as usize].facet;
            let around = round_edge(self.triangulation, facet, a, b, third);
            if around.iter().any(|&f| self.is_accepted(f)) {
                continue;
            }
            for f in around {
                self.offer(f);
            }
        }
    }

    fn offer_unused_points(&mut self) {
        let unused: Vec<VertexId> = (0..self.at_vertex.len() as u32)
            .map(VertexId)
            .filter(|v| self.at_vertex[v.index()].is_empty())
            .collect();
        if unused.is_empty() {
            return;
        }
        let stars = Stars::new(self.triangulation);
        let mut star = StarBuffer::default();
        for v in unused {
            stars.collect(self.triangulation, v, &mut star);
            let facets: Vec<Facet> = star
                .tets
                .iter()
                .flat_map(|&tet| (0..4u8).map(move |index| Facet { tet, index }))
                .filter(|&f| self.triangulation.facet_vertices(f).contains(&v))
                .collect();
            for f in facets {
                self.offer(f);
            }
        }
    }

    fn offer(&mut self, facet: Facet) {
        let Some(index) = self.ensure(facet) else {
            return;
        };
        if self.candidates[index as usize].state == State::Waiting {
            self.renew_continuity(index);
            self.push(index);
        }
    }

    fn is_accepted(&self, facet: Facet) -> bool {
        let index = self.candidate_of[slot(self.canonical(facet))];
        index != NONE && self.candidates[index as usize].state == State::Accepted
    }

    /// Accepted candidates round edge `k` of a candidate, itself left out.
    fn neighbours_at(&self, index: u32, k: usize) -> Vec<u32> {
        let c = &self.candidates[index as usize];
        let [a, b] = c.edge(k);
        // Few triangles meet at a vertex: its list is shorter than the walk round the edge.
        self.at_vertex[a.index()]
            .iter()
            .copied()
            .filter(|&other| other != index && self.candidates[other as usize].vertices.contains(&b))
            .collect()
    }

    /// Continuity of a candidate across edge `k` with what is accepted there.
    fn continuity(&self, index: u32, k: usize) -> f64 {
        let c = &self.candidates[index as usize];
        let [a, b] = c.edge(k);
        let (pa, pb) = (self.position(a), self.position(b));
        let edge = pb - pa;
        let length = edge.length();
        let across = |third: VertexId| {
            let d = self.position(third) - pa;
            (d - edge * (d.dot(edge) / (length * length))).normalize_or_zero()
        };
        let own = across(c.vertices[k]);
        let mut sum = 0.0;
        for other in self.neighbours_at(index, k) {
            let o = &self.candidates[other as usize];
            let third = o.vertices.into_iter().find(|v| *v != a && *v != b);
            let theta = (-own.dot(across(third.expect("a triangle has a third vertex"))))
                .clamp(-1.0, 1.0)
                .acos();
            sum += ((theta.exp() - 1.0).powi(2) - 1.0) * length / c.divisor;
        }
        sum
    }

    fn renew_continuity(&mut self, index: u32) {
        for k in 0..3 {
            self.candidates[index as usize].continuity[k] = self.continuity(index, k);
        }
    }

    /// Renews the continuity of all waiting candidates round the edges of a triangle that was accepted or undone.
    fn renew_round(&mut self, index: u32) {
        for k in 0..3 {
            let c = &self.candidates[index as usize];
            let [a, b] = c.edge(k);
            for facet in round_edge(self.triangulation, c.facet, a, b, c.vertices[k]) {
                let other = self.candidate_of[slot(self.canonical(facet))];
                if other == NONE || self.candidates[other as usize].state != State::Waiting {
                    continue;
                }
                let o = &self.candidates[other as usize];
                let edge = (0..3)
                    .find(|&j| o.vertices[j] != a && o.vertices[j] != b)
                    .expect("the candidate has one vertex off the edge");
                let value = self.continuity(other, edge);
                self.candidates[other as usize].continuity[edge] = value;
                self.push(other);
            }
        }
    }

    fn drain(&mut self) {
        while let Some(Reverse((key, place))) = self.queue.pop() {
            let index = self.candidate_of[place as usize];
            let c = &self.candidates[index as usize];
            if c.state != State::Waiting || c.cost() != key.0 {
                continue;
            }
            self.consider(index);
        }
    }

    /// The topology rules, then acceptance.
    fn consider(&mut self, index: u32) {
        let cost = self.candidates[index as usize].cost();
        for k in 0..3 {
            while let [first, second, ..] = self.neighbours_at(index, k)[..] {
                // The dearer of the two gives way when it is dearer than this one.
                let price = |i: u32| self.candidates[i as usize].cost();
                let worst = if price(second) > price(first) {
                    second
                } else {
                    first
                };
                let w = &self.candidates[worst as usize];
                if w.preset || w.undone >= MOST_UNDONE || w.cost() <= cost {
                    self.candidates[index as usize].state = State::Refused;
                    return;
                }
                self.undo(worst);
                if !self.second {
                    // In pass 1 the newcomer waits for pass 2 as well.
                    self.candidates[index as usize].state = State::Refused;
                    return;
                }
            }
        }
        let vertices = self.candidates[index as usize].vertices;
        if vertices.iter().any(|&v| self.ring_closed(v)) {
            self.candidates[index as usize].state = State::Refused;
            return;
        }
        if self.candidates[index as usize].delays < MOST_DELAYS && self.touches_in_a_point(index) {
            let c = &mut self.candidates[index as usize];
            if c.cost() == 0.0 {
                // A factor would leave it at 0 for ever; the authors use 1 instead.
                c.base = 1.0 - c.continuity.iter().sum::<f64>();
            }
            c.delays += 1;
            self.push(index);
            return;
        }
        self.accept(index);
        for v in vertices {
            self.keep_ring_only(v);
        }
        if self.second && self.candidates[index as usize].state == State::Accepted {
            self.offer_round(index);
        }
    }

    fn accept(&mut self, index: u32) {
        self.candidates[index as usize].state = State::Accepted;
        for v in self.candidates[index as usize].vertices {
            self.at_vertex[v.index()].push(index);
        }
        self.renew_round(index);
    }

    fn undo(&mut self, index: u32) {
        self.undone += 1;
        let c = &mut self.candidates[index as usize];
        c.undone += 1;
        // In pass 1 it waits for pass 2.
        c.state = if self.second {
            State::Waiting
        } else {
            State::Refused
        };
        for v in c.vertices {
            self.at_vertex[v.index()].retain(|&i| i != index);
        }
        self.renew_continuity(index);
        if self.second {
            self.push(index);
        }
        self.renew_round(index);
    }

    /// Whether the triangles at a vertex form closed rings only.
    fn ring_closed(&self, v: VertexId) -> bool {
        let faces = &self.at_vertex[v.index()];
        !faces.is_empty()
            && faces.iter().all(|&i| {
                self.candidates[i as usize]
                    .vertices
                    .iter()
                    .all(|&w| w == v || self.degree(v, w) >= 2)
            })
    }

    /// Accepted triangles on an edge.
    fn degree(&self, v: VertexId, w: VertexId) -> usize {
        self.at_vertex[v.index()]
            .iter()
            .filter(|&&i| self.candidates[i as usize].vertices.contains(&w))
            .count()
    }

    /// Whether some vertex of the triangle is used, but neither of its two edges there.
    fn touches_in_a_point(&self, index: u32) -> bool {
        let c = &self.candidates[index as usize];
        (0..3).any(|k| {
            let v = c.vertices[k];
            !self.at_vertex[v.index()].is_empty()
                && self.degree(v, c.vertices[(k + 1) % 3]) == 0
                && self.degree(v, c.vertices[(k + 2) % 3]) == 0
        })
    }

    /// Undoes triangles at a vertex that are not part of its closed ring, when it has one.
    fn keep_ring_only(&mut self, v: VertexId) {
        let faces = self.at_vertex[v.index()].clone();
        if faces.len() < 4 || self.ring_closed(v) {
            return;
        }
        // Parts of the link: triangles joined through edges at v.
        let mut part: Vec<usize> = (0..faces.len()).collect();
        let share = |i: u32, j: u32| {
            let (a, b) = (&self.candidates[i as usize], &self.candidates[j as usize]);
            a.vertices.iter().any(|w| *w != v && b.vertices.contains(w))
        };
        for i in 0..faces.len() {
            for j in 0..i {
                if share(faces[i], faces[j]) && part[i] != part[j] {
                    let (from, to) = (part[i].max(part[j]), part[i].min(part[j]));
                    part.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
                }
            }
        }
        let closed = |p: usize| {
            faces.iter().zip(&part).filter(|(_, q)| **q == p).all(|(&i, _)| {
                self.candidates[i as usize]
                    .vertices
                    .iter()
                    .all(|&w| w == v || self.degree(v, w) >= 2)
            })
        };
        let rings: Vec<bool> = part.iter().map(|&p| closed(p)).collect();
        if !rings.contains(&true) {
            return;
        }
        for (k, &index) in faces.iter().enumerate() {
            let c = &self.candidates[index as usize];
            if !rings[k] && !c.preset && c.undone < MOST_UNDONE {
                self.undo(index);
                self.candidates[index as usize].state = State::Refused;
            }
        }
    }

    /// Undoes triangles that share at most one edge with others.
    fn drop_dangling(&mut self) {
        let dangling: Vec<u32> = (0..self.candidates.len() as u32)
            .filter(|&i| {
                let c = &self.candidates[i as usize];
                c.state == State::Accepted
                    && !c.preset
                    && (0..3).filter(|&k| !self.neighbours_at(i, k).is_empty()).count() <= 1
            })
            .collect();
        for index in dangling {
            self.undo(index);
        }
    }

    fn finish(self) -> GapTransforms {
        let mut accepted = vec![false; 4 * self.triangulation.num_tets()];
        let mut facets: Vec<Facet> = self
            .candidates
            .iter()
            .filter(|c| c.state == State::Accepted)
            .map(|c| c.facet)
            .collect();
        facets.sort_unstable();
        for &f in &facets {
            accepted[slot(f)] = true;
            accepted[slot(self.triangulation.mirror(f))] = true;
        }
        GapTransforms {
            accepted,
            facets,
            undone: self.undone,
        }
    }
}

/// The facets round the edge `a b` of a facet whose third vertex is `c`, that facet left out, in the order of the walk.
pub(super) fn round_edge(
    triangulation: &Triangulation,
    facet: Facet,
    a: VertexId,
    b: VertexId,
    c: VertexId,
) -> Vec<Facet> {
    let mut out = Vec::with_capacity(8);
    let mut tet = facet.tet;
    let mut third = c;
    loop {
        let corners = triangulation.tet(tet);
        let place = corners
            .iter()
            .position(|&v| v == third)
            .expect("the walk enters through a facet of the tetrahedron");
        let next = corners
            .into_iter()
            .find(|&v| v != a && v != b && v != third)
            .expect("a tetrahedron has a fourth vertex");
        if next == c {
            return out;
        }
        let leave = Facet {
            tet,
            index: place as u8,
        };
        out.push(leave);
        tet = triangulation.mirror(leave).tet;
        third = next;
    }
}

fn median_half_edge(triangulation: &Triangulation) -> f64 {
    let mut edges: Vec<(u32, u32)> = triangulation
        .finite_tets()
        .flat_map(|t| {
            let v = triangulation.tet(t).map(|v| v.0);
            [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| (v[i].min(v[j]), v[i].max(v[j])))
        })
        .collect();
    edges.par_sort_unstable();
    edges.dedup();
    let lengths = edges
        .iter()
        .map(|&(i, j)| 0.5 * triangulation.points[i as usize].distance(triangulation.points[j as usize]))
        .collect();
    super::prepare::noise::median(lengths)
}
