//! Criterion bench of the fine scaffold of a box at three densities: `cargo bench --bench fine_scaffold`.

mod support;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use support::{SIZES, inside, segregated_box};

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("fine_scaffold");
    group.sample_size(10);
    for n in SIZES {
        let refined = segregated_box(n);
        group.bench_with_input(BenchmarkId::new("box", n), &n, |b, _| b.iter(|| inside(&refined)));
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
