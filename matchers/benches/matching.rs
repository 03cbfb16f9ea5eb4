//! How long do the matchers take? Sizes in the names; graphs are made once, outside the clock.

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/scaffold_like.rs"]
mod scaffold_like;

use common::{permuted, problem_of, random_hypergraph, settings_scales};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use matchers::edit_distance::{EditSettings, edit_distance};
use matchers::graduated_assignment::{MatchSettings, match_graphs, match_hypergraphs};
use matchers::pose::{RobustPoseSettings, robust_pose};
use matchers::{ElementCosts, Table, assignment};
use nalgebra::{Isometry3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use scaffold_like::{Recipe, affinities, make};

fn assignments(c: &mut Criterion) {
    let mut group = c.benchmark_group("assignment");
    for n in [20, 100, 300] {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let costs = Table::from_fn(n, n, |_, _| rng.random_range(0.0..1.0));
        group.bench_function(BenchmarkId::new("jonker_volgenant", n), |b| {
            b.iter(|| assignment::solve(&costs))
        });
    }
}

fn graphs(c: &mut Criterion) {
    let mut group = c.benchmark_group("match_graphs");
    group.sample_size(20);
    for n in [20, 50, 100] {
        let pair = make(&Recipe::standard(n), 1);
        let problem = affinities(&pair, 0.2, 0.2);
        let settings = MatchSettings::default();
        group.bench_function(BenchmarkId::new("nodes", n), |b| {
            b.iter(|| match_graphs(&problem, &[], &settings))
        });
    }
}

fn hypergraphs(c: &mut Criterion) {
    let mut group = c.benchmark_group("hypergraphs");
    group.sample_size(20);
    for n in [10, 30, 100] {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let g = random_hypergraph(&mut rng, n, 3 * n / 2, n / 2);
        let h = random_hypergraph(&mut rng, n, 3 * n / 2, n / 2);
        let problem = problem_of(&g, &h);
        let settings = MatchSettings::default();
        group.bench_function(BenchmarkId::new("match_nodes", n), |b| {
            b.iter(|| match_hypergraphs(&problem, &[], &settings));
        });
    }
}

fn distances(c: &mut Criterion) {
    let mut group = c.benchmark_group("edit_distance");
    group.sample_size(10);
    for n in [4, 6, 8] {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let g = random_hypergraph(&mut rng, n, 3 * n / 2, n / 2);
        let unrelated = random_hypergraph(&mut rng, n, 3 * n / 2, n / 2);
        let same = permuted(&g, &mut rng).0;
        let settings = EditSettings {
            contract: false,
            merge: false,
            ..EditSettings::default()
        };
        for (name, h) in [("unrelated_nodes", &unrelated), ("equal_nodes", &same)] {
            let costs = ElementCosts::from_attributes(&g, h, &settings_scales()).expect("made to fit");
            group.bench_function(BenchmarkId::new(name, n), |b| {
                b.iter(|| edit_distance(&g, h, &costs, &settings))
            });
        }
    }
}

fn poses(c: &mut Criterion) {
    let mut group = c.benchmark_group("robust_pose");
    group.sample_size(20);
    for n in [100, 400] {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut point = |half: f64| Point3::from(Vector3::from_fn(|_, _| rng.random_range(-half..half)));
        let truth = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.4, 0.2, -0.7));
        let source: Vec<_> = (0..n).map(|_| point(10.0)).collect();
        let noisy = |k: usize, p: &Point3<f64>, e: Point3<f64>| {
            if k.is_multiple_of(10) {
                truth * p + e.coords * 0.005
            } else {
                e
            }
        };
        let target: Vec<_> = source
            .iter()
            .enumerate()
            .map(|(k, p)| noisy(k, p, point(10.0)))
            .collect();
        let (weights, settings) = (
            vec![1.0; n],
            RobustPoseSettings {
                inlier_bound: 0.2,
                ..Default::default()
            },
        );
        group.bench_function(BenchmarkId::new("pairs_90_percent_wrong", n), |b| {
            b.iter(|| robust_pose(&source, &target, &weights, &settings));
        });
    }
}

criterion_group!(benches, assignments, graphs, hypergraphs, distances, poses);
criterion_main!(benches);
