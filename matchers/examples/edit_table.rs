//! Prints how often the edit distance is proven, how far the bounds are apart when it is not, and what it takes.
//!
//! `cargo run --release -p matchers --example edit_table -- [PAIRS] [NODES...]`: random hypergraphs of N nodes, 3N/2 curves, N/2 sheets,
//! with corners, loops, parallel and closed curves, each against an edited copy of itself (two heals, two splices, weights as they are,
//! attributes within 5 %) and against an unrelated one; without heals and with contractions and merges.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{edited, permuted, random_hypergraph, settings_scales};
use matchers::ElementCosts;
use matchers::edit_distance::{EditSettings, edit_distance};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::time::Instant;

fn main() {
    let args: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let pairs = args.first().copied().unwrap_or(20);
    let sizes = if args.len() > 1 {
        args[1..].to_vec()
    } else {
        vec![4, 6, 8, 10, 12, 20]
    };
    println!(
        "| nodes, curves, sheets | pair | operations | proven | lower / upper, mean of the others | median ms | largest ms | median search nodes |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for &n in &sizes {
        for related in [true, false] {
            for heals in [false, true] {
                row(n, related, heals, pairs);
            }
        }
    }
}

fn row(n: usize, related: bool, heals: bool, pairs: usize) {
    let settings = EditSettings {
        contract: heals,
        merge: heals,
        ..EditSettings::default()
    };
    let (mut proven, mut ratios, mut times, mut nodes) = (0, Vec::new(), Vec::new(), Vec::new());
    for seed in 0..pairs as u64 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let g = random_hypergraph(&mut rng, n, 3 * n / 2, n / 2);
        let h = if related {
            let copy = edited(&g, &mut rng, (2, 2, 0.05));
            permuted(&copy, &mut rng).0
        } else {
            random_hypergraph(&mut rng, n, 3 * n / 2, n / 2)
        };
        let costs = ElementCosts::from_attributes(&g, &h, &settings_scales()).expect("made to fit");
        let clock = Instant::now();
        let d = edit_distance(&g, &h, &costs, &settings).expect("settings are in range");
        times.push(clock.elapsed().as_secs_f64() * 1e3);
        nodes.push(d.search_nodes as f64);
        assert!(d.lower_bound <= d.upper_bound);
        if d.exact {
            proven += 1;
        } else {
            ratios.push(d.lower_bound / d.upper_bound);
        }
    }
    let mean = ratios.iter().sum::<f64>() / ratios.len().max(1) as f64;
    println!(
        "| {n}, {}, {} | {} | {} | {proven}/{pairs} | {} | {:.1} | {:.1} | {:.0} |",
        3 * n / 2,
        n / 2,
        if related { "edited" } else { "unrelated" },
        if heals { "all" } else { "deform, splice" },
        if ratios.is_empty() {
            "-".to_owned()
        } else {
            format!("{mean:.2}")
        },
        median(&mut times),
        times.last().copied().unwrap_or(0.0),
        median(&mut nodes),
    );
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
