//! Shortest augmenting paths for the rectangular linear sum assignment problem.
//!
//! In: costs `c (n, m)`, finite or `+inf` (forbidden). Out: an assignment of `min(n, m)` pairs of least total cost,
//! and duals `u (n)`, `v (m)` with `u_i + v_j <= c_ij` everywhere, equality on the assigned pairs, and zero on the
//! unassigned elements of the longer side; `sum u + sum v` is therefore a lower bound that meets the cost.
//!
//! 1. The table is turned so that rows are the shorter side.
//! 2. Row reduction: `u_i = min_j c_ij`; a row whose minimum column is free takes it.
//! 3. Augmenting row reduction, two passes: a free row outbids the holder of its best column.
//! 4. For every row left, a Dijkstra search over reduced costs finds the shortest augmenting path; duals are updated
//!    by the path lengths (the augmentation phase of Jonker and Volgenant 1987, in the rectangular form of Crouse 2016).
//!
//! We depart from the original in limiting the bids of step 3, whose loop need not end in floating point, and in having no
//! column reduction, which would spoil the zero duals of unassigned columns. Ties go to the lowest column, so equal inputs
//! give equal outputs. Cost: O(n^2 m) worst case, near O(n m) when steps 2 and 3 settle most rows.
//!
//! R. Jonker, A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear assignment problems",
//! Computing 38 (1987). D. F. Crouse, "On implementing 2D rectangular assignment algorithms", IEEE TAES 52 (2016).

use crate::table::Table;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why an assignment problem has no answer.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum AssignmentError {
    /// A cost is NaN or minus infinity; give a number, or `+inf` to forbid the pair.
    #[error("cost at row {row}, column {col} is {value}; costs are numbers, or +inf for a forbidden pair")]
    BadCost {
        /// Row of the cost.
        row: usize,
        /// Column of the cost.
        col: usize,
        /// The cost found.
        value: f64,
    },
    /// The allowed pairs admit no complete assignment of the shorter side; allow more pairs or use [`super::solve_partial`].
    #[error("no complete assignment exists: {side} {index} cannot be placed with the allowed pairs")]
    Infeasible {
        /// `"row"` or `"column"`: the shorter side.
        side: &'static str,
        /// The element that found no place.
        index: usize,
    },
}

/// An optimal assignment with the duals that prove it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Assignment {
    /// Column of every row; `None` only when there are more rows than columns.
    pub col_of_row: Vec<Option<usize>>,
    /// Row of every column; `None` only when there are more columns than rows.
    pub row_of_col: Vec<Option<usize>>,
    /// Sum of the costs of the assigned pairs.
    pub cost: f64,
    /// Dual price of every row.
    pub row_duals: Vec<f64>,
    /// Dual price of every column.
    pub col_duals: Vec<f64>,
}

impl Assignment {
    /// The dual bound `sum u + sum v`: no assignment is cheaper (up to rounding it equals `cost`).
    pub fn dual_bound(&self) -> f64 {
        self.row_duals.iter().sum::<f64>() + self.col_duals.iter().sum::<f64>()
    }
}

/// Solves the assignment problem for the least cost.
///
/// # Errors
/// [`AssignmentError::BadCost`] on NaN or `-inf`, [`AssignmentError::Infeasible`] when forbidden pairs leave no
/// complete assignment of the shorter side.
///
/// # Complexity
/// O(n^2 m) time for n <= m, O(n m) memory only when the table must be turned.
///
/// # Example
/// ```
/// use matchers::{Table, assignment};
/// let costs = Table::from_row_major(2, 3, vec![4.0, 1.0, 3.5, 2.0, 0.0, 5.0]).unwrap();
/// let best = assignment::solve(&costs).unwrap();
/// assert_eq!(best.col_of_row, vec![Some(1), Some(0)]);
/// assert_eq!(best.cost, 3.0);
/// assert_eq!(best.dual_bound(), 3.0);
/// ```
pub fn solve(costs: &Table) -> Result<Assignment, AssignmentError> {
    for r in 0..costs.rows() {
        if let Some(c) = costs
            .row(r)
            .iter()
            .position(|v| v.is_nan() || *v == f64::NEG_INFINITY)
        {
            return Err(AssignmentError::BadCost {
                row: r,
                col: c,
                value: costs[(r, c)],
            });
        }
    }
    if costs.rows() <= costs.cols() {
        let s = Search::run(costs).map_err(|index| AssignmentError::Infeasible { side: "row", index })?;
        Ok(s.into_assignment(costs, false))
    } else {
        let turned = costs.transposed();
        let s = Search::run(&turned).map_err(|index| AssignmentError::Infeasible {
            side: "column",
            index,
        })?;
        Ok(s.into_assignment(&turned, true))
    }
}

