//! Fidelity: how far the surface is from what the scaffold says it is, and the repair where that is too far.
//!
//! The distance is from each generator to the union of the medial balls of the alive vertices; balls interpolated over
//! edges and facets would only be nearer, so the number is never too good. Where it exceeds the tolerance, the removed
//! vertex whose return costs least is brought back together with everything it hangs on: a removal can be reversed as
//! soon as what was removed after it on its faces is back, so following the log forward from it gives elementary expansions only.

use super::balls::{BallTree, near_order};
use super::complex::{Complex, Step};
use super::cover::Cover;
use crate::fine_scaffold::complex::NONE;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Distances from the generators to the union of medial balls.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fidelity {
    /// Largest distance, mm.
    pub max_mm: f64,
    /// Mean distance, mm.
    pub mean_mm: f64,
    /// 95th percentile, mm.
    pub p95_mm: f64,
    /// Largest distance in local tolerances; at most 1 when the tolerance was kept.
    pub max_tolerances: f64,
}

/// The nearest alive ball of each generator.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nearest {
    /// Distance of the generator to the union of alive balls, mm; 0 where a ball touches it, NaN for generators without any
    /// tetrahedron of the side.
    pub distance_mm: Vec<f64>,
    /// Vertex of that ball, where it had to be looked for.
    pub vertex: Vec<u32>,
}

/// For each generator whether an alive vertex lies on its Voronoi cell, whose ball touches it.
fn touched(complex: &Complex) -> Vec<bool> {
    let fine = complex.fine;
    let mut touched = vec![false; fine.generator_position.len()];
    for (e, triangle) in fine.edge_generators.iter().enumerate() {
        let [a, b] = fine.edge_vertices[e];
        if complex.vertex_alive[a as usize] || complex.vertex_alive[b as usize] {
            for g in triangle {
                touched[g.index()] = true;
            }
        }
    }
    touched
}

/// The balls of the alive vertices.
pub(crate) fn alive_balls(complex: &Complex) -> BallTree {
    let fine = complex.fine;
    let alive: Vec<u32> = (0..fine.num_vertices() as u32)
        .filter(|&v| complex.vertex_alive[v as usize])
        .collect();
    BallTree::new(alive, &fine.vertex_position, &fine.vertex_radius)
}

/// The alive ball nearest to each generator, exactly.
pub(crate) fn nearest(complex: &Complex, tree: &BallTree, cover: &Cover) -> Nearest {
    let fine = complex.fine;
    let touched = touched(complex);
    let order = near_order(&fine.generator_position);
    let found: Vec<(f64, u32)> = order
        .par_iter()
        .map(|&g| {
            let g = g as usize;
            if !cover.tolerance(g).is_finite() {
                return (f64::NAN, NONE);
            }
            if touched[g] {
                return (0.0, NONE);
            }
            tree.nearest(fine.generator_position[g], None, |_| true)
                .map_or((f64::INFINITY, NONE), |b| (b.distance.max(0.0), b.id))
        })
        .collect();
    let mut out = Nearest {
        distance_mm: vec![f64::NAN; order.len()],
        vertex: vec![NONE; order.len()],
    };
    for (g, (distance_mm, vertex)) in order.into_iter().zip(found) {
        out.distance_mm[g as usize] = distance_mm;
        out.vertex[g as usize] = vertex;
    }
    out
}

/// The generators that no alive ball comes within the tolerance of, ascending.
pub(crate) fn offending(complex: &Complex, tree: &BallTree, cover: &Cover) -> Vec<u32> {
    let fine = complex.fine;
    let touched = touched(complex);
    (0..touched.len() as u32)
        .into_par_iter()
        .filter(|&g| {
            let (point, tau) = (fine.generator_position[g as usize], cover.tolerance(g as usize));
            let distance =
                |v: u32| point.distance(fine.vertex_position[v as usize]) - fine.vertex_radius[v as usize];
            // Most keep the witness they had.
            let kept = |v: u32| v != NONE && complex.vertex_alive[v as usize] && distance(v).max(0.0) <= tau;
            tau.is_finite()
                && !touched[g as usize]
                && !kept(cover.witness(g as usize))
                && tree
                    .nearest(point, Some(tau), |_| true)
                    .is_none_or(|b| b.distance.max(0.0) > tau)
        })
        .collect()
}

impl Fidelity {
    pub(crate) fn of(distances: &[f64], cover: &Cover) -> Self {
        let mut known: Vec<f64> = distances.iter().copied().filter(|d| !d.is_nan()).collect();
        known.sort_unstable_by(f64::total_cmp);
        let Some(&max_mm) = known.last() else {
            return Self::default();
        };
        let max_tolerances = distances
            .iter()
            .enumerate()
            .filter(|(_, d)| !d.is_nan())
            .map(|(g, d)| d / cover.tolerance(g))
            .fold(0.0, f64::max);
        Self {
            max_mm,
            mean_mm: known.iter().sum::<f64>() / known.len() as f64,
            p95_mm: known[(known.len() - 1) * 95 / 100],
            max_tolerances,
        }
    }
}

