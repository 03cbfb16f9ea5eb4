//! Properties of matches and distances on random hypergraphs with loops, parallel and closed curves, slits and corners.
//!
//! Every case is made from one seed, which a failure prints; `MEDIAL_SEED=17 cargo test -p matchers --test properties` runs that one alone.

mod common;

use common::{edited, permuted, problem_of, random_hypergraph, settings_scales};
use matchers::edit_distance::{EditDistance, EditSettings, Operation, edit_distance};
use matchers::graduated_assignment::{MatchSettings, match_hypergraphs};
use matchers::{AttributedHypergraph, CurveEnds, ElementCosts};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A hypergraph, a relative of it, and the generator for more.
struct Case {
    g: AttributedHypergraph,
    h: AttributedHypergraph,
    rng: ChaCha8Rng,
}

fn case(seed: u64) -> Case {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (n, c, s) = (
        rng.random_range(0..7),
        rng.random_range(0..9),
        rng.random_range(0..4),
    );
    let g = random_hypergraph(&mut rng, n, c, s);
    let h = if rng.random::<bool>() {
        edited(&g, &mut rng, (1, 2, 0.1))
    } else {
        random_hypergraph(&mut rng, n / 2, c, s)
    };
    Case { g, h, rng }
}

/// Runs a property on many seeds, or on the one that the environment names.
fn for_seeds(property: impl Fn(u64, Case)) {
    let one = std::env::var("MEDIAL_SEED").ok().and_then(|s| s.parse().ok());
    let many = if std::env::var_os("MEDIAL_SLOW").is_some() {
        1000
    } else {
        40
    };
    for seed in one.map_or(0..many, |s: u64| s..s + 1) {
        property(seed, case(seed));
    }
}

/// Small enough a limit that some of the searches end before their proof.
fn settings() -> EditSettings {
    EditSettings {
        max_search_nodes: 400,
        ..EditSettings::default()
    }
}

fn distance(g: &AttributedHypergraph, h: &AttributedHypergraph) -> EditDistance {
    let costs = ElementCosts::from_attributes(g, h, &settings_scales()).unwrap();
    edit_distance(g, h, &costs, &settings()).unwrap()
}

#[test]
fn a_hypergraph_is_at_no_distance_from_itself() {
    for_seeds(|seed, mut c| {
        let same = permuted(&c.g, &mut c.rng).0;
        let d = distance(&c.g, &same);
        assert!(d.exact && d.upper_bound <= 1e-9, "seed {seed}: {}", d.upper_bound);
        assert!(
            d.operations.iter().all(|o| matches!(o, Operation::Deform { .. })),
            "seed {seed}"
        );
    });
}

#[test]
fn the_distance_is_symmetric() {
    for_seeds(|seed, c| {
        let (d, back) = (distance(&c.g, &c.h), distance(&c.h, &c.g));
        assert!((d.upper_bound - back.upper_bound).abs() <= 1e-9, "seed {seed}");
        assert!((d.lower_bound - back.lower_bound).abs() <= 1e-9, "seed {seed}");
    });
}

#[test]
fn the_order_of_the_elements_does_not_matter() {
    for_seeds(|seed, mut c| {
        let (g, h) = (permuted(&c.g, &mut c.rng).0, permuted(&c.h, &mut c.rng).0);
        let (d, again) = (distance(&c.g, &c.h), distance(&g, &h));
        assert!((d.upper_bound - again.upper_bound).abs() <= 1e-9, "seed {seed}");
        let matched = |g, h| match_hypergraphs(&problem_of(g, h), &[], &MatchSettings::default()).price;
        assert!(
            (matched(&c.g, &c.h) - matched(&g, &h)).abs() <= 1e-9,
            "seed {seed}"
        );
    });
}

#[test]
fn bounds_bracket_and_prices_add_up() {
    for_seeds(|seed, c| {
        let d = distance(&c.g, &c.h);
        assert!(
            0.0 <= d.lower_bound && d.lower_bound <= d.upper_bound,
            "seed {seed}"
        );
        let sum: f64 = d.operations.iter().map(Operation::price).sum();
        assert!((sum - d.upper_bound).abs() <= 1e-9 * (1.0 + sum), "seed {seed}");
        // More room to search never loosens a bound, and the answers stay between the bounds.
        let costs = ElementCosts::from_attributes(&c.g, &c.h, &settings_scales()).unwrap();
        let longer = EditSettings {
            max_search_nodes: 4000,
            ..EditSettings::default()
        };
        let better = edit_distance(&c.g, &c.h, &costs, &longer).unwrap();
        let eps = 1e-9 * (1.0 + d.upper_bound);
        assert!(better.upper_bound <= d.upper_bound + eps, "seed {seed}");
        assert!(d.lower_bound <= better.upper_bound + eps, "seed {seed}");
        // Operations more never make it dearer, where both are proven.
        let fewer = EditSettings {
            contract: false,
            merge: false,
            ..longer
        };
        let plain = edit_distance(&c.g, &c.h, &costs, &fewer).unwrap();
        assert!(better.lower_bound <= plain.upper_bound + eps, "seed {seed}");
        if better.exact && plain.exact {
            assert!(better.upper_bound <= plain.upper_bound + eps, "seed {seed}");
        }
    });
}

#[test]
fn threads_change_nothing() {
    for_seeds(|seed, c| {
        if seed % 8 != 0 {
            return;
        }
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| {
                let matched = match_hypergraphs(&problem_of(&c.g, &c.h), &[], &MatchSettings::default());
                (distance(&c.g, &c.h), matched)
            })
        };
        assert_eq!(on(1), on(4), "seed {seed}");
    });
}

/// The cases do hold what they are there for.
#[test]
fn the_cases_have_loops_parallel_and_closed_curves_and_slits() {
    let (mut loops, mut parallel, mut closed, mut slits) = (0, 0, 0, 0);
    for seed in 0..40 {
        let g = case(seed).g;
        let ends: Vec<_> = g.curves().iter().map(|c| c.ends).collect();
        let joined = |e: &CurveEnds| match *e {
            CurveEnds::Two(a, b) => Some((a.min(b), a.max(b))),
            _ => None,
        };
        loops += ends.iter().filter_map(joined).filter(|e| e.0 == e.1).count();
        closed += ends.iter().filter(|e| **e == CurveEnds::Closed).count();
        for (k, e) in ends.iter().enumerate() {
            parallel += usize::from(joined(e).is_some() && ends[..k].iter().any(|o| joined(o) == joined(e)));
        }
        for s in g.sheets() {
            slits += usize::from((1..s.curves.len()).any(|k| s.curves[..k].contains(&s.curves[k])));
        }
    }
    assert!(
        loops > 3 && parallel > 3 && closed > 3 && slits > 3,
        "{loops} {parallel} {closed} {slits}"
    );
}
