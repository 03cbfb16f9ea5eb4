//! Exact edit distance of two fixed hypergraphs (deform and splice) by branch and bound.
//!
//! In: a [`MatchingProblem`], a first map, a cutoff, a limit on search nodes. Out: the cheapest map found, a lower bound,
//! and whether the two meet.
//!
//! The price is a constant minus a gain ([`crate::matching_problem`]), so we maximise the gain.
//!
//! 1. Branch on nodes and sheets only: with both fixed, the curves are one LSAP, which the bound below solves exactly.
//! 2. Upper bound of the gain: what is decided, plus one LSAP for each kind over the undecided pairs with entries
//!
//!    ```text
//!    h(x, y) = w_x + w_y - c_xy + sum over decided pairs (z, t) 2 min(q_xz, q_yt)
//!              + sum_k min(a_k, b_k)
//!    ```
//!
//!    where a, b are the strengths of the undecided neighbours of x and y in descending order. Incident pairs of
//!    undecided elements are shared half and half between their two ends, hence `min` and not `2 min`; matching two
//!    sorted lists rank by rank maximises `sum min`. (The branch bound of Blumenthal & Gamper 2018, "Improved lower bounds
//!    for graph edit distance"; after Riesen & Bunke 2009 and Zeng et al. 2009.)
//! 3. Branch on the undecided element with the fewest choices that the duals of its LSAP leave open; try the best first.
//! 4. A branch whose bound does not beat the best map is closed; the largest bound of the branches that the limit
//!    left open bounds the optimum when the search is stopped.
//!
//! Cost: a search node is three LSAPs, O(n^3) each; their number is exponential in the worst case. The limit counts
//! search nodes, not seconds, so that the answer does not depend on the machine.

use super::shares::{Couplings, KindBound, Open, Shares};
use crate::graduated_assignment::discrete::{Discrete, best_columns};
use crate::graduated_assignment::objective::{HypergraphObjective, Variable};
use crate::matching_problem::{ElementMap, MatchingProblem};

/// Gains closer than this fraction of the total price are equal.
pub const RELATIVE_TOLERANCE: f64 = 1e-10;

/// Kinds that are branched on: nodes and sheets.
const BRANCHED: [usize; 2] = [0, 2];

/// Kinds in the order in which a round of the dual ascent lets them take shares.
const ASCENT_ORDER: [usize; 3] = [1, 0, 2];

/// Most rounds of the dual ascent at the root and at every other search node.
pub(super) const ROOT_ROUNDS: usize = 60;
pub(super) const NODE_ROUNDS: usize = 2;

/// A round that closes less than this fraction of the gap ends the ascent.
const SETTLED: f64 = 0.02;

/// What a search ends with; prices in the weights' unit.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchResult {
    /// Price of the cheapest map known.
    pub upper_bound: f64,
    /// No map is cheaper than this.
    pub lower_bound: f64,
    /// Whether the bounds meet.
    pub exact: bool,
    /// The cheapest map known.
    pub map: ElementMap,
    /// Search nodes visited.
    pub search_nodes: usize,
}

/// Lower bound of the price without any search: the branch bound at the root.
pub fn root_lower_bound(problem: &MatchingProblem) -> f64 {
    let search = Search::new(problem, 0.0, 0);
    let bound = search.bound(&search.couplings.equal_shares(), ROOT_ROUNDS, f64::NEG_INFINITY);
    (problem.total() - bound.gain).max(0.0)
}

/// Searches for the cheapest map, starting from the price and map given.
///
/// Maps that are not cheaper than `start` by more than rounding are not looked for.
pub fn search(problem: &MatchingProblem, start: &ElementMap, max_search_nodes: usize) -> SearchResult {
    let objective = HypergraphObjective::new(problem);
    let columns: Vec<Vec<Option<usize>>> = start
        .source_of_target
        .iter()
        .map(|m| m.iter().map(|y| y.map(|y| y as usize)).collect())
        .collect();
    let first = Discrete::from_columns(&objective, &columns);
    let mut search = Search::new(problem, first.gain, max_search_nodes);
    search.best = first.col_of_row;
    search.run();
    let list = |k: usize| search.best[k].iter().map(|c| c.map(|c| c as u32)).collect();
    let map = ElementMap {
        source_of_target: [list(0), list(1), list(2)],
    };
    let upper_bound = problem.price(&map);
    let exact = search.open_gain <= search.best_gain + search.tolerance;
    let lower_bound = if exact {
        upper_bound
    } else {
        (problem.total() - search.open_gain).clamp(0.0, upper_bound)
    };
    SearchResult {
        upper_bound,
        lower_bound,
        exact,
        map,
        search_nodes: search.visited,
    }
}