/// For each removed element the step that removed it; valid for a log of removals only.
struct Removals {
    facet: Vec<u32>,
    edge: Vec<u32>,
    vertex: Vec<u32>,
}

impl Removals {
    fn new(complex: &Complex) -> Self {
        let fine = complex.fine;
        let mut out = Self {
            facet: vec![NONE; fine.num_facets()],
            edge: vec![NONE; fine.num_edges()],
            vertex: vec![NONE; fine.num_vertices()],
        };
        for (i, step) in complex.log.iter().enumerate() {
            match *step {
                Step::RemoveCell { facet, .. } => out.facet[facet as usize] = i as u32,
                Step::RemoveFacet { facet, edge } => {
                    out.facet[facet as usize] = i as u32;
                    out.edge[edge as usize] = i as u32;
                }
                Step::RemoveEdge { edge, vertex } => {
                    out.edge[edge as usize] = i as u32;
                    out.vertex[vertex as usize] = i as u32;
                }
                Step::AddFacet { facet, edge } => {
                    out.facet[facet as usize] = NONE;
                    out.edge[edge as usize] = NONE;
                }
                Step::AddEdge { edge, vertex } => {
                    out.edge[edge as usize] = NONE;
                    out.vertex[vertex as usize] = NONE;
                }
            }
        }
        out
    }
}

/// Brings back removed vertices so that every generator named is within its tolerance of a ball. Works on a log of removals,
/// possibly followed by restorations. Returns the number of steps.
pub(crate) fn restore(complex: &mut Complex, cover: &Cover, generators: &[u32]) -> usize {
    let fine = complex.fine;
    let removals = Removals::new(complex);
    let dead: Vec<u32> = (0..fine.num_vertices() as u32)
        .filter(|&v| !complex.vertex_alive[v as usize] && !fine.vertex_outside[v as usize])
        .collect();
    // The vertex removed last hangs on least: look among the latest removals first, in shares of doubling size.
    let mut by_time = dead;
    by_time.sort_unstable_by_key(|&v| std::cmp::Reverse(removals.vertex[v as usize]));
    let before = complex.log.len();
    let mut shares = Vec::new();
    let (mut start, mut size) = (0, (by_time.len() / 64).max(256));
    while start < by_time.len() {
        let end = (start + size).min(by_time.len());
        shares.push(BallTree::new(
            by_time[start..end].to_vec(),
            &fine.vertex_position,
            &fine.vertex_radius,
        ));
        start = end;
        size *= 2;
    }
    for &g in generators {
        let point = fine.generator_position[g as usize];
        let tau = cover.tolerance(g as usize);
        let covered =
            |v: u32| point.distance(fine.vertex_position[v as usize]) - fine.vertex_radius[v as usize] <= tau;
        // An earlier restoration may have covered it.
        let already = complex.log[before..]
            .iter()
            .any(|step| matches!(*step, Step::AddEdge { vertex, .. } if covered(vertex)));
        if already {
            continue;
        }
        let found = shares.iter().find_map(|tree| {
            tree.nearest(point, Some(tau), |_| true)
                .filter(|ball| ball.distance <= tau)
        });
        if let Some(ball) = found {
            bring_back(complex, &removals, ball.id);
        }
    }
    complex.log.len() - before
}

/// Brings back a removed vertex: the steps that removed it and everything it hangs on are reversed, the latest first.
fn bring_back(complex: &mut Complex, removals: &Removals, vertex: u32) {
    let mut needed = std::collections::BTreeSet::new();
    let mut open = vec![removals.vertex[vertex as usize]];
    while let Some(step) = open.pop() {
        if step == NONE || !needed.insert(step) {
            continue;
        }
        match complex.log[step as usize] {
            Step::RemoveEdge { edge, vertex } => {
                let next = complex.fine.other_end(edge as usize, vertex);
                if !complex.vertex_alive[next as usize] {
                    open.push(removals.vertex[next as usize]);
                }
            }
            Step::RemoveFacet { facet, edge } => {
                for &e in complex.fine.facet_edges(facet as usize) {
                    if e != edge && !complex.edge_alive[e as usize] {
                        open.push(removals.edge[e as usize]);
                    }
                }
                // The ends of the freed edge may have gone later, as tips of wires.
                for v in complex.fine.edge_vertices[edge as usize] {
                    if !complex.vertex_alive[v as usize] {
                        open.push(removals.vertex[v as usize]);
                    }
                }
            }
            _ => {}
        }
    }
    for &step in needed.iter().rev() {
        match complex.log[step as usize] {
            Step::RemoveEdge { edge, vertex } if !complex.edge_alive[edge as usize] => {
                complex.add_edge(edge, vertex);
            }
            Step::RemoveFacet { facet, edge } if !complex.facet_alive[facet as usize] => {
                complex.add_facet(facet, edge);
            }
            _ => {}
        }
    }
}
