//! Step 4b: fins are trimmed by hysteresis.
//!
//! An axial curve exists because three sheets meet; the third-highest erosion thickness at an edge says how far the lowest of
//! them goes, and what it is along a given length of a curve ([`lasting`]) is the curve's *persistence*: its maximum is too often that of a
//! single facet at a node, and jumps by a factor of two between samplings. The lowest sheet of a curve of too little persistence
//! is a fin. It cannot be spliced when it runs into its neighbours round the end of the curve; so it is flooded from the
//! curve outward, through facets of small ET only, just as far as is needed to collapse it away.

use super::collapse::{WireFire, collapse_facets};
use super::complex::Complex;
use super::cover::Cover;
use super::history::{Event, Kind};
use super::measure::Measure;
use super::queue::Queue;
use crate::fine_scaffold::complex::NONE;
use crate::geometry::mesh::DisjointSets;
use std::collections::BTreeMap;

/// A maximal chain of axial edges joined at vertices where only two axial edges meet.
#[derive(Clone, Debug)]
pub(crate) struct AxialChain {
    pub edges: Vec<u32>,
    /// What the third-highest value at an edge is along the persistence length; see [`lasting`].
    pub persistence: f64,
}

/// A value at a piece of a curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Along {
    pub value: f64,
    /// Length of the piece, in local tolerances.
    pub length: f64,
}

/// The largest value that pieces of `length` in all reach, or half of the curve where that is less: a quantile by length, so that
/// no single edge decides. The maximum when the length is 0; 0 of nothing.
pub(crate) fn lasting(mut pieces: Vec<Along>, length: f64) -> f64 {
    pieces.sort_unstable_by(|a, b| b.value.total_cmp(&a.value).then(a.length.total_cmp(&b.length)));
    let whole: f64 = pieces.iter().map(|p| p.length).sum();
    let wanted = length.min(0.5 * whole);
    let mut walked = 0.0;
    for piece in pieces {
        walked += piece.length;
        if walked >= wanted {
            return piece.value;
        }
    }
    0.0
}

/// Number of alive axial edges at each vertex.
pub(crate) fn axial_degree(complex: &Complex) -> Vec<u8> {
    let mut degree = vec![0u8; complex.fine.num_vertices()];
    for e in 0..complex.fine.num_edges() {
        if complex.edge_alive[e] && complex.edge_count[e] >= 3 {
            for v in complex.fine.edge_vertices[e] {
                degree[v as usize] += 1;
            }
        }
    }
    degree
}

/// The lowest alive facet of an edge and its value.
fn lowest(complex: &Complex, values: &[f64], edge: u32) -> (u32, f64) {
    complex
        .alive_facets(edge)
        .map(|f| (f, values[f as usize]))
        .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
        .unwrap_or((NONE, f64::INFINITY))
}

/// The axial chains with their persistence along `length` tolerances in the unit of `values`, in order of their smallest edge.
pub(crate) fn axial_chains(
    complex: &Complex,
    measure: &Measure,
    values: &[f64],
    length: f64,
) -> Vec<AxialChain> {
    let degree = axial_degree(complex);
    let edges: Vec<u32> = (0..complex.fine.num_edges() as u32)
        .filter(|&e| complex.edge_alive[e as usize] && complex.edge_count[e as usize] >= 3)
        .collect();
    let mut place = vec![NONE; complex.fine.num_vertices()];
    let mut sets = DisjointSets::new(edges.len());
    for (i, &e) in edges.iter().enumerate() {
        for v in complex.fine.edge_vertices[e as usize] {
            if degree[v as usize] != 2 {
                continue;
            }
            if place[v as usize] == NONE {
                place[v as usize] = i as u32;
            } else {
                sets.union(place[v as usize], i as u32);
            }
        }
    }
    let mut chains: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (i, &e) in edges.iter().enumerate() {
        chains.entry(sets.find(i as u32)).or_default().push(e);
    }
    let piece = |&e: &u32| {
        let ends = &complex.fine.edge_vertices[e as usize];
        let [a, b] = ends.map(|v| complex.fine.vertex_position[v as usize]);
        Along {
            // Triangles have three edges, so at most three facets meet at an edge: the third-highest is the lowest.
            value: lowest(complex, values, e).1,
            length: a.distance(b) / measure.tolerance.over(ends),
        }
    };
    chains
        .into_values()
        .map(|edges| AxialChain {
            persistence: lasting(edges.iter().map(piece).collect(), length),
            edges,
        })
        .collect()
}

