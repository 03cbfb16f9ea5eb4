//! Dense table of numbers, row-major.
//!
//! Everywhere in this crate a row stands for an element of the **target** and a column for an element of the
//! **source**. nalgebra's matrices are column-major; the solvers here walk rows, and rows of a few dozen numbers that
//! lie together are what makes them fast.

use serde::{Deserialize, Serialize};

/// Dense `rows x cols` table of `f64`, row-major.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Table {
    rows: usize,
    cols: usize,
    values: Vec<f64>,
}

impl Table {
    /// Makes a table with every entry equal to `value`.
    pub fn filled(rows: usize, cols: usize, value: f64) -> Self {
        Self {
            rows,
            cols,
            values: vec![value; rows * cols],
        }
    }

    /// Makes a table of zeros.
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self::filled(rows, cols, 0.0)
    }

    /// Makes a table from a function of row and column.
    ///
    /// ```
    /// let t = matchers::Table::from_fn(2, 3, |r, c| (10 * r + c) as f64);
    /// assert_eq!(t[(1, 2)], 12.0);
    /// ```
    pub fn from_fn(rows: usize, cols: usize, mut f: impl FnMut(usize, usize) -> f64) -> Self {
        let mut values = Vec::with_capacity(rows * cols);
        for r in 0..rows {
            for c in 0..cols {
                values.push(f(r, c));
            }
        }
        Self { rows, cols, values }
    }

    /// Makes a table from row-major values; `None` when their number is not `rows * cols`.
    pub fn from_row_major(rows: usize, cols: usize, values: Vec<f64>) -> Option<Self> {
        (values.len() == rows * cols).then_some(Self { rows, cols, values })
    }

    /// Number of rows (elements of the target).
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns (elements of the source).
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// One row.
    pub fn row(&self, r: usize) -> &[f64] {
        &self.values[r * self.cols..(r + 1) * self.cols]
    }

    /// One row, to be changed.
    pub fn row_mut(&mut self, r: usize) -> &mut [f64] {
        &mut self.values[r * self.cols..(r + 1) * self.cols]
    }

    /// All values, row-major.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All values, row-major, to be changed.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Sets every entry.
    pub fn fill(&mut self, value: f64) {
        self.values.fill(value);
    }

    /// Copies another table of the same size into this one.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn copy_from(&mut self, other: &Table) {
        assert_eq!(
            (self.rows, self.cols),
            (other.rows, other.cols),
            "tables of different size"
        );
        self.values.copy_from_slice(&other.values);
    }

    /// The table with rows and columns exchanged.
    pub fn transposed(&self) -> Table {
        Table::from_fn(self.cols, self.rows, |r, c| self[(c, r)])
    }

    /// Sum of the products of equal places.
    pub fn dot(&self, other: &Table) -> f64 {
        self.values.iter().zip(&other.values).map(|(a, b)| a * b).sum()
    }

    /// Place and value of the first entry that is not a number, if there is one.
    pub fn first_nan(&self) -> Option<(usize, usize)> {
        self.values
            .iter()
            .position(|v| v.is_nan())
            .map(|k| (k / self.cols, k % self.cols))
    }
}

impl std::ops::Index<(usize, usize)> for Table {
    type Output = f64;
    fn index(&self, (r, c): (usize, usize)) -> &f64 {
        debug_assert!(r < self.rows && c < self.cols);
        &self.values[r * self.cols + c]
    }
}

impl std::ops::IndexMut<(usize, usize)> for Table {
    fn index_mut(&mut self, (r, c): (usize, usize)) -> &mut f64 {
        debug_assert!(r < self.rows && c < self.cols);
        &mut self.values[r * self.cols + c]
    }
}
