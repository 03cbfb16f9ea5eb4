//! Sharing the gain of incident pairs between their two ends so that the bound becomes tight.
//!
//! In: a [`MatchingProblem`], what is decided so far, the shares of the search node before. Out: an upper bound of the gain,
//! its duals, and better shares.
//!
//! A coupling joins a pair (x, y) of one kind and a pair (z, t) of another with gain `k = 2 min(q_xz, q_yt)`. For any real s,
//! counting s with (x, y) and k - s with (z, t) leaves the gain of every map unchanged, and
//!
//! ```text
//! L(x, y) = linear + what is decided + sum over kinds of neighbours  LSAP over (z, t) of the shares
//! bound   = sum over kinds  LSAP of max(L, 0)
//! ```
//!
//! bounds it from above, because a map assigns the neighbours of x to those of y one to one. The branch bound takes
//! s = k / 2; here the shares are improved by dual ascent:
//!
//! 1. Solve one kind. Its duals say how much every L(x, y) may grow without moving the kind's LSAP, and the duals of the
//!    small LSAPs how much every share may grow without moving L(x, y).
//! 2. Every pair takes that much from its partners' shares, never more than they have.
//! 3. Go on with the next kind, whose L have only become smaller: the bound never rises.
//!
//! P. Hahn, T. Grant, "Lower bounds for the quadratic assignment problem based upon a dual formulation", Operations
//! Research 46 (1998), for couplings that are as sparse as the incidences. Cost of one kind: one small LSAP for every pair
//! of elements, O(sum of deg deg' min(deg, deg')), and one LSAP.

use crate::assignment;
use crate::graduated_assignment::discrete::Discrete;
use crate::matching_problem::{INCIDENCE_KINDS, Incidences, MatchingProblem};
use crate::table::Table;

/// One incidence as its two ends see it.
#[derive(Debug, Clone, Copy)]
struct Link {
    /// Element at the other end.
    other: usize,
    /// Position among all incidences of the kind pair.
    id: usize,
}

/// Links of all elements of one side: by kind pair, direction, element.
type Links = [[Vec<Vec<Link>>; 2]; 3];

/// Problem-wide tables that do not change during a search.
#[derive(Debug, Clone)]
pub struct Couplings {
    target: Links,
    source: Links,
    /// Gain of every coupling, target incidence by source incidence, by kind pair.
    gains: [Table; 3],
}

/// The share of the first kind of every coupling, by kind pair.
#[derive(Debug, Clone)]
pub struct Shares([Table; 3]);

impl Shares {
    /// The shares of couplings whose gains have changed: every one keeps its part of the gain.
    pub(super) fn rescaled(&self, before: &Couplings, after: &Couplings) -> Self {
        Self([0, 1, 2].map(|pair| {
            let (old, new) = (&before.gains[pair], &after.gains[pair]);
            Table::from_fn(new.rows(), new.cols(), |e, f| {
                let (k, k_new) = (old[(e, f)], new[(e, f)]);
                if k == k_new {
                    self.0[pair][(e, f)]
                } else if k > 0.0 {
                    self.0[pair][(e, f)] * k_new / k
                } else {
                    0.5 * k_new
                }
            })
        }))
    }
}

/// Undecided elements of both sides, by kind.
#[derive(Debug, Clone)]
pub struct Open {
    /// Undecided target elements.
    pub rows: [Vec<usize>; 3],
    /// Undecided source elements.
    pub cols: [Vec<usize>; 3],
    row_open: [Vec<bool>; 3],
    col_open: [Vec<bool>; 3],
}

impl Open {
    /// Reads flags; sources are left over for good once no target of their kind is undecided.
    pub fn new(target: &[Vec<bool>; 3], source: &[Vec<bool>; 3]) -> Self {
        let places = |open: &[bool]| -> Vec<usize> { (0..open.len()).filter(|&k| open[k]).collect() };
        let rows = [0, 1, 2].map(|k| places(&target[k]));
        let cols = [0, 1, 2].map(|k| {
            if rows[k].is_empty() {
                Vec::new()
            } else {
                places(&source[k])
            }
        });
        let col_open = [0, 1, 2].map(|k| {
            if rows[k].is_empty() {
                vec![false; source[k].len()]
            } else {
                source[k].clone()
            }
        });
        Self {
            rows,
            cols,
            row_open: target.clone(),
            col_open,
        }
    }
}

/// The LSAP of one kind over its undecided elements.
#[derive(Debug, Clone)]
pub struct KindBound {
    /// L of every undecided pair, not floored.
    pub leaders: Table,
    /// Duals of the rows and columns, at least 0; their sum is the kind's part of the bound.
    pub row_duals: Vec<f64>,
    /// Duals of the columns.
    pub col_duals: Vec<f64>,
}

