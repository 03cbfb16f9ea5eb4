//! Segregation on shapes of known topology.
//!
//! Real scans are looked for in `../shared/data` beside the workspace (or `MEDIAL_DATA`); tests that need them say so when
//! they are absent.

mod segregation_support;

use glam::DVec3;
use medial_scaffold::delaunay::{DelaunaySettings, delaunay};
use medial_scaffold::geometry::{SignedDistance, TriangleMesh};
use medial_scaffold::segregation::{
    Balls, KnownSurface, KnownSurfaceSettings, SegregationError, segregate_known, segregate_known_refined,
};
use segregation_support::{data_mesh, sample, sphere, torus};

fn segregate(
    points: &[DVec3],
    surface: &TriangleMesh,
) -> medial_scaffold::segregation::KnownSurfaceSegregation {
    let triangulation = delaunay(points, &DelaunaySettings::default()).expect("finite points");
    let known = KnownSurface::new(surface).expect("a mesh with triangles");
    segregate_known(&triangulation, surface, &known, &KnownSurfaceSettings::default())
        .expect("a closed surface")
}

#[test]
fn known_surfaces_keep_their_topology() {
    for (name, surface, euler) in [
        ("sphere", sphere(1.0, 40), 2),
        ("torus", torus(1.0, 0.4, 60, 30), 0),
    ] {
        for seed in 0..3 {
            let result = segregate(&sample(&surface, 3000, seed), &surface);
            assert!(result.report.agree, "{name}: {:?}", result.segregation.warnings);
            assert_eq!(result.report.found.euler, euler, "{name}");
            assert!(result.report.found.oriented && result.report.found.watertight);
            assert!(
                result.report.winding_queries < 2000,
                "{} regions",
                result.report.winding_queries
            );
            let mesh = result.segregation.triangles.len();
            assert_eq!(mesh % 2, 0, "a closed surface has an even number of triangles");
        }
    }
}

#[test]
fn one_query_a_region_gives_the_labels_of_one_query_a_tetrahedron() {
    let surface = torus(1.0, 0.4, 50, 25);
    let points = sample(&surface, 2000, 7);
    let triangulation = delaunay(&points, &DelaunaySettings::default()).expect("finite points");
    let result = segregate(&points, &surface);
    let signed = SignedDistance::new(&surface).expect("a mesh with triangles");
    let balls = Balls::new(&triangulation);
    for tet in triangulation.finite_tets().filter(|t| !balls.flat[t.index()]) {
        let asked = signed.winding.is_inside(balls.centres[tet.index()]);
        assert_eq!(result.segregation.is_inside(tet), asked, "tetrahedron {tet}");
    }
    assert!(result.report.distance_queries < triangulation.num_finite());
}

#[test]
fn a_voxel_lattice_with_flat_tetrahedra_is_labelled() {
    // The surface points of a cube lattice: every square is cocircular, every cube cospherical.
    let n = 6;
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            for k in 0..=n {
                if [i, j, k].iter().any(|c| *c == 0 || *c == n) {
                    points.push(DVec3::new(f64::from(i), f64::from(j), f64::from(k)));
                }
            }
        }
    }
    let h = f64::from(n);
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * h;
    let cube = TriangleMesh {
        points: (0..8).map(corner).collect(),
        triangles: vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ],
    };
    let result = segregate(&points, &cube);
    assert!(result.report.agree, "{:?}", result.report);
    let triangulation = delaunay(&points, &DelaunaySettings::default()).expect("finite points");
    let volume = result.segregation.surface(&triangulation).signed_volume();
    assert!((volume - h * h * h).abs() < 1e-9, "{volume}");
}

#[test]
fn an_open_surface_is_refused() {
    let mut surface = sphere(1.0, 10);
    surface.triangles.pop();
    let points = sample(&surface, 100, 0);
    let triangulation = delaunay(&points, &DelaunaySettings::default()).expect("finite points");
    let known = KnownSurface::new(&surface).expect("a mesh with triangles");
    let refused = segregate_known(&triangulation, &surface, &known, &KnownSurfaceSettings::default());
    assert!(matches!(
        refused,
        Err(SegregationError::OpenSurface {
            boundary_edges: 3,
            ..
        })
    ));
}

#[test]
fn too_few_samples_are_refined_where_it_matters() {
    // A thin torus with so few samples that its hole is not seen.
    let surface = torus(1.0, 0.12, 80, 20);
    let points = sample(&surface, 60, 3);
    let coarse = segregate(&points, &surface);
    assert!(!coarse.report.agree && !coarse.report.needs_refinement.is_empty());
    let refined = segregate_known_refined(&points, &surface, &KnownSurfaceSettings::default())
        .expect("a closed surface");
    assert!(
        refined.result.report.agree,
        "{:?}",
        refined.result.segregation.warnings
    );
    assert!(refined.added > 0 && refined.rounds > 0);
}

#[test]
fn the_talus_with_a_hidden_pocket_is_right_or_says_so() {
    let Some(surface) = data_mesh("tarsal_visiblehuman_ccby4/VHF_Right", "Talus") else {
        return;
    };
    let parts = surface.components();
    let largest = parts.iter().max_by_key(|c| c.len()).expect("a mesh has parts");
    let surface = surface.submesh(largest);
    let points = sample(&surface, 10_000, 1);
    let coarse = segregate(&points, &surface);
    let refined = segregate_known_refined(&points, &surface, &KnownSurfaceSettings::default())
        .expect("a closed surface");
    println!(
        "talus: {:?} -> {:?} after {} rounds and {} added points; known {:?}",
        coarse.report.found_euler,
        refined.result.report.found_euler,
        refined.rounds,
        refined.added,
        refined.result.report.expected_euler
    );
    assert!(refined.result.report.agree || !refined.result.segregation.warnings.is_empty());
}
