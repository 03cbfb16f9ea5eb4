//! Criterion bench of the fine scaffold of a box at three densities: `cargo bench --bench fine_scaffold`.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use datasets_synthetic::shapes;
use medial_scaffold::fine_scaffold::{FineScaffoldSettings, fine_scaffold};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::segregation::{KnownSurfaceSettings, segregate_known_refined};

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("fine_scaffold");
    group.sample_size(10);
    let shape = shapes::box_shape(1.0, 1.4, 2.0);
    let mesh = shape.mesh(20_000);
    let surface = TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    };
    for n in [5_000usize, 20_000, 80_000] {
        let points = shape.sample_poisson(n, 1).points;
        let refined = segregate_known_refined(&points, &surface, &KnownSurfaceSettings::default())
            .expect("a closed surface");
        group.bench_with_input(BenchmarkId::new("box", n), &n, |b, _| {
            b.iter(|| {
                fine_scaffold(
                    &refined.triangulation,
                    &refined.result.segregation,
                    &FineScaffoldSettings::default(),
                )
                .expect("an inside")
            });
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
