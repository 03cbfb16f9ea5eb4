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

use crate::assignment;
use crate::graduated_assignment::discrete::{Discrete, best_columns};
use crate::graduated_assignment::objective::{HypergraphObjective, Objective, Variable};
use crate::matching_problem::{ElementMap, INCIDENCE_KINDS, Incident, MatchingProblem};
use crate::table::Table;

/// Gains closer than this fraction of the total price are equal.
pub const RELATIVE_TOLERANCE: f64 = 1e-10;

/// Kinds that are branched on: nodes and sheets.
const BRANCHED: [usize; 2] = [0, 2];

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
    let mut search = Search::new(problem, 0.0, 0);
    let bound = search.bound(f64::NEG_INFINITY);
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

struct Search<'a> {
    problem: &'a MatchingProblem,
    objective: HypergraphObjective<'a>,
    /// Decided pairs and their gradient.
    state: Discrete,
    /// Whether an element is still undecided, for targets and sources of every kind.
    open_target: [Vec<bool>; 3],
    open_source: [Vec<bool>; 3],
    best: Vec<Vec<Option<usize>>>,
    best_gain: f64,
    /// Largest bound among branches that the limit left open.
    open_gain: f64,
    tolerance: f64,
    visited: usize,
    limit: usize,
}

/// An upper bound of the gain, with what is needed to branch.
struct Bound {
    gain: f64,
    /// Undecided target element with the fewest open choices, and the choices, best first.
    branch: Option<Branch>,
    /// The curves' assignment: optimal once nodes and sheets are decided.
    curves: Vec<Option<usize>>,
}

struct Branch {
    kind: usize,
    row: usize,
    /// Column or unmatched, with an upper bound of the gain of that child.
    choices: Vec<(f64, Option<usize>)>,
}

impl<'a> Search<'a> {
    fn new(problem: &'a MatchingProblem, best_gain: f64, limit: usize) -> Self {
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
            problem,
            objective,
            state,
        }
    }

    fn run(&mut self) {
        let bound = self.bound(self.best_gain);
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
            let child = self.bound(self.best_gain);
            self.expand(child);
            if let Some(col) = choice {
                self.state.remove(&self.objective, kind, row);
                self.open_source[kind][col] = true;
            }
        }
        self.open_target[kind][row] = true;
    }

    /// The bound at the current decisions; a branch is only prepared when the bound beats `to_beat`.
    fn bound(&mut self, to_beat: f64) -> Bound {
        let rows = [0, 1, 2].map(|k| places(&self.open_target[k]));
        // Sources are left over for good once no target of their kind is undecided.
        let cols = [0, 1, 2].map(|k| {
            if rows[k].is_empty() {
                Vec::new()
            } else {
                places(&self.open_source[k])
            }
        });
        let neighbours = OpenNeighbours::new(self.problem, &rows, &cols);
        let tables: Vec<Table> = (0..3)
            .map(|k| {
                Table::from_fn(rows[k].len(), cols[k].len(), |r, c| {
                    let (x, y) = (rows[k][r], cols[k][c]);
                    (self.state.gradient[k][(x, y)] + neighbours.shared(k, x, y)).max(0.0)
                })
            })
            .collect();
        let mut gain = self.state.gain;
        let mut solved = Vec::with_capacity(3);
        for table in &tables {
            let lsap = assignment::solve_max(table).expect("entries are finite and at least 0");
            gain -= lsap.cost;
            solved.push(lsap);
        }
        if gain <= to_beat + self.tolerance {
            return Bound {
                gain,
                branch: None,
                curves: Vec::new(),
            };
        }
        let mut branch: Option<Branch> = None;
        for kind in BRANCHED {
            let lsap = &solved[kind];
            for r in 0..rows[kind].len() {
                let (x, u) = (rows[kind][r], lsap.row_duals[r]);
                let ceiling = |c: usize| gain - (-tables[kind][(r, c)] - u - lsap.col_duals[c]).max(0.0);
                let beats = |g: f64| g > to_beat + self.tolerance;
                let allowed =
                    |c: usize| self.objective.linear()[kind][(x, cols[kind][c])] > f64::NEG_INFINITY;
                let mut choices: Vec<(f64, Option<usize>)> = (0..cols[kind].len())
                    .filter(|&c| allowed(c))
                    .map(|c| (ceiling(c), Some(cols[kind][c])))
                    .chain(std::iter::once((gain - (-u).max(0.0), None)))
                    .filter(|choice| beats(choice.0))
                    .collect();
                if branch.as_ref().is_none_or(|b| choices.len() < b.choices.len()) {
                    choices.sort_by(|a, b| {
                        b.0.total_cmp(&a.0)
                            .then(a.1.is_none().cmp(&b.1.is_none()))
                            .then(a.1.cmp(&b.1))
                    });
                    branch = Some(Branch {
                        kind,
                        row: x,
                        choices,
                    });
                }
            }
        }
        let curves = if branch.is_none() {
            best_columns(&self.state.gradient[1])
        } else {
            Vec::new()
        };
        Bound { gain, branch, curves }
    }
}

fn places(open: &[bool]) -> Vec<usize> {
    (0..open.len()).filter(|&k| open[k]).collect()
}

/// Strengths of undecided neighbours, descending, for every undecided element: by kind pair and direction.
struct OpenNeighbours {
    target: [[Vec<Vec<f64>>; 2]; 3],
    source: [[Vec<Vec<f64>>; 2]; 3],
}

impl OpenNeighbours {
    fn new(problem: &MatchingProblem, rows: &[Vec<usize>; 3], cols: &[Vec<usize>; 3]) -> Self {
        let lists = |side: &crate::matching_problem::Side, open: &[Vec<usize>; 3]| {
            [0, 1, 2].map(|pair| {
                let (p, q) = INCIDENCE_KINDS[pair];
                let incidences = &side.incidences[pair];
                [
                    sorted_strengths(&incidences.forward, &open[p], &open[q], side.count(q)),
                    sorted_strengths(&incidences.backward, &open[q], &open[p], side.count(p)),
                ]
            })
        };
        Self {
            target: lists(&problem.target, rows),
            source: lists(&problem.source, cols),
        }
    }

    /// `sum_k min(a_k, b_k)` over both kinds of neighbours.
    fn shared(&self, kind: usize, x: usize, y: usize) -> f64 {
        let mut sum = 0.0;
        for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
            let direction = if kind == p {
                0
            } else if kind == q {
                1
            } else {
                continue;
            };
            let (a, b) = (&self.target[pair][direction][x], &self.source[pair][direction][y]);
            sum += a.iter().zip(b).map(|(a, b)| a.min(*b)).sum::<f64>();
        }
        sum
    }
}

fn sorted_strengths(lists: &[Vec<Incident>], of: &[usize], open: &[usize], count: usize) -> Vec<Vec<f64>> {
    let mut is_open = vec![false; count];
    open.iter().for_each(|&k| is_open[k] = true);
    let mut sorted = vec![Vec::new(); lists.len()];
    for &x in of {
        let neighbours = lists[x].iter().filter(|i| is_open[i.element as usize]);
        sorted[x] = neighbours.map(|i| i.strength).collect();
        sorted[x].sort_by(|a, b| b.total_cmp(a));
    }
    sorted
}
