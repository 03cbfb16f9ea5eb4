//! The assignment solver against brute force and an independent solver, with its dual certificate.

use matchers::{AssignmentError, Table, assignment};
use ordered_float::OrderedFloat;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn random_table(rng: &mut ChaCha8Rng, n: usize, m: usize, levels: Option<u32>, forbidden: f64) -> Table {
    Table::from_fn(n, m, |_, _| {
        if rng.random::<f64>() < forbidden {
            f64::INFINITY
        } else {
            match levels {
                Some(k) => f64::from(rng.random_range(0..k)),
                None => rng.random_range(-1.0..1.0),
            }
        }
    })
}

/// Cheapest complete assignment of the rows by trying all (rows not more than columns).
fn brute(costs: &Table, row: usize, taken: &mut Vec<bool>) -> f64 {
    if row == costs.rows() {
        return 0.0;
    }
    let mut best = f64::INFINITY;
    for c in 0..costs.cols() {
        if !taken[c] {
            taken[c] = true;
            best = best.min(costs[(row, c)] + brute(costs, row + 1, taken));
            taken[c] = false;
        }
    }
    best
}

fn check_certificate(costs: &Table, a: &matchers::Assignment) {
    let scale = 1.0 + a.cost.abs();
    for r in 0..costs.rows() {
        for c in 0..costs.cols() {
            let reduced = costs[(r, c)] - a.row_duals[r] - a.col_duals[c];
            assert!(reduced >= -1e-9 * scale, "dual infeasible at {r},{c}: {reduced}");
        }
        if let Some(c) = a.col_of_row[r] {
            assert_eq!(a.row_of_col[c], Some(r));
            assert!((costs[(r, c)] - a.row_duals[r] - a.col_duals[c]).abs() < 1e-9 * scale);
        }
    }
    assert!(
        (a.dual_bound() - a.cost).abs() < 1e-9 * scale,
        "gap {} {}",
        a.dual_bound(),
        a.cost
    );
}

#[test]
fn equals_brute_force_on_small_tables() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for trial in 0..400 {
        let (n, m) = (rng.random_range(1..=5), rng.random_range(1..=6));
        let levels = (trial % 2 == 0).then_some(4);
        let costs = random_table(&mut rng, n, m, levels, if trial % 3 == 0 { 0.4 } else { 0.0 });
        let narrow = if n <= m { costs.clone() } else { costs.transposed() };
        let truth = brute(&narrow, 0, &mut vec![false; narrow.cols()]);
        match assignment::solve(&costs) {
            Ok(a) => {
                assert!(
                    (a.cost - truth).abs() < 1e-9,
                    "trial {trial}: {} against {truth}",
                    a.cost
                );
                assert_eq!(a.col_of_row.iter().flatten().count(), n.min(m));
                check_certificate(&costs, &a);
            }
            Err(AssignmentError::Infeasible { side, .. }) => {
                assert_eq!(truth, f64::INFINITY, "trial {trial}");
                assert_eq!(side, if n <= m { "row" } else { "column" });
            }
            Err(e) => panic!("{e}"),
        }
    }
}

#[test]
fn equals_an_independent_solver_on_larger_tables() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for (n, m) in [(30, 30), (40, 60), (60, 40), (1, 50), (120, 125)] {
        for levels in [None, Some(10)] {
            let costs = random_table(&mut rng, n, m, levels, 0.0);
            let ours = assignment::solve(&costs).unwrap();
            let narrow = if n <= m { costs.clone() } else { costs.transposed() };
            let values: Vec<_> = narrow.values().iter().map(|&v| OrderedFloat(v)).collect();
            let matrix = pathfinding::matrix::Matrix::from_vec(narrow.rows(), narrow.cols(), values).unwrap();
            let (theirs, _) = pathfinding::prelude::kuhn_munkres_min(&matrix);
            assert!((ours.cost - theirs.0).abs() < 1e-9, "{n} x {m}");
            check_certificate(&costs, &ours);
        }
    }
}

#[test]
fn bad_costs_are_named() {
    let mut costs = Table::zeros(2, 2);
    costs[(1, 0)] = f64::NAN;
    let e = assignment::solve(&costs).unwrap_err();
    assert!(e.to_string().contains("row 1, column 0"), "{e}");
    costs[(1, 0)] = f64::NEG_INFINITY;
    assert!(assignment::solve(&costs).is_err());
    assert!(assignment::solve_partial(&costs, &[1.0, 1.0], &[1.0, 1.0]).is_err());
}

#[test]
fn empty_tables_have_an_empty_answer() {
    for (n, m) in [(0, 0), (0, 3), (3, 0)] {
        let a = assignment::solve(&Table::zeros(n, m)).unwrap();
        assert_eq!(a.cost, 0.0);
        assert_eq!((a.col_of_row.len(), a.row_of_col.len()), (n, m));
    }
}

#[test]
fn ties_are_broken_the_same_way() {
    let costs = Table::zeros(4, 6);
    let a = assignment::solve(&costs).unwrap();
    assert_eq!(a.col_of_row, vec![Some(0), Some(1), Some(2), Some(3)]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// The reduced n x m problem against the (n + m) x (n + m) table of Riesen and Bunke.
    #[test]
    fn partial_equals_the_full_table(seed in 0u64..1_000_000, n in 0usize..6, m in 0usize..6) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let costs = random_table(&mut rng, n, m, Some(6), 0.2);
        let rows: Vec<f64> = (0..n).map(|_| f64::from(rng.random_range(0..5u32))).collect();
        let cols: Vec<f64> = (0..m).map(|_| f64::from(rng.random_range(0..5u32))).collect();
        let full = Table::from_fn(n + m, n + m, |r, c| match (r < n, c < m) {
            (true, true) => costs[(r, c)],
            (true, false) => if c - m == r { rows[r] } else { f64::INFINITY },
            (false, true) => if r - n == c { cols[c] } else { f64::INFINITY },
            (false, false) => 0.0,
        });
        let truth = assignment::solve(&full).unwrap().cost;
        let ours = assignment::solve_partial(&costs, &rows, &cols).unwrap();
        prop_assert!((ours.cost - truth).abs() < 1e-9);
    }
}
