//! Criterion bench of the regularisation of a box at three densities: `cargo bench --bench regularise`.

mod support;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use medial_scaffold::regularise::{RegulariseSettings, regularise};
use support::{SIZES, inside, segregated_box};

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("regularise");
    group.sample_size(10);
    for n in SIZES {
        let fine = inside(&segregated_box(n));
        group.bench_with_input(BenchmarkId::new("box", n), &n, |b, _| {
            b.iter(|| regularise(&fine, &RegulariseSettings::default()).expect("topology is kept"));
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
