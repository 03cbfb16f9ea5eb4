//! How long does a surface from a raw cloud take, by size, noise and shape? `cargo bench --bench segregation`.

#[path = "../tests/segregation_support/mod.rs"]
mod support;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use medial_scaffold::segregation::{SegregationSettings, segregate_cloud};
use std::time::Duration;

fn by_noise(c: &mut Criterion) {
    let mut group = c.benchmark_group("segregation torus 10k");
    group.measurement_time(Duration::from_secs(5)).sample_size(10);
    let truth = support::torus(1.0, 0.4, 160, 64);
    let spacing = (truth.area() / 10_000.0).sqrt();
    for noise in [0.0, 0.1, 0.25, 0.5] {
        let points = support::corrupted(&truth, 10_000, noise * spacing, 1.0, 0.0, 1);
        group.bench_with_input(BenchmarkId::from_parameter(noise), &points, |b, points| {
            b.iter(|| segregate_cloud(points, &SegregationSettings::default()).expect("a finite cloud"));
        });
    }
    group.finish();
}

fn by_size(c: &mut Criterion) {
    let mut group = c.benchmark_group("segregation torus without noise");
    group.measurement_time(Duration::from_secs(5)).sample_size(10);
    let truth = support::torus(1.0, 0.4, 160, 64);
    for n in [1_000usize, 10_000, 100_000] {
        let points = support::corrupted(&truth, n, 0.0, 1.0, 0.0, 1);
        group.throughput(Throughput::Elements(n as u64));
        group.bench_with_input(BenchmarkId::from_parameter(n), &points, |b, points| {
            b.iter(|| segregate_cloud(points, &SegregationSettings::default()).expect("a finite cloud"));
        });
    }
    group.finish();
}

criterion_group!(benches, by_noise, by_size);
criterion_main!(benches);