/// Trims the fins of all axial chains of persistence below `limit` tolerances. Returns the number of chains that went.
pub(crate) fn trim_fins(
    complex: &mut Complex,
    measure: &Measure,
    relative: &[f64],
    limit: f64,
    length: f64,
    wire: f64,
    fire: &mut WireFire,
    cover: &mut Cover,
    history: &mut Vec<Event>,
) -> usize {
    let mut chains = axial_chains(complex, measure, relative, length);
    chains.retain(|c| c.persistence < limit);
    chains.sort_by(|a, b| {
        a.persistence
            .total_cmp(&b.persistence)
            .then(a.edges[0].cmp(&b.edges[0]))
    });
    let mut flood = Flood::new(complex.fine.num_facets());
    let mut trimmed = 0;
    for chain in chains {
        let still_axial = |complex: &Complex| {
            chain
                .edges
                .iter()
                .any(|&e| complex.edge_alive[e as usize] && complex.edge_count[e as usize] >= 3)
        };
        if !still_axial(complex) {
            continue;
        }
        let since = complex.log.len();
        let mut reach = flood.first_rib(complex, measure, relative, limit, &chain.edges) * 1.5;
        while reach.is_finite() {
            let (facets, exhausted) = flood.within(complex, measure, relative, limit, &chain.edges, reach);
            collapse_facets(complex, measure, facets.iter().copied(), |f| {
                flood.holds(f).then(|| relative[f as usize])
            });
            if exhausted || !still_axial(complex) {
                break;
            }
            reach *= 2.0;
        }
        if complex.log.len() == since {
            continue;
        }
        let vertices = removed_vertices(complex, since);
        fire.prune_from(complex, measure, wire * limit, &vertices);
        let place = measure.edge_middle[chain.edges[chain.edges.len() / 2] as usize];
        let start = &complex.fine.edge_vertices[chain.edges[0] as usize];
        let cost = chain.persistence * measure.tolerance.over(start);
        let movement = cover.movement(complex, since, Some(1.0), 1.0);
        if movement.worst > 1.0
            || still_axial(complex) && complex.log.len() - since > 4 * chain.edges.len() + 64
        {
            complex.undo_to(since);
            history.push(Event::skipped(Kind::TrimFin, cost, place));
            continue;
        }
        cover.accept(complex, since, movement);
        history.push(Event::applied(
            Kind::TrimFin,
            cost,
            place,
            since,
            complex.log.len(),
        ));
        trimmed += 1;
    }
    trimmed
}

/// Vertices of the facets removed since a point of the log, ascending.
pub(crate) fn removed_vertices(complex: &Complex, since: usize) -> Vec<u32> {
    let mut vertices: Vec<u32> = complex.log[since..]
        .iter()
        .flat_map(|step| match step {
            super::complex::Step::RemoveFacet { facet, .. } => complex.fine.facet_vertices(*facet as usize),
            _ => &[],
        })
        .copied()
        .collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// A flood over manifold edges through facets of small ET.
struct Flood {
    stamp: Vec<u32>,
    now: u32,
}

impl Flood {
    fn new(facets: usize) -> Self {
        Self {
            stamp: vec![0; facets],
            now: 0,
        }
    }

    fn holds(&self, facet: u32) -> bool {
        self.stamp[facet as usize] == self.now
    }

    /// Distance from the chain to the first facet with a rib; infinite when there is none.
    fn first_rib(
        &mut self,
        complex: &Complex,
        measure: &Measure,
        relative: &[f64],
        limit: f64,
        chain: &[u32],
    ) -> f64 {
        let mut found = f64::INFINITY;
        self.run(
            complex,
            measure,
            relative,
            limit,
            chain,
            f64::INFINITY,
            |f, distance| {
                if complex
                    .fine
                    .facet_edges(f as usize)
                    .iter()
                    .any(|&e| complex.is_rib(e))
                {
                    found = distance;
                }
                !found.is_finite()
            },
        );
        found
    }

    /// Facets within `reach` of the chain, and whether there are no others.
    fn within(
        &mut self,
        complex: &Complex,
        measure: &Measure,
        relative: &[f64],
        limit: f64,
        chain: &[u32],
        reach: f64,
    ) -> (Vec<u32>, bool) {
        let mut facets = Vec::new();
        let exhausted = self.run(complex, measure, relative, limit, chain, reach, |f, _| {
            facets.push(f);
            true
        });
        (facets, exhausted)
    }

    fn run(
        &mut self,
        complex: &Complex,
        measure: &Measure,
        relative: &[f64],
        limit: f64,
        chain: &[u32],
        reach: f64,
        mut visit: impl FnMut(u32, f64) -> bool,
    ) -> bool {
        self.now += 1;
        let mut queue = Queue::new();
        for &e in chain {
            if !complex.edge_alive[e as usize] || complex.edge_count[e as usize] < 3 {
                continue;
            }
            let (f, value) = lowest(complex, relative, e);
            if value < limit {
                queue.push(
                    measure.facet_centre[f as usize].distance(measure.edge_middle[e as usize]),
                    f,
                );
            }
        }
        while let Some((distance, f)) = queue.pop() {
            if self.holds(f) {
                continue;
            }
            if distance > reach {
                return false;
            }
            self.stamp[f as usize] = self.now;
            if !visit(f, distance) {
                return false;
            }
            for &e in complex.fine.facet_edges(f as usize) {
                if !complex.edge_alive[e as usize] || complex.edge_count[e as usize] != 2 {
                    continue;
                }
                for g in complex.alive_facets(e) {
                    if !self.holds(g) && relative[g as usize] < limit {
                        let run = measure.facet_centre[g as usize].distance(measure.facet_centre[f as usize]);
                        queue.push(distance + run, g);
                    }
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(list: &[(f64, f64)]) -> Vec<Along> {
        list.iter()
            .map(|&(value, length)| Along { value, length })
            .collect()
    }

    #[test]
    fn what_lasts_is_not_what_one_edge_has() {
        // A curve of length 10 that is 1 all along, with a last edge of length 0.2 at a node that is 9.
        let mut curve = vec![(1.0, 0.5); 20];
        curve.push((9.0, 0.2));
        assert_eq!(lasting(pieces(&curve), 0.0), 9.0);
        assert_eq!(lasting(pieces(&curve), 0.2), 9.0);
        assert_eq!(lasting(pieces(&curve), 1.0), 1.0);
        // Of a curve shorter than twice the length it is the median; the order along the curve does not matter.
        assert_eq!(lasting(pieces(&[(3.0, 0.1), (1.0, 0.1), (2.0, 0.1)]), 1.0), 2.0);
        assert_eq!(lasting(pieces(&[(5.0, 0.3)]), 1.0), 5.0);
        assert_eq!(lasting(Vec::new(), 1.0), 0.0);
    }
}
