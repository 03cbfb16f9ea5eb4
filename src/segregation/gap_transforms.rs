//! Greedy gap transforms: the surface triangles that a cloud shows by itself.
//!
//! In: triangulation, circumspheres, local spacing. Out: which facets were accepted, as a set of triangles that is a manifold
//! with border wherever the points allow one. A gap transform removes a curve of the full scaffold and inserts its dual
//! triangle (Leymarie & Kimia 2007; Chang, Leymarie & Kimia 2009). What one costs is in [`super::gap_cost`].
//!
//! 1. *Pass 1*, cheapest first, takes facets whose curve starts on the facet (its smallest sphere is empty). *Pass 2* takes
//!    the others round open edges and unused points, with half the spacing in place of the curve's length.
//! 2. *Continuity*: an accepted triangle changes the cost of its neighbours. The parts of a cost are kept apart by edge and
//!    added anew, so undoing a triangle restores every cost exactly.
//! 3. *Topology*: an edge has at most two triangles (a dearer one gives way, at most five times each); a point with a closed
//!    ring takes no more; a triangle that would touch the surface in a point only waits, five times at most.
//! 4. Between the passes triangles that hang on one edge or none are undone.
//!
//! Departure: the queue is ordered by (cost, facet), a total order, so the result does not depend on insertion order.
//! Cost: `O(n log n)`; each triangle is undone a bounded number of times.

use super::balls::Balls;
use super::diffusion::slot;
use super::facets::FacetDepths;
use super::gap_cost::{Candidate, CostModel, CostRule, State};
use super::stars::{StarBuffer, Stars};
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::{TetId, VertexId};
use ordered_float::OrderedFloat;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Times a triangle may be undone.
const MOST_UNDONE: u8 = 5;
/// Times a triangle that touches in a point may wait.
const MOST_DELAYS: u8 = 5;

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

/// Queue key: cheapest first, then the facet.
type Key = Reverse<(OrderedFloat<f64>, u32)>;

struct Greedy<'a> {
    triangulation: &'a Triangulation,
    depths: &'a FacetDepths,
    costs: CostModel<'a>,
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
        Self {
            triangulation,
            depths,
            costs: CostModel::new(triangulation, balls, depths, spacing_mm, rule),
            second: false,
            candidate_of: vec![NONE; 4 * triangulation.num_tets()],
            candidates: Vec::new(),
            at_vertex: vec![Vec::new(); triangulation.points.len()],
            queue: BinaryHeap::new(),
            undone: 0,
        }
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
        let candidate = self.costs.candidate(facet, self.second)?;
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
            let index = self.insert(self.costs.preset(facet));
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
                    .filter_map(|f| self.costs.candidate(f, false))
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
                .costs
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
            let c = &self.candidates[index as usize];
            let around = RoundEdge::new(self.triangulation, c.facet, c.edge(k), c.vertices[k]);
            if around.clone().any(|f| self.is_accepted(f)) {
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
    fn neighbours_at(&self, index: u32, k: usize) -> impl Iterator<Item = u32> {
        let [a, b] = self.candidates[index as usize].edge(k);
        // Few triangles meet at a vertex: its list is shorter than the walk round the edge.
        self.at_vertex[a.index()]
            .iter()
            .copied()
            .filter(move |&other| other != index && self.candidates[other as usize].vertices.contains(&b))
    }

    /// Continuity of a candidate across edge `k` with what is accepted there.
    fn continuity(&self, index: u32, k: usize) -> f64 {
        let c = &self.candidates[index as usize];
        self.neighbours_at(index, k)
            .map(|other| self.costs.fold(c, k, &self.candidates[other as usize]))
            .sum()
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
            for facet in RoundEdge::new(self.triangulation, c.facet, [a, b], c.vertices[k]) {
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
            while let Some((first, second)) = self.two_at(index, k) {
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

    /// The first two accepted candidates at an edge that is full.
    fn two_at(&self, index: u32, k: usize) -> Option<(u32, u32)> {
        let mut at = self.neighbours_at(index, k);
        Some((at.next()?, at.next()?))
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
                    && (0..3)
                        .filter(|&k| self.neighbours_at(i, k).next().is_some())
                        .count()
                        <= 1
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

/// The facets round an edge of a facet, that facet left out, in the order of the walk.
#[derive(Clone)]
struct RoundEdge<'a> {
    triangulation: &'a Triangulation,
    edge: [VertexId; 2],
    /// The third vertex of the first facet, at which the walk ends.
    end: VertexId,
    tet: TetId,
    /// The third vertex of the facet entered through.
    third: VertexId,
}

impl<'a> RoundEdge<'a> {
    fn new(triangulation: &'a Triangulation, facet: Facet, edge: [VertexId; 2], end: VertexId) -> Self {
        Self {
            triangulation,
            edge,
            end,
            tet: facet.tet,
            third: end,
        }
    }
}

impl Iterator for RoundEdge<'_> {
    type Item = Facet;

    fn next(&mut self) -> Option<Facet> {
        let [a, b] = self.edge;
        let corners = self.triangulation.tet(self.tet);
        let place = corners
            .iter()
            .position(|&v| v == self.third)
            .expect("the walk enters through a facet of the tetrahedron");
        let next = corners
            .into_iter()
            .find(|&v| v != a && v != b && v != self.third)
            .expect("a tetrahedron has a fourth vertex");
        if next == self.end {
            return None;
        }
        let leave = Facet {
            tet: self.tet,
            index: place as u8,
        };
        self.tet = self.triangulation.mirror(leave).tet;
        self.third = next;
        Some(leave)
    }
}
