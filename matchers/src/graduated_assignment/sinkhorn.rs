//! Sinkhorn balancing with slack, stable at any temperature.
//!
//! In: scores `S (n, m)` already divided by the temperature, and the score of staying unmatched. Out: the table
//! `M_xy = exp(S_xy + u_x + v_y)` whose rows and columns sum to one together with their slack entries
//! `exp(slack + u_x)` and `exp(slack + v_y)`: the maximum-entropy doubly sub-stochastic table for those scores.
//!
//! 1. Take the column potentials of the call before (zero at first), and `u_x = -max(slack, max_y (S_xy + v_y))`, so that
//!    no exponential exceeds one. Scores change little from call to call, so a few sweeps do.
//! 2. Tabulate `exp(S + u + v)` once and balance by multiplying row and column factors only.
//! 3. When a factor leaves `[1e-50, 1e50]`, move its logarithm into the potentials and tabulate again.
//!
//! This is the log-domain iteration with the exponentials of most sweeps saved (the absorption of Schmitzer 2019,
//! "Stabilized sparse scaling algorithms for entropy regularized transport problems"); Gold & Rangarajan's original
//! exponentiates the scores directly, which overflows at low temperature. A score of `-inf` is an entry of zero.
//! Cost: O(n m) a sweep. The slack is explicit, as in Gold & Rangarajan 1996, and balanced in neither direction.

use crate::table::Table;

/// Factors beyond this size are absorbed into the potentials.
const ABSORB: f64 = 1e50;

/// Scratch of the balancing; the column potentials of one call are where the next call starts.
#[derive(Debug, Clone, Default)]
pub struct Sinkhorn {
    u: Vec<f64>,
    v: Vec<f64>,
    row_factor: Vec<f64>,
    col_factor: Vec<f64>,
    col_sum: Vec<f64>,
}

impl Sinkhorn {
    /// Balances `scores` into `out`; returns the number of sweeps done.
    ///
    /// Stops when no row or column sum (slack included) is further than `tolerance` from one, or after `max_sweeps`.
    ///
    /// # Panics
    /// When the tables differ in size.
    pub fn balance(
        &mut self,
        scores: &Table,
        slack: f64,
        max_sweeps: usize,
        tolerance: f64,
        out: &mut Table,
    ) -> usize {
        let (n, m) = (scores.rows(), scores.cols());
        assert_eq!((n, m), (out.rows(), out.cols()), "tables of different size");
        self.u.clear();
        self.u
            .extend((0..n).map(|x| -scores.row(x).iter().fold(slack, |a, &b| a.max(b))));
        self.v.clear();
        self.v.resize(m, -slack.max(0.0));
        self.tabulate(scores, out);
        let mut sweeps = 0;
        while sweeps < max_sweeps {
            sweeps += 1;
            let change = self.sweep(slack, out);
            let extreme = |f: &f64| *f > ABSORB || *f < 1.0 / ABSORB;
            if self.row_factor.iter().any(extreme) || self.col_factor.iter().any(extreme) {
                self.absorb();
                self.tabulate(scores, out);
            } else if change < tolerance {
                break;
            }
        }
        for x in 0..n {
            let a = self.row_factor[x];
            for (value, b) in out.row_mut(x).iter_mut().zip(&self.col_factor) {
                *value *= a * b;
            }
        }
        self.absorb();
        sweeps
    }

    /// Keeps the column potentials for the next balancing when the temperature falls by `cooling` in between.
    ///
    /// Potentials are differences of score, which grow as the temperature falls.
    pub fn cool(&mut self, cooling: f64) {
        self.v.iter_mut().for_each(|v| *v /= cooling);
    }

    fn tabulate(&mut self, scores: &Table, out: &mut Table) {
        for x in 0..scores.rows() {
            let u = self.u[x];
            for (y, (o, s)) in out.row_mut(x).iter_mut().zip(scores.row(x)).enumerate() {
                *o = (s + u + self.v[y]).exp();
            }
        }
        self.row_factor.clear();
        self.row_factor.resize(scores.rows(), 1.0);
        self.col_factor.clear();
        self.col_factor.resize(scores.cols(), 1.0);
    }

    /// One row and one column normalisation; returns the largest relative change of a column factor, which is how far
    /// the row sums are from one afterwards.
    fn sweep(&mut self, slack: f64, kernel: &Table) -> f64 {
        self.col_sum.clear();
        self.col_sum.resize(kernel.cols(), 0.0);
        for x in 0..kernel.rows() {
            let row = kernel.row(x);
            let sum: f64 = row.iter().zip(&self.col_factor).map(|(k, b)| k * b).sum();
            let a = 1.0 / (sum + (slack + self.u[x]).exp()).max(f64::MIN_POSITIVE);
            self.row_factor[x] = a;
            for (s, k) in self.col_sum.iter_mut().zip(row) {
                *s += a * k;
            }
        }
        let mut change: f64 = 0.0;
        for y in 0..kernel.cols() {
            let b = 1.0 / (self.col_sum[y] + (slack + self.v[y]).exp()).max(f64::MIN_POSITIVE);
            change = change.max((b / self.col_factor[y] - 1.0).abs());
            self.col_factor[y] = b;
        }
        change
    }

    fn absorb(&mut self) {
        for (u, a) in self.u.iter_mut().zip(&self.row_factor) {
            *u += a.ln();
        }
        for (v, b) in self.v.iter_mut().zip(&self.col_factor) {
            *v += b.ln();
        }
    }
}