pub(super) struct Search<'a> {
    pub(super) objective: HypergraphObjective<'a>,
    pub(super) couplings: Couplings,
    /// Decided pairs and their gradient.
    pub(super) state: Discrete,
    /// Whether an element is still undecided, for targets and sources of every kind.
    pub(super) open_target: [Vec<bool>; 3],
    pub(super) open_source: [Vec<bool>; 3],
    best: Vec<Vec<Option<usize>>>,
    best_gain: f64,
    /// Largest bound among branches that the limit left open.
    open_gain: f64,
    pub(super) tolerance: f64,
    visited: usize,
    limit: usize,
}

/// An upper bound of the gain, with what is needed to branch.
pub(super) struct Bound {
    pub(super) gain: f64,
    /// Undecided target element with the fewest open choices, and the choices, best first.
    pub(super) branch: Option<Branch>,
    /// The curves' assignment: optimal once nodes and sheets are decided.
    curves: Vec<Option<usize>>,
    pub(super) shares: Shares,
    /// What every undecided element of target and source contributes to the bound, by kind; none when the bound does not
    /// beat what was asked.
    pub(super) worth: Option<[[Vec<f64>; 3]; 2]>,
}

pub(super) struct Branch {
    pub(super) kind: usize,
    pub(super) row: usize,
    /// Column or unmatched, with an upper bound of the gain of that child.
    pub(super) choices: Vec<(f64, Option<usize>)>,
}

impl<'a> Search<'a> {
    pub(super) fn new(problem: &'a MatchingProblem, best_gain: f64, limit: usize) -> Self {
        let objective = HypergraphObjective::new(problem);
        let state = Discrete::empty(&objective);
        Self {
            best: state.col_of_row.clone(),
            open_target: [0, 1, 2].map(|k| vec![true; problem.target.count(k)]),
            open_source: [0, 1, 2].map(|k| vec![true; problem.source.count(k)]),
            best_gain,
            open_gain: f64::NEG_INFINITY,
            tolerance: RELATIVE_TOLERANCE * problem.total(),
            visited: 0,
            limit,
            couplings: Couplings::new(problem),
            objective,
            state,
        }
    }

    fn run(&mut self) {
        let bound = self.bound(&self.couplings.equal_shares(), ROOT_ROUNDS, self.best_gain);
        self.expand(bound);
    }

    fn expand(&mut self, bound: Bound) {
        if bound.gain <= self.best_gain + self.tolerance {
            return;
        }
        let Some(branch) = bound.branch else {
            // Nodes and sheets are decided: the bound is the gain, the curves' LSAP the best curves.
            self.best = self.state.col_of_row.clone();
            self.best[1] = bound.curves;
            self.best_gain = bound.gain;
            return;
        };
        let Branch { kind, row, choices } = branch;
        self.open_target[kind][row] = false;
        for (ceiling, choice) in choices {
            if ceiling <= self.best_gain + self.tolerance {
                continue;
            }
            if self.visited >= self.limit {
                self.open_gain = self.open_gain.max(ceiling.min(bound.gain));
                continue;
            }
            self.visited += 1;
            if let Some(col) = choice {
                self.open_source[kind][col] = false;
                self.state.add(
                    &self.objective,
                    Variable {
                        block: kind,
                        row,
                        col,
                    },
                );
            }
            let child = self.bound(&bound.shares, NODE_ROUNDS, self.best_gain);
            self.expand(child);
            if let Some(col) = choice {
                self.state.remove(&self.objective, kind, row);
                self.open_source[kind][col] = true;
            }
        }
        self.open_target[kind][row] = true;
    }

