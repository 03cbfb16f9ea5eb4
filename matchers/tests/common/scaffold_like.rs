//! Random graphs that look like scaffolds: points in a box joined to near neighbours, with outliers and jitter.
#![allow(dead_code)] // shared by tests, benches and examples

use matchers::Table;
use matchers::graduated_assignment::PairwiseProblem;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What to make.
#[derive(Debug, Clone, Copy)]
pub struct Recipe {
    /// Nodes of either graph.
    pub nodes: usize,
    /// Share of either graph's nodes that the other lacks.
    pub outliers: f64,
    /// Relative jitter of radii, and of positions in units of the mean edge length.
    pub jitter: f64,
    /// Nearest neighbours every node is joined to.
    pub neighbours: usize,
}

impl Recipe {
    /// 15 % outliers, 5 % jitter, three neighbours.
    pub fn standard(nodes: usize) -> Self {
        Self {
            nodes,
            outliers: 0.15,
            jitter: 0.05,
            neighbours: 3,
        }
    }
}

/// A node: where it is and how large.
#[derive(Debug, Clone, Copy)]
pub struct Ball {
    pub centre: [f64; 3],
    pub radius: f64,
}

/// Two graphs and who is whom.
#[derive(Debug, Clone)]
pub struct Pair {
    pub target: Vec<Ball>,
    pub source: Vec<Ball>,
    pub target_edges: Vec<(u32, u32)>,
    pub source_edges: Vec<(u32, u32)>,
    /// Source node of every surviving target node.
    pub truth: Vec<Option<usize>>,
}

/// Makes a pair of graphs.
pub fn make(recipe: &Recipe, seed: u64) -> Pair {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n = recipe.nodes;
    let gone = (recipe.outliers * n as f64).round() as usize;
    let ball = |rng: &mut ChaCha8Rng| Ball {
        centre: [0; 3].map(|_: i32| rng.random_range(0.0..1.0)),
        radius: rng.random_range(0.5..1.5),
    };
    let target: Vec<Ball> = (0..n).map(|_| ball(&mut rng)).collect();
    let target_edges = near_neighbours(&target, recipe.neighbours);
    let mean = mean_length(&target, &target_edges);
    // The first `gone` target nodes do not survive; as many new ones come.
    let mut order: Vec<usize> = (0..n).collect();
    order.shuffle(&mut rng);
    let mut source = vec![
        Ball {
            centre: [0.0; 3],
            radius: 0.0
        };
        n
    ];
    let mut truth = vec![None; n];
    for k in 0..n {
        source[order[k]] = if k < gone {
            ball(&mut rng)
        } else {
            truth[k] = Some(order[k]);
            Ball {
                centre: target[k]
                    .centre
                    .map(|x| x + recipe.jitter * mean * normal(&mut rng)),
                radius: target[k].radius * (1.0 + recipe.jitter * normal(&mut rng)),
            }
        };
    }
    let source_edges = near_neighbours(&source, recipe.neighbours);
    Pair {
        target,
        source,
        target_edges,
        source_edges,
        truth,
    }
}

/// Affinities: Gaussian in the difference of radii and of lengths.
pub fn affinities(pair: &Pair, node_sigma: f64, edge_sigma: f64) -> PairwiseProblem {
    let gauss = |d: f64, s: f64| (-(d / s) * (d / s)).exp();
    let node = Table::from_fn(pair.target.len(), pair.source.len(), |a, i| {
        gauss(pair.target[a].radius - pair.source[i].radius, node_sigma)
    });
    let lengths = |balls: &[Ball], edges: &[(u32, u32)]| -> Vec<f64> {
        edges
            .iter()
            .map(|e| distance(&balls[e.0 as usize], &balls[e.1 as usize]))
            .collect()
    };
    let (lt, ls) = (
        lengths(&pair.target, &pair.target_edges),
        lengths(&pair.source, &pair.source_edges),
    );
    let mean = mean_length(&pair.target, &pair.target_edges);
    let edge = Table::from_fn(lt.len(), ls.len(), |e, f| {
        gauss((lt[e] - ls[f]) / mean, edge_sigma)
    });
    PairwiseProblem::new(
        node,
        pair.target_edges.clone(),
        pair.source_edges.clone(),
        edge,
        None,
    )
    .expect("generated affinities are in range")
}

/// Share of the surviving nodes that are matched right.
pub fn accuracy(pair: &Pair, source_of_target: &[Option<usize>]) -> f64 {
    let survivors = pair.truth.iter().flatten().count();
    let right = pair
        .truth
        .iter()
        .zip(source_of_target)
        .filter(|(t, m)| t.is_some() && t == m)
        .count();
    right as f64 / survivors as f64
}

/// A standard normal number (Box and Muller 1958).
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (1.0 - rng.random::<f64>(), rng.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

pub fn distance(a: &Ball, b: &Ball) -> f64 {
    (0..3)
        .map(|k| (a.centre[k] - b.centre[k]).powi(2))
        .sum::<f64>()
        .sqrt()
}

fn mean_length(balls: &[Ball], edges: &[(u32, u32)]) -> f64 {
    let sum: f64 = edges
        .iter()
        .map(|e| distance(&balls[e.0 as usize], &balls[e.1 as usize]))
        .sum();
    sum / edges.len().max(1) as f64
}

/// Every node with its nearest `k`, each pair once, in order.
fn near_neighbours(balls: &[Ball], k: usize) -> Vec<(u32, u32)> {
    let mut edges = std::collections::BTreeSet::new();
    for a in 0..balls.len() {
        let mut near: Vec<usize> = (0..balls.len()).filter(|&b| b != a).collect();
        near.sort_by(|&b, &c| distance(&balls[a], &balls[b]).total_cmp(&distance(&balls[a], &balls[c])));
        for &b in near.iter().take(k) {
            edges.insert((a.min(b) as u32, a.max(b) as u32));
        }
    }
    edges.into_iter().collect()
}
