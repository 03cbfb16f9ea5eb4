//! Input: seconds to sample a surface, to decide inside or outside, to find closest points and neighbours.

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DMat3, DVec3};
use medial_scaffold::{
    geometry::{ClosestOnMesh, Neighbours, TriangleMesh, WindingNumber},
    input::{LabelMap, LabelSurfaceSettings, SamplingSettings, label_surface, sample_mesh},
};
use std::hint::black_box;

/// A voxelised ball of 64 voxels with a dent, 24 000 triangles.
fn mask() -> LabelMap {
    let n = 70;
    let inside = |i: usize| {
        let p = DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64) - 34.5;
        p.length() <= 32.0 && (p - DVec3::X * 30.0).length() > 12.0
    };
    LabelMap {
        dims: [n; 3],
        values: (0..n * n * n).map(|i| i32::from(inside(i))).collect(),
        spacing_mm: DVec3::ONE,
        origin: DVec3::ZERO,
        direction: DMat3::IDENTITY,
    }
}

fn surface() -> TriangleMesh {
    let settings = LabelSurfaceSettings {
        label: None,
        smoothing_passes: 20,
    };
    label_surface(&mask(), &settings).expect("a label").mesh
}

fn bench(c: &mut Criterion) {
    let mesh = surface();
    let map = mask();
    let settings = LabelSurfaceSettings {
        label: None,
        smoothing_passes: 20,
    };
    c.bench_function("label_surface/64_voxels", |b| {
        b.iter(|| label_surface(black_box(&map), &settings))
    });
    for count in [10_000, 100_000] {
        let settings = SamplingSettings {
            count,
            ..Default::default()
        };
        let id = format!("blue_noise/{count}");
        c.bench_function(&id, |b| {
            b.iter(|| sample_mesh(black_box(&mesh), &settings, 180.0))
        });
    }
    let queries: Vec<DVec3> = mesh.points.iter().step_by(10).map(|p| *p * 0.99 + 0.3).collect();
    let winding = WindingNumber::new(&mesh).expect("triangles");
    let closest = ClosestOnMesh::new(&mesh).expect("triangles");
    let neighbours = Neighbours::new(&mesh.points);
    let n = queries.len();
    c.bench_function(&format!("winding_is_inside/{n}"), |b| {
        b.iter(|| winding.is_inside_many(black_box(&queries)))
    });
    c.bench_function(&format!("closest_on_mesh/{n}"), |b| {
        b.iter(|| closest.closest_many(black_box(&queries)))
    });
    c.bench_function(&format!("knn_16/{n}"), |b| {
        b.iter(|| neighbours.knn_many(black_box(&queries), 16))
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = bench
}
criterion_main!(benches);
