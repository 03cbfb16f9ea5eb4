//! How long does a triangulation take, by kind of cloud and by size? One thread; `cargo bench --bench delaunay`.

#[path = "../tests/support/clouds.rs"]
mod clouds;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use medial_scaffold::delaunay::{DelaunaySettings, delaunay};
use std::time::Duration;

fn by_kind(c: &mut Criterion) {
    let mut group = c.benchmark_group("delaunay 10k");
    group
        .measurement_time(Duration::from_secs(3))
        .sample_size(10)
        .throughput(Throughput::Elements(10_000));
    for kind in clouds::KINDS {
        let points = clouds::cloud(kind, 10_000);
        group.bench_function(kind, |b| {
            b.iter(|| delaunay(&points, &DelaunaySettings { threads: 1 }))
        });
    }
    group.finish();
}

fn by_size(c: &mut Criterion) {
    let mut group = c.benchmark_group("delaunay bone");
    group.measurement_time(Duration::from_secs(3)).sample_size(10);
    for n in [1_000, 10_000, 100_000] {
        let points = clouds::cloud("bone", n);
        group.throughput(Throughput::Elements(n as u64));
        group.bench_with_input(BenchmarkId::from_parameter(n), &points, |b, points| {
            b.iter(|| delaunay(points, &DelaunaySettings { threads: 1 }));
        });
    }
    group.finish();
}

criterion_group!(benches, by_kind, by_size);
criterion_main!(benches);
