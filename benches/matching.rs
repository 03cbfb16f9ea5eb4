//! How long does the matching of two coarse scaffolds take?

use criterion::{Criterion, criterion_group, criterion_main};
use datasets_synthetic::bones;
use medial_scaffold::coarse_scaffold::CoarseScaffold;
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::input::{Geometry, Shape};
use medial_scaffold::matching::{MatchingSettings, match_scaffolds, pose_hypotheses};
use medial_scaffold::pipeline::{ScaffoldSettings, scaffold};
use std::hint::black_box;

fn coarse(seed: u64) -> CoarseScaffold {
    let mesh = bones::hamate_like(seed).mesh(8000);
    let mesh = TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    };
    let shape = Shape::generated("hamate", Geometry::Mesh(mesh));
    scaffold(&shape, &ScaffoldSettings::default(), &|_| {})
        .expect("a closed bone")
        .coarse
}

fn matching(c: &mut Criterion) {
    let (target, source) = (coarse(1), coarse(2));
    let settings = MatchingSettings::default();
    let mut group = c.benchmark_group("matching");
    group.sample_size(10);
    group.bench_function("pose_hypotheses", |b| {
        b.iter(|| pose_hypotheses(black_box(&target), &source, &settings))
    });
    group.bench_function("match_scaffolds", |b| {
        b.iter(|| match_scaffolds(black_box(&target), &source, &settings))
    });
    group.finish();
}

criterion_group!(benches, matching);
criterion_main!(benches);
