//! From soft to discrete: assignments by LSAP, block ascent and swaps, all on the linearised gain.
//!
//! In: soft tables or a discrete state. Out: a discrete state that no block reassignment and no single move or swap
//! improves.
//!
//! 1. **Discretise**: the LSAP on the gradient at the soft tables, with unmatched at gain zero.
//! 2. **Block ascent**: a block that is not coupled with itself is set to the LSAP of its gradient, which is its exact
//!    optimum given the others; a self-coupled block takes the LSAP only when the gain rises (the discrete step of
//!    IPFP; Leordeanu, Hebert & Sukthankar 2009).
//! 3. **Local search**: rows are unmatched, moved to free columns, or take a column from another row, which then gets
//!    the old column, a free one, or none. The change of gain is exact:
//!    `dG = gradient . dz + 1/2 dz K dz`, so a move costs a handful of coupling look-ups and no evaluation.
//!
//! Cost: one pass of the local search O(n m) moves a block for swaps; each accepted move O(degree^2) to keep the
//! gradient current. Order of moves and ties is fixed.

use super::objective::{Objective, Variable};
use crate::assignment;
use crate::table::Table;

/// Gains below this fraction of the gain are rounding.
const GAIN_EPS: f64 = 1e-10;

/// A discrete match with its gradient and gain.
#[derive(Debug, Clone)]
pub struct Discrete {
    /// Column of every row, one list a block.
    pub col_of_row: Vec<Vec<Option<usize>>>,
    /// Row of every column, one list a block.
    pub row_of_col: Vec<Vec<Option<usize>>>,
    /// `linear + K z`.
    pub gradient: Vec<Table>,
    /// `G(z)`.
    pub gain: f64,
}

impl Discrete {
    /// The state that matches nothing.
    pub fn empty(objective: &impl Objective) -> Self {
        let linear = objective.linear();
        Self {
            col_of_row: linear.iter().map(|t| vec![None; t.rows()]).collect(),
            row_of_col: linear.iter().map(|t| vec![None; t.cols()]).collect(),
            gradient: linear.to_vec(),
            gain: 0.0,
        }
    }

    /// The state with the given columns; pairs that are forbidden or take a column twice are left out.
    pub fn from_columns(objective: &impl Objective, columns: &[Vec<Option<usize>>]) -> Self {
        let mut s = Self::empty(objective);
        for (block, cols) in columns.iter().enumerate() {
            for (row, col) in cols.iter().enumerate() {
                if let Some(col) = *col
                    && s.row_of_col[block][col].is_none()
                    && objective.linear()[block][(row, col)] > f64::NEG_INFINITY
                {
                    s.add(objective, Variable { block, row, col });
                }
            }
        }
        s
    }

    /// The discrete state nearest a soft one: LSAP on the soft tables' gradient.
    pub fn from_soft(objective: &impl Objective, soft: &[Table]) -> Self {
        let mut gradient = objective.zeros();
        objective.gradient(soft, &mut gradient);
        let columns: Vec<_> = gradient.iter().map(best_columns).collect();
        Self::from_columns(objective, &columns)
    }

    /// Adds one pair whose row and column are free.
    pub fn add(&mut self, objective: &impl Objective, v: Variable) {
        debug_assert!(self.col_of_row[v.block][v.row].is_none() && self.row_of_col[v.block][v.col].is_none());
        self.gain += self.gradient[v.block][(v.row, v.col)];
        objective.add_variable(v, 1.0, &mut self.gradient);
        self.col_of_row[v.block][v.row] = Some(v.col);
        self.row_of_col[v.block][v.col] = Some(v.row);
    }

    /// Takes the pair of a matched row away.
    pub fn remove(&mut self, objective: &impl Objective, block: usize, row: usize) {
        let Some(col) = self.col_of_row[block][row].take() else {
            return;
        };
        self.row_of_col[block][col] = None;
        self.gain -= self.gradient[block][(row, col)];
        objective.add_variable(Variable { block, row, col }, -1.0, &mut self.gradient);
    }

    /// Sets all pairs of a block.
    fn set_block(&mut self, objective: &impl Objective, block: usize, columns: &[Option<usize>]) {
        for row in 0..columns.len() {
            if self.col_of_row[block][row] != columns[row] {
                self.remove(objective, block, row);
            }
        }
        for (row, col) in columns.iter().enumerate() {
            if let Some(col) = *col
                && self.col_of_row[block][row].is_none()
            {
                self.add(objective, Variable { block, row, col });
            }
        }
    }

