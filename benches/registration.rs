//! How long does a registration take? Whole meshes, whole clouds, halves that share a half.

use criterion::{Criterion, criterion_group, criterion_main};
use datasets_synthetic::bones;
use glam::{DMat3, DVec3};
use medial_scaffold::geometry::{Rigid, TriangleMesh};
use medial_scaffold::registration::{RegistrationSettings, RegistrationShape, clean_cloud, register};
use std::hint::black_box;

fn bone() -> TriangleMesh {
    let mesh = bones::scaphoid_like(1).mesh(8000);
    TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    }
}

fn registration(c: &mut Criterion) {
    let target = bone();
    let motion = Rigid {
        linear: DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 2.0),
        translation: DVec3::new(30.0, -12.0, 5.0),
    };
    let moved = |points: &[DVec3]| points.iter().map(|&p| motion.apply(p)).collect::<Vec<_>>();
    let source = TriangleMesh {
        points: moved(&target.points),
        triangles: target.triangles.clone(),
    };
    let settings = RegistrationSettings::default();
    let mut group = c.benchmark_group("registration");
    group.sample_size(10);
    group.bench_function("whole_meshes", |b| {
        let (t, s) = (RegistrationShape::mesh(&target), RegistrationShape::mesh(&source));
        b.iter(|| register(black_box(&t), &s, &settings).expect("sound meshes"))
    });
    let cloud = bones::scaphoid_like(1).sample_uniform(4000, 1).points;
    group.bench_function("clean_cloud_4000", |b| {
        b.iter(|| clean_cloud(black_box(&cloud)).expect("a sound cloud"))
    });
    let middle = cloud.iter().copied().sum::<DVec3>() / cloud.len() as f64;
    let low: Vec<DVec3> = cloud.iter().copied().filter(|p| p.x < middle.x + 3.0).collect();
    let high: Vec<DVec3> = cloud.iter().copied().filter(|p| p.x > middle.x - 3.0).collect();
    let high = moved(&high);
    group.bench_function("halves_of_4000", |b| {
        let (t, s) = (RegistrationShape::cloud(&low), RegistrationShape::cloud(&high));
        b.iter(|| register(black_box(&t), &s, &settings).expect("sound clouds"))
    });
    group.finish();
}

criterion_group!(benches, registration);
criterion_main!(benches);
