//! Soft starts: uniform, spectral, and given hypotheses.
//!
//! Annealing finds the optimum nearest its start; a few very different starts, of which the best end is kept, cost a
//! small factor and remove most of the bad luck.

use super::objective::Objective;
use crate::table::Table;
use serde::{Deserialize, Serialize};

/// Power iterations of the spectral start; it need only point the right way.
const POWER_ITERATIONS: usize = 30;

/// Where annealing starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartKind {
    /// All pairs alike.
    Uniform,
    /// Leading eigenvector of the gain (Leordeanu & Hebert 2005).
    Spectral,
    /// A match given by the caller, with its position in the list given.
    Hypothesis(usize),
}

/// All allowed pairs alike: `1 / (max(n, m) + 1)`.
pub fn uniform(objective: &impl Objective) -> Vec<Table> {
    let fill = |t: &Table| {
        let value = 1.0 / (t.rows().max(t.cols()) as f64 + 1.0);
        Table::from_fn(t.rows(), t.cols(), |r, c| {
            if t[(r, c)] > f64::NEG_INFINITY { value } else { 0.0 }
        })
    };
    objective.linear().iter().map(fill).collect()
}

/// The leading eigenvector of `K + diag(max(linear, 0))`, every block scaled so that its largest entry is one.
///
/// K has no negative entry, so the eigenvector is non-negative (Perron-Frobenius) and the power iteration from the
/// uniform start converges to it. M. Leordeanu, M. Hebert, "A spectral technique for correspondence problems using
/// pairwise constraints", ICCV 2005.
pub fn spectral(objective: &impl Objective) -> Vec<Table> {
    let mut now = uniform(objective);
    let mut next = objective.zeros();
    for _ in 0..POWER_ITERATIONS {
        for (block, table) in next.iter_mut().enumerate() {
            let linear = &objective.linear()[block];
            for (k, v) in table.values_mut().iter_mut().enumerate() {
                *v = linear.values()[k].max(0.0) * now[block].values()[k];
            }
        }
        objective.add_couplings(&now, &mut next);
        for (block, table) in next.iter_mut().enumerate() {
            for (v, l) in table
                .values_mut()
                .iter_mut()
                .zip(objective.linear()[block].values())
            {
                if *l == f64::NEG_INFINITY {
                    *v = 0.0;
                }
            }
        }
        let norm = next.iter().map(|t| t.dot(t)).sum::<f64>().sqrt();
        if norm.is_nan() || norm <= 0.0 {
            return now;
        }
        for table in &mut next {
            table.values_mut().iter_mut().for_each(|v| *v /= norm);
        }
        std::mem::swap(&mut now, &mut next);
    }
    for table in &mut now {
        let largest = table.values().iter().fold(0.0, |a: f64, &b| a.max(b));
        if largest > 0.0 {
            table.values_mut().iter_mut().for_each(|v| *v /= largest);
        }
    }
    now
}

/// A discrete match as a soft start: `trust` on its pairs, the uniform start scaled by `1 - trust` everywhere.
pub fn hypothesis(objective: &impl Objective, columns: &[Vec<Option<usize>>], trust: f64) -> Vec<Table> {
    let mut soft = uniform(objective);
    for (block, table) in soft.iter_mut().enumerate() {
        table.values_mut().iter_mut().for_each(|v| *v *= 1.0 - trust);
        for (row, col) in columns[block].iter().enumerate() {
            if let Some(col) = *col {
                table[(row, col)] += trust;
            }
        }
    }
    soft
}