impl KindBound {
    /// The kind's part of the bound.
    pub fn value(&self) -> f64 {
        self.row_duals.iter().sum::<f64>() + self.col_duals.iter().sum::<f64>()
    }

    /// The same with rows and columns exchanged: as large, with other duals.
    pub(super) fn turned(&self) -> Self {
        Self::of(self.leaders.transposed())
    }

    /// Solves the LSAP of the leaders, unmatched at zero.
    fn of(leaders: Table) -> Self {
        let floored = Table::from_fn(leaders.rows(), leaders.cols(), |r, c| leaders[(r, c)].max(0.0));
        let lsap = assignment::solve_max(&floored).expect("entries are finite and at least 0");
        let mut bound = Self {
            leaders,
            row_duals: lsap.row_duals.iter().map(|u| -u).collect(),
            col_duals: lsap.col_duals.iter().map(|v| -v).collect(),
        };
        make_duals_positive(&mut bound);
        bound
    }

    /// How much the bound falls when a pair is forced.
    pub fn slack(&self, r: usize, c: usize) -> f64 {
        (self.row_duals[r] + self.col_duals[c] - self.leaders[(r, c)]).max(0.0)
    }
}

impl Couplings {
    /// Tabulates the couplings of a problem.
    pub fn new(problem: &MatchingProblem) -> Self {
        let links = |all: &[Incidences; 3]| [0, 1, 2].map(|pair| links_of(&all[pair]));
        let strengths =
            |i: &Incidences| -> Vec<f64> { i.forward.iter().flatten().map(|i| i.strength).collect() };
        let gains = [0, 1, 2].map(|pair| {
            let a = strengths(&problem.target.incidences[pair]);
            let b = strengths(&problem.source.incidences[pair]);
            Table::from_fn(a.len(), b.len(), |e, f| 2.0 * a[e].min(b[f]))
        });
        Self {
            target: links(&problem.target.incidences),
            source: links(&problem.source.incidences),
            gains,
        }
    }

    /// Equal shares: the branch bound.
    pub fn equal_shares(&self) -> Shares {
        Shares([0, 1, 2].map(|pair| {
            let g = &self.gains[pair];
            Table::from_fn(g.rows(), g.cols(), |e, f| 0.5 * g[(e, f)])
        }))
    }

    /// Solves one kind; when `improve` is set, its pairs also take over what they can of their partners' shares.
    pub fn solve_kind(
        &self,
        kind: usize,
        state: &Discrete,
        open: &Open,
        shares: &mut Shares,
        improve: bool,
    ) -> KindBound {
        let (rows, cols) = (&open.rows[kind], &open.cols[kind]);
        let mut small = SmallSolver::default();
        let leaders = Table::from_fn(rows.len(), cols.len(), |r, c| {
            let (x, y) = (rows[r], cols[c]);
            let mut sum = state.gradient[kind][(x, y)];
            if sum > f64::NEG_INFINITY {
                for_kind(kind, |pair, direction| {
                    if self.load(&mut small, pair, direction, (x, y), open, shares) {
                        sum += small.solve();
                    }
                });
            }
            sum
        });
        let bound = KindBound::of(leaders);
        if improve {
            self.take_shares(kind, open, shares, &bound, &mut small);
        }
        bound
    }

    /// Loads the shares of a pair's undecided neighbours; false when there is nothing to assign.
    fn load(
        &self,
        small: &mut SmallSolver,
        pair: usize,
        direction: usize,
        (x, y): (usize, usize),
        open: &Open,
        shares: &Shares,
    ) -> bool {
        let (p, q) = INCIDENCE_KINDS[pair];
        let other = if direction == 0 { q } else { p };
        small.rows.clear();
        small.rows.extend(
            self.target[pair][direction][x]
                .iter()
                .filter(|l| open.row_open[other][l.other])
                .map(|l| l.id),
        );
        small.cols.clear();
        small.cols.extend(
            self.source[pair][direction][y]
                .iter()
                .filter(|l| open.col_open[other][l.other])
                .map(|l| l.id),
        );
        if small.rows.is_empty() || small.cols.is_empty() {
            return false;
        }
        small.values.clear();
        for &e in &small.rows {
            let (own, gain) = (shares.0[pair].row(e), self.gains[pair].row(e));
            for &f in &small.cols {
                small
                    .values
                    .push(if direction == 0 { own[f] } else { gain[f] - own[f] });
            }
        }
        true
    }