    /// Sets blocks to the LSAP of their gradients until the gain stops rising; returns whether it rose.
    pub fn ascend(&mut self, objective: &impl Objective) -> bool {
        let blocks = self.gradient.len();
        let start = self.gain;
        let mut since_change = 0;
        let mut block = 0;
        while since_change < blocks {
            let before = self.gain;
            let columns = best_columns(&self.gradient[block]);
            if columns != self.col_of_row[block] {
                let held = self.col_of_row[block].clone();
                self.set_block(objective, block, &columns);
                if self.gain <= before + eps(before) {
                    self.set_block(objective, block, &held);
                    self.gain = before;
                }
            }
            since_change = if self.gain > before { 1 } else { since_change + 1 };
            if objective.self_coupled(block) && self.gain > before {
                since_change = 0;
            }
            block = (block + 1) % blocks;
        }
        self.gain > start
    }

    /// Moves and swaps until none improves, or `max_moves` were made; returns whether the gain rose.
    pub fn local_search(&mut self, objective: &impl Objective, max_moves: usize) -> bool {
        let start = self.gain;
        let mut moves = 0;
        loop {
            let mut improved = false;
            for block in 0..self.gradient.len() {
                for row in 0..self.col_of_row[block].len() {
                    if moves >= max_moves {
                        return self.gain > start;
                    }
                    if let Some(change) = self.best_move(objective, block, row) {
                        self.apply(objective, block, &change);
                        improved = true;
                        moves += 1;
                    }
                }
            }
            if !improved {
                return self.gain > start;
            }
        }
    }

    fn apply(&mut self, objective: &impl Objective, block: usize, change: &Move) {
        for &row in change.removed.iter().flatten() {
            self.remove(objective, block, row);
        }
        for &(row, col) in change.added.iter().flatten() {
            self.add(objective, Variable { block, row, col });
        }
    }

    /// The best improving move that concerns a row: unmatch it, or give it another column.
    fn best_move(&self, objective: &impl Objective, block: usize, row: usize) -> Option<Move> {
        let held = self.col_of_row[block][row];
        let mut best: Option<(f64, Move)> = None;
        let mut consider = |m: Move| {
            let d = self.delta(objective, block, &m);
            if d > best.as_ref().map_or(eps(self.gain), |b| b.0) {
                best = Some((d, m));
            }
        };
        if held.is_some() {
            consider(Move {
                removed: [Some(row), None],
                added: [None, None],
            });
        }
        let mine = held.map(|_| row);
        for col in 0..self.row_of_col[block].len() {
            if Some(col) == held {
                continue;
            }
            match self.row_of_col[block][col] {
                None => consider(Move {
                    removed: [mine, None],
                    added: [Some((row, col)), None],
                }),
                Some(other) => {
                    consider(Move {
                        removed: [mine, Some(other)],
                        added: [Some((row, col)), None],
                    });
                    if let Some(old) = held
                        && other > row
                    {
                        consider(Move {
                            removed: [mine, Some(other)],
                            added: [Some((row, col)), Some((other, old))],
                        });
                    }
                }
            }
        }
        best.map(|b| b.1)
    }

    /// Exact change of gain of a move within a block.
    fn delta(&self, objective: &impl Objective, block: usize, m: &Move) -> f64 {
        let mut vars: [(Variable, f64); 4] = [(
            Variable {
                block,
                row: 0,
                col: 0,
            },
            0.0,
        ); 4];
        let mut count = 0;
        let mut d = 0.0;
        for &row in m.removed.iter().flatten() {
            let col = self.col_of_row[block][row].expect("only matched rows are removed");
            vars[count] = (Variable { block, row, col }, -1.0);
            d -= self.gradient[block][(row, col)];
            count += 1;
        }
        for &(row, col) in m.added.iter().flatten() {
            vars[count] = (Variable { block, row, col }, 1.0);
            d += self.gradient[block][(row, col)];
            count += 1;
        }
        if d == f64::NEG_INFINITY || !objective.self_coupled(block) {
            return d;
        }
        for i in 0..count {
            for j in 0..i {
                d += vars[i].1 * vars[j].1 * objective.coupling(vars[i].0, vars[j].0);
            }
        }
        d
    }

    /// Gain computed from scratch; equals `gain` up to rounding.
    pub fn recomputed_gain(&self, objective: &impl Objective) -> f64 {
        Self::from_columns(objective, &self.col_of_row).gain
    }
}

/// Rows whose pairs go and pairs that come.
struct Move {
    removed: [Option<usize>; 2],
    added: [Option<(usize, usize)>; 2],
}

fn eps(gain: f64) -> f64 {
    GAIN_EPS * gain.abs().max(1e-300)
}

/// The columns of the greatest total gain, unmatched at gain zero.
pub fn best_columns(gains: &Table) -> Vec<Option<usize>> {
    let costs = Table::from_fn(gains.rows(), gains.cols(), |r, c| -gains[(r, c)].max(0.0));
    let best =
        assignment::solve(&costs).expect("gains are not NaN and none is forbidden after the floor at zero");
    let keep = |(r, c): (usize, Option<usize>)| c.filter(|&c| gains[(r, c)] > 0.0);
    best.col_of_row.into_iter().enumerate().map(keep).collect()
}
