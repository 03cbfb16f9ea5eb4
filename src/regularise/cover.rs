//! How far the surface has moved: every generator keeps a *witness*, an alive vertex whose ball comes within the tolerance of
//! it. When a step removes witnesses, new ones are sought; if a generator finds none, the step moved the surface too far.
//!
//! Balls at vertices only, not interpolated over edges and facets: the union is a little smaller than the true one, so
//! the movement found is never too small.

use super::balls::BallTree;
use super::complex::{Complex, Step};
use super::measure::Measure;
use crate::fine_scaffold::complex::NONE;

#[derive(Clone, Debug)]
pub(crate) struct Cover {
    tree: BallTree,
    /// Tolerance at each generator, mm.
    tolerance: Vec<f64>,
    witness: Vec<u32>,
    /// Generators of each witness, as linked lists.
    first: Vec<u32>,
    next: Vec<u32>,
}

/// What removing some vertices would do.
#[derive(Clone, Debug, Default)]
pub(crate) struct Move {
    /// Largest movement of the surface, in tolerances.
    pub worst: f64,
    /// New witnesses.
    witness: Vec<(u32, u32)>,
}

impl Cover {
    /// A cover by the alive vertices. Generators without a vertex of the complex (none of their tetrahedra is of the side)
    /// take no part. `known` are tolerances of an earlier cover.
    pub fn new(complex: &Complex, measure: &Measure, known: Option<Cover>) -> Self {
        let fine = complex.fine;
        let alive: Vec<u32> = (0..fine.num_vertices() as u32)
            .filter(|&v| complex.vertex_alive[v as usize])
            .collect();
        let mut first = vec![NONE; fine.num_vertices()];
        let n = fine.generator_position.len();
        let mut next = vec![NONE; n];
        let (touching, best) = touching_vertices(complex, measure);
        let tolerance = known.map_or_else(
            || {
                (0..n)
                    .map(|g| {
                        if best[g] == NONE {
                            f64::INFINITY
                        } else {
                            measure.tolerance.at(best[g])
                        }
                    })
                    .collect()
            },
            |cover| cover.tolerance,
        );
        let mut cover = Self {
            tree: BallTree::new(alive, &fine.vertex_position, &fine.vertex_radius),
            tolerance,
            witness: touching,
            first: Vec::new(),
            next: Vec::new(),
        };
        for g in 0..n {
            if cover.witness[g] == NONE && cover.tolerance[g].is_finite() {
                let enough = Some(cover.tolerance[g]);
                let near = cover.tree.nearest(fine.generator_position[g], enough, |_| true);
                cover.witness[g] = near.map_or(NONE, |b| b.id);
            }
            let w = cover.witness[g];
            if w != NONE {
                next[g] = first[w as usize];
                first[w as usize] = g as u32;
            }
        }
        cover.first = first;
        cover.next = next;
        cover
    }

    /// Movement caused by the steps of the log from `since` on, in tolerances: exact where it is above `enough`, any value up to
    /// `enough` where it is below; above `stop` the first one found.
    pub fn movement(&self, complex: &Complex, since: usize, enough: Option<f64>, stop: f64) -> Move {
        let fine = complex.fine;
        let mut out = Move::default();
        for step in &complex.log[since..] {
            let &Step::RemoveEdge { vertex, .. } = step else {
                continue;
            };
            let mut g = self.first[vertex as usize];
            while g != NONE {
                let tau = self.tolerance[g as usize];
                let found = self.tree.nearest(
                    fine.generator_position[g as usize],
                    enough.map(|x| x * tau),
                    |v| complex.vertex_alive[v as usize],
                );
                let (id, distance) = found.map_or((NONE, f64::INFINITY), |b| (b.id, b.distance));
                out.worst = out.worst.max(distance / tau);
                if id != NONE {
                    out.witness.push((g, id));
                }
                if out.worst > stop {
                    return out;
                }
                g = self.next[g as usize];
            }
        }
        out
    }

    /// Makes the new witnesses of a movement that is accepted the witnesses.
    pub fn accept(&mut self, complex: &Complex, since: usize, movement: Move) {
        for step in &complex.log[since..] {
            if let &Step::RemoveEdge { vertex, .. } = step {
                self.first[vertex as usize] = NONE;
            }
        }
        for (g, v) in movement.witness {
            self.witness[g as usize] = v;
            self.next[g as usize] = self.first[v as usize];
            self.first[v as usize] = g;
        }
    }

    /// The last known witness of a generator; none, or one that has gone since or is too far, where it has none.
    pub fn witness(&self, generator: usize) -> u32 {
        self.witness[generator]
    }

    /// Tolerance at a generator, mm.
    pub fn tolerance(&self, generator: usize) -> f64 {
        self.tolerance[generator]
    }
}

/// For each generator an alive vertex of its Voronoi cell (whose ball it touches), and the ball of its cell in the
/// whole fine scaffold that gives its tolerance: of those of the thickest part the largest.
fn touching_vertices(complex: &Complex, measure: &Measure) -> (Vec<u32>, Vec<u32>) {
    let fine = complex.fine;
    let n = fine.generator_position.len();
    let (mut touching, mut largest) = (vec![NONE; n], vec![NONE; n]);
    let offer = |slot: &mut u32, v: u32| {
        let size = |v: u32| (measure.tolerance.at(v), fine.vertex_radius[v as usize]);
        let better = *slot == NONE || size(v) > size(*slot);
        if better && !fine.vertex_outside[v as usize] {
            *slot = v;
        }
    };
    for (e, triangle) in fine.edge_generators.iter().enumerate() {
        for v in fine.edge_vertices[e] {
            for g in triangle {
                offer(&mut largest[g.index()], v);
                if complex.vertex_alive[v as usize] {
                    offer(&mut touching[g.index()], v);
                }
            }
        }
    }
    (touching, largest)
}