    fn take_shares(
        &self,
        kind: usize,
        open: &Open,
        shares: &mut Shares,
        bound: &KindBound,
        small: &mut SmallSolver,
    ) {
        for (r, &x) in open.rows[kind].iter().enumerate() {
            for (c, &y) in open.cols[kind].iter().enumerate() {
                if bound.leaders[(r, c)] == f64::NEG_INFINITY {
                    continue;
                }
                let mut neighbours = 0;
                for_kind(kind, |pair, direction| {
                    if self.load(small, pair, direction, (x, y), open, shares) {
                        neighbours += small.rows.len().min(small.cols.len());
                    }
                });
                if neighbours == 0 {
                    continue;
                }
                // The whole slack may be handed out once to each place of a small assignment.
                let part = bound.slack(r, c) / neighbours as f64;
                for_kind(kind, |pair, direction| {
                    if !self.load(small, pair, direction, (x, y), open, shares) {
                        return;
                    }
                    small.solve();
                    for (i, &e) in small.rows.iter().enumerate() {
                        for (j, &f) in small.cols.iter().enumerate() {
                            let own = small.values[i * small.cols.len() + j];
                            let free = (small.u[i] + small.v[j] - own).max(0.0) + part;
                            let theirs = (self.gains[pair][(e, f)] - own).max(0.0);
                            let taken = free.min(theirs);
                            shares.0[pair][(e, f)] += if direction == 0 { taken } else { -taken };
                        }
                    }
                });
            }
        }
    }
}

/// Calls `f(kind pair, direction)` for the two kind pairs a kind takes part in.
fn for_kind(kind: usize, mut f: impl FnMut(usize, usize)) {
    for (pair, (p, q)) in INCIDENCE_KINDS.into_iter().enumerate() {
        if kind == p {
            f(pair, 0);
        } else if kind == q {
            f(pair, 1);
        }
    }
}

fn links_of(incidences: &Incidences) -> [Vec<Vec<Link>>; 2] {
    let mut backward = vec![Vec::new(); incidences.backward.len()];
    let mut id = 0;
    let forward = incidences
        .forward
        .iter()
        .enumerate()
        .map(|(x, list)| {
            list.iter()
                .map(|i| {
                    backward[i.element as usize].push(Link { other: x, id });
                    id += 1;
                    Link {
                        other: i.element as usize,
                        id: id - 1,
                    }
                })
                .collect()
        })
        .collect();
    [forward, backward]
}

/// Shifts the duals of a square problem so that none is negative; those of the others already are not.
fn make_duals_positive(bound: &mut KindBound) {
    let least = |list: &[f64]| list.iter().fold(f64::INFINITY, |a: f64, &b| a.min(b));
    let shift = if bound.row_duals.len() == bound.col_duals.len() && !bound.row_duals.is_empty() {
        let (rows, cols) = (least(&bound.row_duals), least(&bound.col_duals));
        if cols < 0.0 { -cols } else { rows.min(0.0) }
    } else {
        0.0
    };
    bound.row_duals.iter_mut().for_each(|u| *u -= shift);
    bound.col_duals.iter_mut().for_each(|v| *v += shift);
}

/// Greatest assignment of a few neighbours, unmatched at zero, with duals `u + v >= value`, `u, v >= 0`.
#[derive(Default)]
struct SmallSolver {
    rows: Vec<usize>,
    cols: Vec<usize>,
    /// Shares, row-major.
    values: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
}

impl SmallSolver {
    fn solve(&mut self) -> f64 {
        let (n, m) = (self.rows.len(), self.cols.len());
        self.u.clear();
        self.u.resize(n, 0.0);
        self.v.clear();
        self.v.resize(m, 0.0);
        if n == 1 {
            let best = self.values.iter().fold(0.0, |a: f64, &b| a.max(b));
            self.u[0] = best;
            return best;
        }
        if m == 1 {
            let best = self.values.iter().fold(0.0, |a: f64, &b| a.max(b));
            self.v[0] = best;
            return best;
        }
        let table = Table::from_fn(n, m, |r, c| self.values[r * m + c].max(0.0));
        let lsap = assignment::solve_max(&table).expect("shares are finite");
        let mut bound = KindBound {
            leaders: Table::default(),
            row_duals: lsap.row_duals.iter().map(|u| -u).collect(),
            col_duals: lsap.col_duals.iter().map(|v| -v).collect(),
        };
        make_duals_positive(&mut bound);
        self.u.copy_from_slice(&bound.row_duals);
        self.v.copy_from_slice(&bound.col_duals);
        -lsap.cost
    }
}