/// Solves the assignment problem for the greatest gain; `-inf` forbids a pair.
///
/// `cost` and the duals of the answer are those of the negated table, so the gain is `-cost`.
///
/// # Errors
/// As [`solve`].
pub fn solve_max(gains: &Table) -> Result<Assignment, AssignmentError> {
    let costs = Table::from_fn(gains.rows(), gains.cols(), |r, c| -gains[(r, c)]);
    solve(&costs)
}

const FREE: usize = usize::MAX;

/// Passes of the augmenting row reduction, as in the original.
const OUTBID_PASSES: usize = 2;

/// State of the search; rows are the shorter side.
struct Search {
    col_of_row: Vec<usize>,
    row_of_col: Vec<usize>,
    u: Vec<f64>,
    v: Vec<f64>,
}

impl Search {
    /// Runs all phases; the error is the row that cannot be placed.
    fn run(costs: &Table) -> Result<Self, usize> {
        let (n, m) = (costs.rows(), costs.cols());
        let mut s = Self {
            col_of_row: vec![FREE; n],
            row_of_col: vec![FREE; m],
            u: vec![0.0; n],
            v: vec![0.0; m],
        };
        s.reduce_rows(costs)?;
        s.outbid(costs);
        let mut work = Work::new(n, m);
        for row in 0..n {
            if s.col_of_row[row] == FREE {
                s.augment(costs, row, &mut work)?;
            }
        }
        Ok(s)
    }

    fn reduce_rows(&mut self, costs: &Table) -> Result<(), usize> {
        for r in 0..costs.rows() {
            let mut best = (f64::INFINITY, FREE);
            for (c, &cost) in costs.row(r).iter().enumerate() {
                if cost < best.0 {
                    best = (cost, c);
                }
            }
            if best.1 == FREE {
                return Err(r);
            }
            self.u[r] = best.0;
            if self.row_of_col[best.1] == FREE {
                self.row_of_col[best.1] = r;
                self.col_of_row[r] = best.1;
            }
        }
        Ok(())
    }

    /// Augmenting row reduction: a free row takes its best column from whoever has it and pays by lowering the column's dual
    /// to where its second best column is as good.
    fn outbid(&mut self, costs: &Table) {
        for _ in 0..OUTBID_PASSES {
            let mut free: Vec<usize> = (0..costs.rows())
                .rev()
                .filter(|&r| self.col_of_row[r] == FREE)
                .collect();
            // The loop may chase ties for ever in floating point; rows left over are augmented.
            let mut bids = 2 * costs.rows();
            while let Some(row) = free.pop() {
                let (first, second) = self.two_best(costs, row);
                let Some(((least, col), next)) = first.zip(second) else {
                    continue;
                };
                self.u[row] = next;
                let holder = self.row_of_col[col];
                if holder != FREE && next <= least {
                    continue;
                }
                self.v[col] -= next - least;
                self.row_of_col[col] = row;
                self.col_of_row[row] = col;
                if holder != FREE {
                    self.col_of_row[holder] = FREE;
                    if bids > 0 {
                        bids -= 1;
                        free.push(holder);
                    }
                }
            }
        }
    }

    /// Least reduced cost of a row with its column, and the second least.
    fn two_best(&self, costs: &Table, row: usize) -> (Option<(f64, usize)>, Option<f64>) {
        let (mut first, mut second) = ((f64::INFINITY, FREE), f64::INFINITY);
        for (c, (cost, v)) in costs.row(row).iter().zip(&self.v).enumerate() {
            let reduced = cost - v;
            if reduced < first.0 {
                second = first.0;
                first = (reduced, c);
            } else if reduced < second {
                second = reduced;
            }
        }
        (
            (first.1 != FREE).then_some(first),
            (second < f64::INFINITY).then_some(second),
        )
    }

