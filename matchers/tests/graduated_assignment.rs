//! Graduated assignment: the objective's identities, balancing at any temperature, recovery of known matches.

mod common;

use common::{permuted, problem_of, random_hypergraph, settings_scales};
use matchers::graduated_assignment::discrete::Discrete;
use matchers::graduated_assignment::objective::{HypergraphObjective, Objective};
use matchers::graduated_assignment::sinkhorn::Sinkhorn;
use matchers::graduated_assignment::{MatchSettings, match_hypergraphs};
use matchers::matching_problem::ElementMap;
use matchers::{ElementCosts, EvidenceSettings, MatchingProblem, Table};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[test]
fn balancing_sums_to_one_at_any_temperature() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for temperature in [100.0, 1.0, 1e-2, 1e-4, 1e-6] {
        let mut scores = Table::from_fn(7, 9, |_, _| rng.random_range(-1.0..1.0) / temperature);
        scores[(2, 3)] = f64::NEG_INFINITY;
        let mut out = Table::zeros(7, 9);
        let sweeps = Sinkhorn::default().balance(&scores, 0.0, 20_000, 1e-9, &mut out);
        assert!(out.values().iter().all(|v| v.is_finite() && *v >= 0.0));
        assert_eq!(out[(2, 3)], 0.0);
        for r in 0..7 {
            assert!(out.row(r).iter().sum::<f64>() <= 1.0 + 1e-6);
        }
        for c in 0..9 {
            assert!((0..7).map(|r| out[(r, c)]).sum::<f64>() <= 1.0 + 1e-6);
        }
        // Near ties make the last digits slow when it is cold; warm, a few dozen sweeps do.
        assert!(
            sweeps < 100 || temperature < 1.0,
            "{sweeps} sweeps at {temperature}"
        );
        if temperature == 1e-4 {
            // Cold enough to be the assignment itself.
            let best = matchers::graduated_assignment::discrete::best_columns(&scores);
            for r in 0..7 {
                for c in 0..9 {
                    let truth = if best[r] == Some(c) { 1.0 } else { 0.0 };
                    assert!(
                        (out[(r, c)] - truth).abs() < 1e-3,
                        "T {temperature} at {r},{c}: {}",
                        out[(r, c)]
                    );
                }
            }
        }
    }
}

/// Price from its definition against the constant minus the gain, on random maps.
#[test]
fn price_is_total_minus_gain() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..60 {
        let g = random_hypergraph(&mut rng, 6, 9, 4);
        let h = random_hypergraph(&mut rng, 5, 8, 5);
        let problem = problem_of(&g, &h);
        let objective = HypergraphObjective::new(&problem);
        let mut state = Discrete::empty(&objective);
        for block in 0..3 {
            for row in 0..problem.target.count(block) {
                let col = rng.random_range(0..problem.source.count(block));
                if rng.random::<f64>() < 0.7 && state.row_of_col[block][col].is_none() {
                    state.add(
                        &objective,
                        matchers::graduated_assignment::objective::Variable { block, row, col },
                    );
                }
            }
        }
        let map = ElementMap {
            source_of_target: [0, 1, 2]
                .map(|k| state.col_of_row[k].iter().map(|c| c.map(|c| c as u32)).collect()),
        };
        let price = problem.price(&map);
        assert!((problem.total() - state.gain - price).abs() < 1e-9 * problem.total());
        assert!((state.gain - state.recomputed_gain(&objective)).abs() < 1e-9 * problem.total());
        // The gradient kept step by step is the gradient of the final state.
        let soft: Vec<Table> = (0..3)
            .map(|b| {
                let l = &objective.linear()[b];
                Table::from_fn(l.rows(), l.cols(), |r, c| {
                    f64::from(state.col_of_row[b][r] == Some(c))
                })
            })
            .collect();
        let mut gradient = objective.zeros();
        objective.gradient(&soft, &mut gradient);
        for b in 0..3 {
            for (a, c) in gradient[b].values().iter().zip(state.gradient[b].values()) {
                assert!((a - c).abs() < 1e-9 * problem.total());
            }
        }
    }
}

#[test]
fn a_hypergraph_matches_its_permuted_self() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for trial in 0..40 {
        let g = random_hypergraph(&mut rng, 8, 12, 5);
        let (h, places) = permuted(&g, &mut rng);
        let found = match_hypergraphs(&problem_of(&g, &h), &[], &MatchSettings::default());
        assert!(found.price < 1e-9, "trial {trial}: {}", found.price);
        assert!((found.similarity - 1.0).abs() < 1e-12);
        for pair in &found.curves {
            assert_eq!(places[1][pair.target as usize], pair.source as usize);
        }
    }
}