    /// The bound at the current decisions, with better shares; a branch is only prepared when the bound beats `to_beat`.
    pub(super) fn bound(&self, shares: &Shares, rounds: usize, to_beat: f64) -> Bound {
        let open = Open::new(&self.open_target, &self.open_source);
        let mut shares = shares.clone();
        let beaten = |gain: f64| gain <= to_beat + self.tolerance;
        let mut parts: Vec<KindBound> = (0..3)
            .map(|k| {
                self.couplings
                    .solve_kind(k, &self.state, &open, &mut shares, false)
            })
            .collect();
        let total = |parts: &[KindBound]| self.state.gain + parts.iter().map(KindBound::value).sum::<f64>();
        let mut gain = total(&parts);
        for _ in 0..rounds {
            let before = gain;
            for kind in ASCENT_ORDER {
                parts[kind] = self
                    .couplings
                    .solve_kind(kind, &self.state, &open, &mut shares, true);
                gain = total(&parts);
                if beaten(gain) {
                    break;
                }
            }
            let gap = (gain - to_beat).min(gain);
            if beaten(gain) || before - gain < SETTLED * gap {
                break;
            }
        }
        if beaten(gain) {
            return Bound {
                gain,
                branch: None,
                curves: Vec::new(),
                shares,
                worth: None,
            };
        }
        // A kind that took shares has larger leaders than it was solved with; the slacks need the present ones.
        for k in 0..3 {
            parts[k] = self
                .couplings
                .solve_kind(k, &self.state, &open, &mut shares, false);
        }
        let gain = total(&parts).min(gain);
        let branch = self.branch(&open, &parts, gain, to_beat);
        let curves = if branch.is_none() {
            best_columns(&self.state.gradient[1])
        } else {
            Vec::new()
        };
        let worth = self.worth(&open, &parts);
        Bound {
            gain,
            branch,
            curves,
            shares,
            worth: Some(worth),
        }
    }

    /// What the undecided elements contribute to the bound. Optimal duals are not unique; the mean of those that favour the
    /// target and those that favour the source is fair to both.
    fn worth(&self, open: &Open, parts: &[KindBound]) -> [[Vec<f64>; 3]; 2] {
        let mut worth =
            [&self.open_target, &self.open_source].map(|o| [0, 1, 2].map(|k| vec![0.0; o[k].len()]));
        for (k, part) in parts.iter().enumerate() {
            let turned = part.turned();
            for (r, &x) in open.rows[k].iter().enumerate() {
                worth[0][k][x] = 0.5 * (part.row_duals[r] + turned.col_duals[r]).max(0.0);
            }
            for (c, &y) in open.cols[k].iter().enumerate() {
                worth[1][k][y] = 0.5 * (part.col_duals[c] + turned.row_duals[c]).max(0.0);
            }
        }
        worth
    }

    /// The undecided node or sheet with the fewest choices that still beat `to_beat`.
    fn branch(&self, open: &Open, parts: &[KindBound], gain: f64, to_beat: f64) -> Option<Branch> {
        let mut branch: Option<Branch> = None;
        for kind in BRANCHED {
            let part = &parts[kind];
            for (r, &row) in open.rows[kind].iter().enumerate() {
                let allowed = |c: &usize| part.leaders[(r, *c)] > f64::NEG_INFINITY;
                let matched = (0..open.cols[kind].len())
                    .filter(allowed)
                    .map(|c| (gain - part.slack(r, c), Some(open.cols[kind][c])));
                let mut choices: Vec<(f64, Option<usize>)> = matched
                    .chain(std::iter::once((gain - part.row_duals[r].max(0.0), None)))
                    .filter(|choice| choice.0 > to_beat + self.tolerance)
                    .collect();
                if branch.as_ref().is_none_or(|b| choices.len() < b.choices.len()) {
                    choices.sort_by(|a, b| {
                        b.0.total_cmp(&a.0)
                            .then(a.1.is_none().cmp(&b.1.is_none()))
                            .then(a.1.cmp(&b.1))
                    });
                    branch = Some(Branch { kind, row, choices });
                }
            }
        }
        branch
    }
}