    fn augment(&mut self, costs: &Table, start: usize, work: &mut Work) -> Result<(), usize> {
        work.reset();
        let mut row = start;
        let mut shortest = 0.0;
        let sink = loop {
            work.seen_rows.push(row);
            let base = shortest - self.u[row];
            let costs_of_row = costs.row(row);
            let mut best = (f64::INFINITY, FREE);
            for (k, &c) in work.open_cols.iter().enumerate() {
                let reduced = base + costs_of_row[c] - self.v[c];
                if reduced < work.path_length[c] {
                    work.path_length[c] = reduced;
                    work.came_from[c] = row;
                }
                let d = work.path_length[c];
                // A free column first among equals: it ends the search. Then the lowest column.
                let wins = d < best.0
                    || (d == best.0 && d < f64::INFINITY && {
                        let held = work.open_cols[best.1];
                        let (free, held_free) = (self.row_of_col[c] == FREE, self.row_of_col[held] == FREE);
                        (free && !held_free) || (free == held_free && c < held)
                    });
                if wins {
                    best = (d, k);
                }
            }
            if best.1 == FREE {
                return Err(start);
            }
            shortest = best.0;
            let col = work.open_cols.swap_remove(best.1);
            work.closed_cols.push(col);
            if self.row_of_col[col] == FREE {
                break col;
            }
            row = self.row_of_col[col];
        };
        self.update_duals(start, shortest, work);
        self.flip_path(start, sink, work);
        Ok(())
    }

    fn update_duals(&mut self, start: usize, shortest: f64, work: &Work) {
        for &r in &work.seen_rows {
            self.u[r] += if r == start {
                shortest
            } else {
                shortest - work.path_length[self.col_of_row[r]]
            };
        }
        for &c in &work.closed_cols {
            self.v[c] -= shortest - work.path_length[c];
        }
    }

    fn flip_path(&mut self, start: usize, sink: usize, work: &Work) {
        let mut col = sink;
        loop {
            let row = work.came_from[col];
            self.row_of_col[col] = row;
            std::mem::swap(&mut self.col_of_row[row], &mut col);
            if row == start {
                break;
            }
        }
    }

    fn into_assignment(self, costs: &Table, turned: bool) -> Assignment {
        let cost = self
            .col_of_row
            .iter()
            .enumerate()
            .map(|(r, &c)| costs[(r, c)])
            .sum();
        let lift = |v: Vec<usize>| v.into_iter().map(|k| (k != FREE).then_some(k)).collect();
        let (rows, cols) = (lift(self.col_of_row), lift(self.row_of_col));
        if turned {
            Assignment {
                col_of_row: cols,
                row_of_col: rows,
                cost,
                row_duals: self.v,
                col_duals: self.u,
            }
        } else {
            Assignment {
                col_of_row: rows,
                row_of_col: cols,
                cost,
                row_duals: self.u,
                col_duals: self.v,
            }
        }
    }
}

/// Scratch of one Dijkstra search, kept between rows.
struct Work {
    path_length: Vec<f64>,
    came_from: Vec<usize>,
    open_cols: Vec<usize>,
    closed_cols: Vec<usize>,
    seen_rows: Vec<usize>,
}

impl Work {
    fn new(n: usize, m: usize) -> Self {
        Self {
            path_length: vec![f64::INFINITY; m],
            came_from: vec![FREE; m],
            open_cols: Vec::with_capacity(m),
            closed_cols: Vec::with_capacity(m),
            seen_rows: Vec::with_capacity(n),
        }
    }

    fn reset(&mut self) {
        let m = self.path_length.len();
        self.path_length.fill(f64::INFINITY);
        self.came_from.fill(FREE);
        self.open_cols.clear();
        self.open_cols.extend(0..m);
        self.closed_cols.clear();
        self.seen_rows.clear();
    }
}
