//! Step 4a: whole sheets are spliced, the least significant first.
//!
//! A sheet is a maximal set of facets joined across manifold edges. Its cost is its largest erosion thickness in tolerances;
//! for sheets smaller than a square of two tolerances it is the movement of the surface, because such crumbs on a
//! thick shaft have a large ET and yet stand for nothing. (Movement as the *only* cost eats a large sheet piece by piece: each
//! piece is covered by the balls of its neighbours.) Sheets go by collapses from their ribs, what is left of them is pruned
//! as wires, and where two sheets are left at an edge they become one. A removal that moves the surface by more than
//! the tolerance is taken back.
//!
//! Sheets of a larger ET go as well when the surface hardly moves without them: on the axis of a round shaft or a swelling, or near
//! a concave edge, the two sides of a sheet see each other at a small angle, and the sampling alone makes sheets of several
//! tolerances of ET. (Y of capsules, dumbbell, L-block: such sheets move the surface by less than 0.2 tolerances, all others
//! by more than 0.2; nearly all by more than 0.4.)

use super::collapse::{WireFire, collapse_facets};
use super::complex::{Complex, Step};
use super::cover::Cover;
use super::history::{Event, Kind};
use super::measure::Measure;
use crate::geometry::mesh::DisjointSets;
use ordered_float::OrderedFloat;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Side of the largest square, in tolerances, that a sheet spliced for its slight movement may have the area of.
const LARGEST_SLIGHT: f64 = 12.0;

/// A sheet that meets no other (the middle of a junction of wires) may move the surface by this many times more.
const ALONE: f64 = 4.0;

/// Removes the dangling wires that removed facets have left, each from its tip to the junction it hangs on: a spine that keeps the
/// surface in the sheet's stead is no simpler than the sheet. What goes on as a wire beyond the sheet is no such spine.
pub(crate) fn remove_spines(complex: &mut Complex, facets: &[u32]) {
    let fine = complex.fine;
    let mut own: Vec<u32> = facets
        .iter()
        .flat_map(|&f| fine.facet_vertices(f as usize).iter().copied())
        .collect();
    own.sort_unstable();
    own.dedup();
    for &tip in &own {
        let Some(mut edge) = complex.wire_at_tip(tip) else {
            continue;
        };
        let (mut at, mut spine) = (tip, Vec::new());
        let at_junction = loop {
            spine.push((edge, at));
            at = fine.other_end(edge as usize, at);
            let mut on = fine
                .edges_of_vertex(at as usize)
                .filter(|&e| e != edge && complex.edge_alive[e as usize]);
            match (on.next(), on.next()) {
                _ if own.binary_search(&at).is_err() => break false,
                (Some(e), None) if complex.edge_count[e as usize] == 0 => edge = e,
                (None, _) => break false,
                _ => break true,
            }
        };
        if at_junction {
            for (edge, vertex) in spine {
                complex.remove_edge(edge, vertex);
            }
        }
    }
}

/// The sheets of the alive complex.
pub(crate) struct Sheets {
    sets: DisjointSets,
    facets: Vec<Vec<u32>>,
    version: Vec<u32>,
}

impl Sheets {
    pub fn new(complex: &Complex) -> Self {
        let n = complex.fine.num_facets();
        let mut sets = DisjointSets::new(n);
        for e in 0..complex.fine.num_edges() as u32 {
            if complex.edge_alive[e as usize] && complex.edge_count[e as usize] == 2 {
                let mut pair = complex.alive_facets(e);
                if let (Some(a), Some(b)) = (pair.next(), pair.next()) {
                    sets.union(a, b);
                }
            }
        }
        let mut facets = vec![Vec::new(); n];
        for f in 0..n as u32 {
            if complex.facet_alive[f as usize] {
                facets[sets.find(f) as usize].push(f);
            }
        }
        Self {
            sets,
            facets,
            version: vec![0; n],
        }
    }

    /// Sheets by their smallest facet.
    pub fn roots(&self) -> Vec<u32> {
        (0..self.facets.len() as u32)
            .filter(|&f| !self.facets[f as usize].is_empty())
            .collect()
    }

