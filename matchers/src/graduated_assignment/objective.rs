//! What is maximised: a quadratic gain over several coupled partial assignments.
//!
//! A block is one assignment (rows to columns, each at most once; unmatched has gain zero). With all blocks' variables
//! in one vector z, the gain is `G(z) = linear . z + 1/2 z K z`, K symmetric with a zero diagonal. Solvers see the
//! gain only through this trait, so that hypergraphs (three blocks coupled by incidences) and ordinary graphs (one
//! block coupled with itself through edges) share one annealing, one discretisation and one local search.

use crate::matching_problem::{INCIDENCE_KINDS, MatchingProblem};
use crate::table::Table;

/// One assignment variable: row and column of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variable {
    /// The block.
    pub block: usize,
    /// Row: an element of the target.
    pub row: usize,
    /// Column: an element of the source.
    pub col: usize,
}

/// A quadratic gain over blocks of assignment variables.
pub trait Objective {
    /// Linear gains, one table a block; `-inf` forbids a pair.
    fn linear(&self) -> &[Table];

    /// Adds `K soft` to `out`.
    fn add_couplings(&self, soft: &[Table], out: &mut [Table]);

    /// Adds `factor` times the column of K that belongs to one variable to `out`.
    fn add_variable(&self, variable: Variable, factor: f64, out: &mut [Table]);

    /// One entry of K.
    fn coupling(&self, a: Variable, b: Variable) -> f64;

    /// Whether variables of this block are coupled with one another.
    fn self_coupled(&self, block: usize) -> bool;

    /// `linear + K soft`, into `out`.
    fn gradient(&self, soft: &[Table], out: &mut [Table]) {
        for (o, l) in out.iter_mut().zip(self.linear()) {
            o.copy_from(l);
        }
        self.add_couplings(soft, out);
    }

    /// Empty tables of the blocks' sizes.
    fn zeros(&self) -> Vec<Table> {
        self.linear()
            .iter()
            .map(|t| Table::zeros(t.rows(), t.cols()))
            .collect()
    }
}

/// The gain of a [`MatchingProblem`]: blocks nodes, curves, sheets, coupled through incidences.
#[derive(Debug, Clone)]
pub struct HypergraphObjective<'a> {
    problem: &'a MatchingProblem,
    linear: [Table; 3],
}

impl<'a> HypergraphObjective<'a> {
    /// Reads the gains off a problem.
    pub fn new(problem: &'a MatchingProblem) -> Self {
        let linear = [0, 1, 2].map(|k| {
            Table::from_fn(problem.target.count(k), problem.source.count(k), |x, y| {
                problem.pair_gain(k, x, y)
            })
        });
        Self { problem, linear }
    }
}

impl Objective for HypergraphObjective<'_> {
    fn linear(&self) -> &[Table] {
        &self.linear
    }

    fn add_couplings(&self, soft: &[Table], out: &mut [Table]) {
        for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
            let (target, source) = (
                &self.problem.target.incidences[pair],
                &self.problem.source.incidences[pair],
            );
            for (x, zs) in target.forward.iter().enumerate() {
                for (y, ts) in source.forward.iter().enumerate() {
                    let mut into_first = 0.0;
                    let held = soft[p][(x, y)];
                    for z in zs {
                        for t in ts {
                            let gain = 2.0 * z.strength.min(t.strength);
                            let place = (z.element as usize, t.element as usize);
                            into_first += gain * soft[q][place];
                            out[q][place] += gain * held;
                        }
                    }
                    out[p][(x, y)] += into_first;
                }
            }
        }
    }

    fn add_variable(&self, v: Variable, factor: f64, out: &mut [Table]) {
        for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
            let (target, source) = (
                &self.problem.target.incidences[pair],
                &self.problem.source.incidences[pair],
            );
            let (zs, ts, other) = if v.block == p {
                (&target.forward[v.row], &source.forward[v.col], q)
            } else if v.block == q {
                (&target.backward[v.row], &source.backward[v.col], p)
            } else {
                continue;
            };
            for z in zs {
                for t in ts {
                    let gain = 2.0 * z.strength.min(t.strength);
                    out[other][(z.element as usize, t.element as usize)] += factor * gain;
                }
            }
        }
    }

    fn coupling(&self, a: Variable, b: Variable) -> f64 {
        let (a, b) = if a.block <= b.block { (a, b) } else { (b, a) };
        let Some(pair) = INCIDENCE_KINDS.iter().position(|k| *k == (a.block, b.block)) else {
            return 0.0;
        };
        let in_target = self.problem.target.incidences[pair].strength(a.row, b.row);
        let in_source = self.problem.source.incidences[pair].strength(a.col, b.col);
        2.0 * in_target.min(in_source)
    }

    fn self_coupled(&self, _block: usize) -> bool {
        false
    }
}
