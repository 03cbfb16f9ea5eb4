//! How long does the full scaffold take on top of the triangulation, by kind of cloud and by size?
//! `RAYON_NUM_THREADS=1 cargo bench --bench full_scaffold`.

#[path = "../tests/support/clouds.rs"]
mod clouds;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use medial_scaffold::delaunay::{DelaunaySettings, delaunay};
use medial_scaffold::full_scaffold::full_scaffold;
use std::time::Duration;

fn by_kind_and_size(c: &mut Criterion) {
    let mut group = c.benchmark_group("full scaffold");
    group.measurement_time(Duration::from_secs(3)).sample_size(10);
    for kind in clouds::KINDS {
        for n in [1_000, 10_000] {
            let points = clouds::cloud(kind, n);
            let t = delaunay(&points, &DelaunaySettings::default()).expect("finite points");
            group.throughput(Throughput::Elements(points.len() as u64));
            group.bench_with_input(BenchmarkId::new(kind, n), &t, |b, t| b.iter(|| full_scaffold(t)));
        }
    }
    group.finish();
}

criterion_group!(benches, by_kind_and_size);
criterion_main!(benches);
