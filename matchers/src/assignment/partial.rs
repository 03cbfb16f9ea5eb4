//! Assignment in which every element may stay unmatched at a price.
//!
//! In: costs `c (n, m)`, prices `d (n)` and `e (m)` of leaving a row or column unmatched. Out: the partial one-to-one
//! map of least `sum_matched c_ij + sum_unmatched d_i + sum_unmatched e_j`.
//!
//! The total equals `sum d + sum e + sum_matched (c_ij - d_i - e_j)`, so an `n x m` problem with entries
//! `min(0, c_ij - d_i - e_j)` has the same optimum as the `(n+m) x (n+m)` table of Riesen and Bunke (2009), at a
//! fraction of its cost (Serratosa 2014, "Fast computation of bipartite graph matching"); a pair whose entry is zero
//! is left unmatched, so a substitution that costs as much as two deletions is reported as two deletions.

use super::jonker_volgenant::{AssignmentError, solve};
use crate::table::Table;
use serde::{Deserialize, Serialize};

/// A cheapest partial assignment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartialAssignment {
    /// Column of every matched row.
    pub col_of_row: Vec<Option<usize>>,
    /// Row of every matched column.
    pub row_of_col: Vec<Option<usize>>,
    /// Costs of the matched pairs plus prices of the unmatched elements.
    pub cost: f64,
}

/// Finds the cheapest partial assignment.
///
/// `+inf` in `costs` forbids a pair; prices must be finite.
///
/// # Errors
/// [`AssignmentError::BadCost`] on NaN or `-inf`. Never infeasible.
///
/// # Panics
/// When the number of prices is not that of rows or columns.
///
/// # Example
/// ```
/// use matchers::{Table, assignment};
/// let costs = Table::from_row_major(1, 2, vec![5.0, f64::INFINITY]).unwrap();
/// let best = assignment::solve_partial(&costs, &[1.0], &[1.0, 2.0]).unwrap();
/// assert_eq!(best.col_of_row, vec![None]); // 5 is dearer than leaving both out for 1 + 1
/// assert_eq!(best.cost, 4.0);
/// ```
pub fn solve_partial(
    costs: &Table,
    row_price: &[f64],
    col_price: &[f64],
) -> Result<PartialAssignment, AssignmentError> {
    let (n, m) = (costs.rows(), costs.cols());
    assert!(
        row_price.len() == n && col_price.len() == m,
        "one price a row and a column"
    );
    let change = Table::from_fn(n, m, |r, c| {
        let cost = costs[(r, c)];
        if cost == f64::INFINITY {
            0.0
        } else {
            // NaN and -inf must reach the solver's own check, and f64::min would drop a NaN.
            let d = cost - row_price[r] - col_price[c];
            if d >= 0.0 { 0.0 } else { d }
        }
    });
    let full = solve(&change)?;
    let mut best = PartialAssignment {
        col_of_row: vec![None; n],
        row_of_col: vec![None; m],
        cost: 0.0,
    };
    for r in 0..n {
        match full.col_of_row[r] {
            Some(c) if change[(r, c)] < 0.0 => {
                best.col_of_row[r] = Some(c);
                best.row_of_col[c] = Some(r);
                best.cost += costs[(r, c)];
            }
            _ => best.cost += row_price[r],
        }
    }
    for c in 0..m {
        if best.row_of_col[c].is_none() {
            best.cost += col_price[c];
        }
    }
    Ok(best)
}
