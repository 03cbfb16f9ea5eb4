//! Criterion bench of the coarse scaffold of a box at three densities: `cargo bench --bench coarse_scaffold`.

mod support;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use medial_scaffold::coarse_scaffold::{CoarseScaffoldSettings, coarse_scaffold};
use medial_scaffold::regularise::{RegulariseSettings, regularise};
use support::{SIZES, inside, segregated_box};

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("coarse_scaffold");
    group.sample_size(10);
    for n in SIZES {
        let fine = inside(&segregated_box(n));
        let regularised = regularise(&fine, &RegulariseSettings::default()).expect("topology is kept");
        group.bench_with_input(BenchmarkId::new("box", n), &n, |b, _| {
            b.iter(|| coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default()));
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
