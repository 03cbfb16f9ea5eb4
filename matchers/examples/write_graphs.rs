//! Writes random scaffold-like graphs with their affinities, and what this crate makes of them, as JSON for a race.
//!
//! `cargo run --release -p matchers --example write_graphs -- [NODES] [GRAPHS] [FIRST_SEED] [SIGMA] > graphs.json`

#[path = "../tests/common/scaffold_like.rs"]
mod scaffold_like;

use matchers::graduated_assignment::{MatchSettings, match_graphs};
use scaffold_like::{Recipe, accuracy, affinities, make};
use serde_json::json;
use std::time::Instant;

/// Widths of the Gaussian affinities: radii are in [0.5, 1.5], lengths in units of the mean length.
const SIGMA: f64 = 0.1;

fn main() {
    let args: Vec<f64> = std::env::args()
        .skip(1)
        .map(|a| a.parse().expect("arguments are numbers"))
        .collect();
    let arg = |k: usize, default: f64| args.get(k).copied().unwrap_or(default);
    let (nodes, graphs, first_seed) = (arg(0, 20.0) as usize, arg(1, 15.0) as u64, arg(2, 0.0) as u64);
    let sigma = arg(3, SIGMA);
    let settings = MatchSettings::default();
    let mut cases = Vec::new();
    for seed in first_seed..first_seed + graphs {
        let pair = make(&Recipe::standard(nodes), seed);
        let problem = affinities(&pair, sigma, sigma);
        let mut times: Vec<f64> = (0..3)
            .map(|_| {
                let start = Instant::now();
                std::hint::black_box(match_graphs(&problem, &[], &settings));
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        let found = match_graphs(&problem, &[], &settings);
        let truth = match_graphs(&problem, std::slice::from_ref(&pair.truth), &settings);
        eprintln!(
            "seed {seed}: accuracy {:.3}, gain {:.3}, from the truth {:.3}, {:.2} ms",
            accuracy(&pair, &found.most_probable),
            found.gain,
            truth.gain,
            times[1]
        );
        cases.push(json!({
            "nodes": nodes,
            "truth": pair.truth,
            "target_edges": pair.target_edges,
            "source_edges": pair.source_edges,
            "node_affinity": problem.node_affinity().values(),
            "edge_affinity": problem.edge_affinity().values(),
            "ours": { "source_of_target": found.source_of_target, "most_probable": found.most_probable, "gain": found.gain, "ms": times[1],
                      "gain_from_truth": truth.gain },
        }));
    }
    println!(
        "{}",
        serde_json::to_string(&cases).expect("plain numbers serialise")
    );
}
