//! Step 9: spines. Where a sheet went, a few generators at its rib (the crest of a ridge, a corner) are left as far from the medial
//! balls as the sheet's erosion thickness, which the tolerance allows; most others are touched. A spine, a path of single edges from a
//! sheet to one ball that reaches such generators, gives them back at no cost to the graph: it is part of the complex, of its
//! surface and its history, but no element ([`Regularised::spines`](super::Regularised::spines)).
//!
//! 1. the generators farther than `from` tolerances from every ball, the worst first;
//! 2. the shortest way along removed edges from a sheet to every removed vertex, up to `longest` tolerances;
//! 3. of the ways to the balls that touch the generator, cut off where a ball comes near enough, the shortest grows back.
//!
//! Elementary expansions only. It comes after the seams, because which curves there are is settled then. Where no such way is, on
//! wires above all, the generator stays as it was, within the tolerance. Cost `O(n log n)`.

use super::balls::BallTree;
use super::complex::Complex;
use super::cover::Cover;
use super::fidelity::Nearest;
use super::measure::Measure;
use super::queue::Queue;
use crate::fine_scaffold::complex::NONE;
use std::collections::BTreeMap;

/// Which generators get a spine, and how long it may be. Both in tolerances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spines {
    pub from: f64,
    pub longest: f64,
}

/// Grows spines and brings `nearest` up to date. Returns their edges.
pub(crate) fn grow_spines(
    complex: &mut Complex,
    measure: &Measure,
    cover: &Cover,
    spines: Spines,
    nearest: &mut Nearest,
) -> Vec<u32> {
    let fine = complex.fine;
    let share = |g: u32| nearest.distance_mm[g as usize] / cover.tolerance(g as usize);
    let mut far: Vec<u32> = (0..nearest.distance_mm.len() as u32)
        .filter(|&g| share(g) > spines.from)
        .collect();
    if far.is_empty() {
        return Vec::new();
    }
    far.sort_by(|&a, &b| share(b).total_cmp(&share(a)).then(a.cmp(&b)));
    let touching = touching(complex, &far);
    let ways = Ways::from_sheets(complex, measure, spines.longest);
    let (mut edges, mut vertices) = (Vec::new(), Vec::new());
    for g in far {
        let point = fine.generator_position[g as usize];
        let enough = spines.from * cover.tolerance(g as usize);
        let reaches = |v: u32| {
            point.distance(fine.vertex_position[v as usize]) - fine.vertex_radius[v as usize] <= enough
        };
        if vertices.iter().any(|&v| reaches(v)) {
            continue;
        }
        let ends = touching[&g]
            .iter()
            .filter_map(|&v| ways.nearest_on_way(complex, v, reaches));
        let Some(end) = ends.min_by(|&a, &b| ways.length(a).total_cmp(&ways.length(b)).then(a.cmp(&b)))
        else {
            continue;
        };
        for (edge, vertex) in ways.to(complex, end) {
            complex.add_edge(edge, vertex);
            edges.push(edge);
            vertices.push(vertex);
        }
    }
    let tree = BallTree::new(vertices, &fine.vertex_position, &fine.vertex_radius);
    for (g, distance) in nearest
        .distance_mm
        .iter_mut()
        .enumerate()
        .filter(|(_, d)| **d > 0.0)
    {
        let ball = tree.nearest(fine.generator_position[g], None, |_| true);
        if let Some(ball) = ball.filter(|b| b.distance < *distance) {
            *distance = ball.distance.max(0.0);
            nearest.vertex[g] = ball.id;
        }
    }
    edges
}

/// The vertices whose balls touch each of some generators.
fn touching(complex: &Complex, generators: &[u32]) -> BTreeMap<u32, Vec<u32>> {
    let fine = complex.fine;
    let mut wanted = vec![false; fine.generator_position.len()];
    for &g in generators {
        wanted[g as usize] = true;
    }
    let mut out: BTreeMap<u32, Vec<u32>> = generators.iter().map(|&g| (g, Vec::new())).collect();
    for (ends, triangle) in fine.edge_vertices.iter().zip(&fine.edge_generators) {
        for g in triangle.iter().filter(|g| wanted[g.index()]) {
            out.entry(g.0).or_default().extend(ends);
        }
    }
    for vertices in out.values_mut() {
        vertices.sort_unstable();
        vertices.dedup();
    }
    out
}

/// Shortest ways from the sheets along removed edges.
struct Ways {
    length: Vec<f64>,
    /// Edge by which each vertex is reached; `NONE` at the sheets and where no way comes.
    edge: Vec<u32>,
}

impl Ways {
    fn from_sheets(complex: &Complex, measure: &Measure, longest: f64) -> Self {
        let fine = complex.fine;
        let mut out = Self {
            length: vec![f64::INFINITY; fine.num_vertices()],
            edge: vec![NONE; fine.num_vertices()],
        };
        let mut queue = Queue::new();
        for f in (0..fine.num_facets()).filter(|&f| complex.facet_alive[f]) {
            for &v in fine.facet_vertices(f) {
                if out.length[v as usize] > 0.0 {
                    out.length[v as usize] = 0.0;
                    queue.push(0.0, v);
                }
            }
        }
        while let Some((way, v)) = queue.pop() {
            if way > out.length[v as usize] {
                continue;
            }
            for e in fine.edges_of_vertex(v as usize) {
                let to = fine.other_end(e as usize, v) as usize;
                if complex.edge_alive[e as usize] || complex.vertex_alive[to] || fine.vertex_outside[to] {
                    continue;
                }
                let next = way + fine.vertex_position[v as usize].distance(fine.vertex_position[to]);
                if next < out.length[to] && next <= longest * measure.tolerance.at(to as u32) {
                    out.length[to] = next;
                    out.edge[to] = e;
                    queue.push(next, to as u32);
                }
            }
        }
        out
    }

    fn length(&self, vertex: u32) -> f64 {
        self.length[vertex as usize]
    }

    /// The first vertex on the way to a given one, sheet side first, that `reaches`.
    fn nearest_on_way(&self, complex: &Complex, vertex: u32, reaches: impl Fn(u32) -> bool) -> Option<u32> {
        let mut on_way = vec![vertex];
        on_way.extend(
            self.to(complex, vertex)
                .iter()
                .rev()
                .map(|&(e, v)| complex.fine.other_end(e as usize, v)),
        );
        let known = self.length[vertex as usize].is_finite();
        on_way.into_iter().rev().find(|&v| known && reaches(v))
    }

    /// The removed edges on the way to a vertex, each with its far end, from the sheet on.
    fn to(&self, complex: &Complex, vertex: u32) -> Vec<(u32, u32)> {
        let mut way = Vec::new();
        let mut at = vertex;
        while !complex.vertex_alive[at as usize] && self.edge[at as usize] != NONE {
            let edge = self.edge[at as usize];
            way.push((edge, at));
            at = complex.fine.other_end(edge as usize, at);
        }
        way.reverse();
        way
    }
}