    pub fn facets(&self, root: u32) -> &[u32] {
        &self.facets[root as usize]
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.sets.find(a), self.sets.find(b));
        if a == b {
            return;
        }
        self.sets.union(a, b);
        let (root, other) = (a.min(b), a.max(b));
        let moved = std::mem::take(&mut self.facets[other as usize]);
        let kept = &mut self.facets[root as usize];
        if kept.len() < moved.len() {
            let small = std::mem::replace(kept, moved);
            kept.extend(small);
        } else {
            kept.extend(moved);
        }
    }
}

/// What the splice needs beside the complex.
pub(crate) struct Splicer<'a> {
    pub measure: &'a Measure,
    /// Erosion thickness of each facet in tolerances.
    pub relative: &'a [f64],
    /// Largest cost, in tolerances.
    pub limit: f64,
    /// Movement, in tolerances, below which a sheet goes up to an erosion thickness of `slight_erosion` tolerances.
    pub slight_move: f64,
    pub slight_erosion: f64,
    pub wire: f64,
    /// Cost by counts: sheets of fewer generators go.
    pub count: Option<u32>,
}

impl Splicer<'_> {
    /// Splices until no sheet is cheap enough. Returns the number of sheets removed.
    pub fn run(
        &self,
        complex: &mut Complex,
        fire: &mut WireFire,
        cover: &mut Cover,
        history: &mut Vec<Event>,
    ) -> usize {
        let mut sheets = Sheets::new(complex);
        let mut queue = BinaryHeap::new();
        for root in sheets.roots() {
            if let Some(cost) = self.cost(complex, fire, cover, sheets.facets(root)) {
                queue.push(Reverse((OrderedFloat(cost), root, 0u32)));
            }
        }
        let mut removed = 0;
        while let Some(Reverse((OrderedFloat(cost), root, version))) = queue.pop() {
            if sheets.version[root as usize] != version || sheets.facets(root).is_empty() {
                continue;
            }
            let since = complex.log.len();
            let facets = sheets.facets[root as usize].clone();
            if !self.remove(complex, fire, &facets) {
                complex.undo_to(since);
                continue;
            }
            if self.count.is_none() && cost > self.limit {
                remove_spines(complex, &facets);
            }
            let movement = cover.movement(complex, since, Some(1.0), 1.0);
            if self.count.is_none() && movement.worst > 1.0 {
                complex.undo_to(since);
                history.push(Event::skipped(
                    Kind::Splice,
                    self.mm(complex, &facets, cost),
                    self.place(&facets),
                ));
                continue;
            }
            cover.accept(complex, since, movement);
            history.push(Event::applied(
                Kind::Splice,
                self.mm(complex, &facets, cost),
                self.place(&facets),
                since,
                complex.log.len(),
            ));
            removed += 1;
            sheets.facets[root as usize].clear();
            let mut touched: Vec<u32> = Vec::new();
            for step in &complex.log[since..] {
                let &Step::RemoveFacet { facet, .. } = step else {
                    continue;
                };
                for &e in complex.fine.facet_edges(facet as usize) {
                    if !complex.edge_alive[e as usize] || complex.edge_count[e as usize] == 0 {
                        continue;
                    }
                    let mut near = complex.alive_facets(e);
                    match (complex.edge_count[e as usize], near.next(), near.next()) {
                        (1, Some(a), _) => touched.push(a),
                        (2, Some(a), Some(b)) => {
                            sheets.join(a, b);
                            touched.push(a);
                        }
                        _ => {}
                    }
                }
            }
            for f in &mut touched {
                *f = sheets.sets.find(*f);
            }
            touched.sort_unstable();
            touched.dedup();
            for root in touched {
                sheets.version[root as usize] += 1;
                if let Some(cost) = self.cost(complex, fire, cover, sheets.facets(root)) {
                    queue.push(Reverse((OrderedFloat(cost), root, sheets.version[root as usize])));
                }
            }
        }
        removed
    }

    /// Cost of a sheet in tolerances, when it may go at all.
    fn cost(&self, complex: &mut Complex, fire: &mut WireFire, cover: &Cover, facets: &[u32]) -> Option<f64> {
        let fine = complex.fine;
        let free = facets
            .iter()
            .any(|&f| fine.facet_edges(f as usize).iter().any(|&e| complex.is_rib(e)));
        if !free {
            return None;
        }
        if let Some(threshold) = self.count {
            let mut generators: Vec<u32> = facets
                .iter()
                .flat_map(|&f| fine.facet_generators[f as usize].map(|g| g.0))
                .collect();
            generators.sort_unstable();
            generators.dedup();
            return (generators.len() < threshold as usize).then_some(generators.len() as f64);
        }
        let area: f64 = facets.iter().map(|&f| self.measure.facet_area[f as usize]).sum();
        let tau = self.measure.tolerance.of_facets(fine, facets);
        let largest = facets
            .iter()
            .map(|&f| self.relative[f as usize])
            .fold(f64::NEG_INFINITY, f64::max);
        let cost = if area < (2.0 * tau).powi(2) {
            self.trial(complex, fire, cover, facets)?
        } else {
            largest
        };
        if cost <= self.limit {
            return Some(cost);
        }
        // A large erosion thickness and yet no part of the surface that needs the sheet.
        let alone = !facets
            .iter()
            .flat_map(|&f| fine.facet_edges(f as usize))
            .any(|&e| complex.edge_count[e as usize] > 2);
        let most = self.slight_move * if alone { ALONE } else { 1.0 };
        let small = area < (LARGEST_SLIGHT * tau).powi(2);
        if !small || largest > self.slight_erosion {
            return None;
        }
        let since = complex.log.len();
        let gone = self.remove(complex, fire, facets);
        if gone {
            remove_spines(complex, facets);
        }
        let slight = gone && {
            let movement = cover.movement(complex, since, Some(most), most);
            movement.worst <= most
        };
        complex.undo_to(since);
        slight.then_some(largest)
    }

    /// Movement of the surface if the sheet went.
    fn trial(
        &self,
        complex: &mut Complex,
        fire: &mut WireFire,
        cover: &Cover,
        facets: &[u32],
    ) -> Option<f64> {
        let since = complex.log.len();
        let gone = self.remove(complex, fire, facets);
        let worst = cover.movement(complex, since, None, f64::INFINITY).worst;
        complex.undo_to(since);
        gone.then_some(worst)
    }

    /// Collapses a sheet and prunes what is left of it; whether it went whole.
    fn remove(&self, complex: &mut Complex, fire: &mut WireFire, facets: &[u32]) -> bool {
        let since = complex.log.len();
        let mut own = facets.to_vec();
        own.sort_unstable();
        collapse_facets(complex, self.measure, own.iter().copied(), |f| {
            own.binary_search(&f).is_ok().then(|| self.relative[f as usize])
        });
        if complex.log.len() - since < facets.len() {
            return false;
        }
        let mut vertices: Vec<u32> = facets
            .iter()
            .flat_map(|&f| complex.fine.facet_vertices(f as usize).iter().copied())
            .collect();
        vertices.sort_unstable();
        vertices.dedup();
        fire.prune_from(complex, self.measure, self.wire * self.limit, &vertices);
        true
    }

    fn mm(&self, complex: &Complex, facets: &[u32], cost: f64) -> f64 {
        if self.count.is_some() {
            return cost;
        }
        cost * self.measure.tolerance.of_facets(complex.fine, facets)
    }

    /// Where a sheet is: the centre of its thickest facet.
    fn place(&self, facets: &[u32]) -> glam::DVec3 {
        facets
            .iter()
            .copied()
            .max_by(|&a, &b| {
                self.relative[a as usize]
                    .total_cmp(&self.relative[b as usize])
                    .then(b.cmp(&a))
            })
            .map_or(glam::DVec3::ZERO, |f| self.measure.facet_centre[f as usize])
    }
}
