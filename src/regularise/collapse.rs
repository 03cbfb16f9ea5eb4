//! Step 3: collapse in the order of erosion thickness, from the ribs inward, then wires from their tips.
//!
//! A facet goes through its free edge of least radius. What has lost all its facets is a wire; wires are pruned by the erosion
//! thickness of curves: distance from the tip plus the tip's radius, less the radius where one is. The fire on wires
//! is remembered between calls: starting it anew at every call would eat a wire from its end, piece by piece.

use super::complex::Complex;
use super::measure::Measure;
use super::queue::Queue;

/// Collapses alive facets that `key` gives a value below `limit`, cheapest first, starting from the candidates given.
pub(crate) fn collapse_facets(
    complex: &mut Complex,
    measure: &Measure,
    candidates: impl Iterator<Item = u32>,
    key: impl Fn(u32) -> Option<f64>,
) {
    let fine = complex.fine;
    let mut queue = Queue::new();
    for f in candidates {
        if complex.facet_alive[f as usize]
            && complex.free_edge(f, &measure.edge_radius).is_some()
            && let Some(k) = key(f)
        {
            queue.push(k, f);
        }
    }
    while let Some((_, f)) = queue.pop() {
        if !complex.facet_alive[f as usize] {
            continue;
        }
        let Some(free) = complex.free_edge(f, &measure.edge_radius) else {
            continue;
        };
        complex.remove_facet(f, free);
        for &e in fine.facet_edges(f as usize) {
            if complex.is_rib(e)
                && let Some(g) = complex.alive_facets(e).next()
                && let Some(k) = key(g)
            {
                queue.push(k, g);
            }
        }
    }
}

/// The fire on wires.
#[derive(Clone, Debug)]
pub(crate) struct WireFire {
    /// Burn time at each vertex the fire has reached; NaN elsewhere.
    time: Vec<f64>,
    /// Vertex each time is measured from.
    source: Vec<u32>,
}

impl WireFire {
    pub fn new(vertices: usize) -> Self {
        Self {
            time: vec![f64::NAN; vertices],
            source: (0..vertices as u32).collect(),
        }
    }

    /// Erosion thickness at a vertex, mm; `None` where the fire has not been.
    pub fn erosion(&self, complex: &Complex, vertex: u32) -> Option<f64> {
        let t = self.time[vertex as usize];
        (!t.is_nan()).then(|| t - complex.fine.signed_radius(vertex as usize))
    }

    /// The fire takes hold at a tip, unless it has come there already.
    fn light(&mut self, complex: &Complex, vertex: u32) -> f64 {
        let radius = complex.fine.signed_radius(vertex as usize);
        if self.time[vertex as usize].is_nan() {
            self.time[vertex as usize] = radius;
        }
        self.time[vertex as usize] - radius
    }

    /// The fire runs from a burnt vertex to the next one; of several arrivals the last counts.
    fn spread(&mut self, complex: &Complex, from: u32, to: u32) {
        let fine = complex.fine;
        let source = self.source[from as usize];
        let run = fine.vertex_position[source as usize].distance(fine.vertex_position[to as usize]);
        let arrival = self.time[source as usize] + run;
        let radius = fine.signed_radius(to as usize);
        let (arrival, source) = if arrival < radius {
            (radius, to)
        } else {
            (arrival, source)
        };
        let known = self.time[to as usize];
        if known.is_nan() || known < arrival {
            self.time[to as usize] = arrival;
            self.source[to as usize] = source;
        }
    }

    /// Prunes wires from their tips while their erosion thickness is below `factor` tolerances; only from the given
    /// vertices when there are any. Returns the number of edges removed.
    pub fn prune(&mut self, complex: &mut Complex, measure: &Measure, factor: f64) -> usize {
        let tips = (0..complex.fine.num_vertices() as u32).collect::<Vec<_>>();
        self.prune_from(complex, measure, factor, &tips)
    }

    /// As [`WireFire::prune`], starting from some vertices.
    pub fn prune_from(
        &mut self,
        complex: &mut Complex,
        measure: &Measure,
        factor: f64,
        vertices: &[u32],
    ) -> usize {
        let mut queue = Queue::new();
        for &v in vertices {
            if complex.wire_at_tip(v).is_some() {
                queue.push(self.light(complex, v), v);
            }
        }
        let mut removed = 0;
        while let Some((key, v)) = queue.pop() {
            let Some(edge) = complex.wire_at_tip(v) else {
                continue;
            };
            let limit = factor * measure.tolerance.at(v);
            if key >= limit {
                continue;
            }
            let next = complex.fine.other_end(edge as usize, v);
            self.spread(complex, v, next);
            complex.remove_edge(edge, v);
            removed += 1;
            if complex.wire_at_tip(next).is_some() {
                queue.push(self.light(complex, next), next);
            }
        }
        removed
    }
}
