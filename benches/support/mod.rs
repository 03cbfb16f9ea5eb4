//! The solid the benches of the stages after segregation share: a box, known by its surface.

use datasets_synthetic::shapes;
use medial_scaffold::fine_scaffold::{FineScaffold, FineScaffoldSettings, fine_scaffold};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::segregation::{KnownSurfaceSettings, RefinedSegregation, segregate_known_refined};

/// Generators, about.
pub const SIZES: [usize; 3] = [5_000, 20_000, 80_000];

/// A box of 1 x 1.4 x 2 mm with about `n` generators, segregated.
pub fn segregated_box(n: usize) -> RefinedSegregation {
    let shape = shapes::box_shape(1.0, 1.4, 2.0);
    let mesh = shape.mesh(20_000);
    let surface = TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    };
    let points = shape.sample_poisson(n, 1).points;
    segregate_known_refined(&points, &surface, &KnownSurfaceSettings::default()).expect("a closed surface")
}

/// The fine scaffold of its inside.
pub fn inside(refined: &RefinedSegregation) -> FineScaffold {
    fine_scaffold(
        &refined.triangulation,
        &refined.result.segregation,
        &FineScaffoldSettings::default(),
    )
    .expect("an inside")
}