/// Elements near the cut cost about nothing, whether they are there or not.
#[test]
fn light_elements_cost_their_weight() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let g = random_hypergraph(&mut rng, 8, 12, 5);
    let mut h = g.clone();
    for light in [1e-3, 1e-6] {
        let a = h.add_node(light, vec![9.0]).unwrap();
        let c = h
            .add_curve(
                matchers::CurveEnds::Two(a, matchers::NodeId(0)),
                light,
                vec![40.0, 1.0],
            )
            .unwrap();
        h.add_sheet(vec![c], light, vec![3.0]).unwrap();
        let found = match_hypergraphs(&problem_of(&g, &h), &[], &MatchSettings::default());
        assert!(found.price < 20.0 * light.max(1e-3), "{}", found.price);
    }
}

#[test]
fn a_hypothesis_is_never_made_worse() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..20 {
        let g = random_hypergraph(&mut rng, 7, 10, 4);
        let (h, places) = permuted(&g, &mut rng);
        let truth = ElementMap {
            source_of_target: [0, 1, 2].map(|k| places[k].iter().map(|&p| Some(p as u32)).collect()),
        };
        // All attributes alike, so that only the structure and the hypothesis speak.
        let zero = |k| Table::zeros(g.count(k), h.count(k));
        use matchers::hypergraph::Kind;
        let costs = ElementCosts {
            nodes: zero(Kind::Node),
            curves: zero(Kind::Curve),
            sheets: zero(Kind::Sheet),
        };
        let problem = MatchingProblem::new(&g, &h, &costs, &EvidenceSettings::default()).unwrap();
        let at_truth = problem.price(&truth);
        let found = match_hypergraphs(&problem, &[truth], &MatchSettings::default());
        assert!(found.price <= at_truth + 1e-9);
        assert_eq!(found.prices.len(), 3);
    }
}

#[test]
fn forbidden_pairs_are_never_matched() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let g = random_hypergraph(&mut rng, 6, 9, 4);
    let mut costs = ElementCosts::from_attributes(&g, &g, &settings_scales()).unwrap();
    for k in 0..6 {
        costs.nodes[(k, k)] = f64::INFINITY;
    }
    let problem = MatchingProblem::new(&g, &g, &costs, &EvidenceSettings::default()).unwrap();
    let found = match_hypergraphs(&problem, &[], &MatchSettings::default());
    assert!(found.nodes.iter().all(|p| p.target != p.source));
    assert!(found.price.is_finite());
}

#[test]
fn empty_graphs_are_equal_and_everything_is_spliced_against_them() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let empty = matchers::AttributedHypergraph::new();
    let g = random_hypergraph(&mut rng, 4, 5, 2);
    let none = match_hypergraphs(&problem_of(&empty, &empty), &[], &MatchSettings::default());
    assert_eq!((none.price, none.similarity), (0.0, 1.0));
    let problem = problem_of(&g, &empty);
    let all = match_hypergraphs(&problem, &[], &MatchSettings::default());
    assert!((all.price - problem.total()).abs() < 1e-9);
    assert!(all.similarity.abs() < 1e-12);
}

/// The same bits for either direction and any order of the elements; the same pairs, carried along.
#[test]
fn symmetric_and_independent_of_order_to_the_bit() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for _ in 0..15 {
        let g = random_hypergraph(&mut rng, 9, 14, 5);
        let h = random_hypergraph(&mut rng, 8, 12, 6);
        let settings = MatchSettings {
            kicks: 3,
            ..MatchSettings::default()
        };
        let there = match_hypergraphs(&problem_of(&g, &h), &[], &settings);
        let back = match_hypergraphs(&problem_of(&h, &g), &[], &settings);
        assert_eq!(there.price.to_bits(), back.price.to_bits());
        for (a, b) in [
            (&there.nodes, &back.nodes),
            (&there.curves, &back.curves),
            (&there.sheets, &back.sheets),
        ] {
            let mut turned: Vec<_> = b
                .iter()
                .map(|p| (p.source, p.target, p.confidence.to_bits()))
                .collect();
            turned.sort_unstable();
            assert_eq!(
                a.iter()
                    .map(|p| (p.target, p.source, p.confidence.to_bits()))
                    .collect::<Vec<_>>(),
                turned
            );
        }
        let (p, places) = permuted(&g, &mut rng);
        let moved = match_hypergraphs(&problem_of(&p, &h), &[], &settings);
        assert_eq!(there.price.to_bits(), moved.price.to_bits());
        for pair in &there.nodes {
            let at = places[0][pair.target as usize] as u32;
            assert!(
                moved
                    .nodes
                    .iter()
                    .any(|q| (q.target, q.source) == (at, pair.source))
            );
        }
    }
}
