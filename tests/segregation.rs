//! Segregation on shapes of known topology.
//!
//! Real scans are looked for in `../shared/data` beside the workspace (or `MEDIAL_DATA`); tests that need them say so when
//! they are absent.

mod segregation_support;

use glam::DVec3;
use medial_scaffold::delaunay::{DelaunaySettings, delaunay};
use medial_scaffold::geometry::{ClosestOnMesh, SignedDistance, TriangleMesh};
use medial_scaffold::segregation::{
    Balls, ChangeKind, ClosedOrOpen, KnownSurface, KnownSurfaceSettings, SegregationError,
    SegregationSettings, segregate_cloud, segregate_known, segregate_known_refined, segregate_mesh,
};
use segregation_support::{cloud, corrupted, cuboid, describe, patch, sample, shapes, sphere, torus};
use std::f64::consts::TAU;

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
    let cube = cuboid(DVec3::splat(h));
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
fn clouds_of_closed_shapes_come_out_right_with_and_without_noise() {
    let slow = std::env::var_os("MEDIAL_SLOW").is_some();
    let (n, seeds) = if slow { (10_000, 9) } else { (2500, 1) };
    let levels: &[f64] = if slow {
        &[0.0, 0.05, 0.1, 0.25]
    } else {
        &[0.0, 0.25]
    };
    let (mut right, mut runs) = (0, 0);
    for (name, truth) in shapes() {
        let spacing = (truth.area() / n as f64).sqrt();
        if n < 10_000 && name == "knot" {
            continue; // its tube is two spacings thick at this size
        }
        let wanted = truth.topology();
        let to_truth = ClosestOnMesh::new(&truth).expect("triangles");
        for &level in levels {
            for seed in 1..=seeds {
                let r = cloud(&corrupted(&truth, n, level * spacing, 1.0, 0.0, seed));
                let t = &r.report.topology;
                let surface = r.segregation.surface(&r.triangulation);
                let back = ClosestOnMesh::new(&surface).expect("triangles");
                let hausdorff = surface
                    .triangles
                    .iter()
                    .map(|t| t.map(|i| surface.points[i as usize]).iter().sum::<DVec3>() / 3.0)
                    .map(|p| to_truth.closest(p).distance2.sqrt())
                    .chain(
                        sample(&truth, 5000, 5)
                            .iter()
                            .map(|&p| back.closest(p).distance2.sqrt()),
                    )
                    .fold(0.0, f64::max)
                    / spacing;
                assert!(
                    !r.segregation.closed || (t.watertight && t.nonmanifold_vertices == 0 && t.oriented),
                    "{name} noise {level} seed {seed}: {}",
                    describe(&r)
                );
                let good = t.watertight && t.euler == wanted.euler && t.components == 1 && hausdorff <= 2.0;
                if !good {
                    println!(
                        "{name} noise {level} seed {seed}: H {hausdorff:.2} {}",
                        describe(&r)
                    );
                }
                right += usize::from(good);
                runs += 1;
            }
        }
    }
    println!("{right} of {runs} right and within 2 spacings");
    assert!(right as f64 >= 0.98 * runs as f64, "{right} of {runs}");
}

#[test]
fn the_noise_level_is_read_from_the_cloud() {
    let truth = torus(1.0, 0.4, 100, 50);
    let spacing = (truth.area() / 4000.0).sqrt();
    for level in [0.0, 0.05, 0.1, 0.25] {
        let r = cloud(&corrupted(&truth, 4000, level * spacing, 1.0, 0.0, 3));
        let read = r.report.prepare.noise_over_spacing;
        assert!((read - level).abs() < 0.03, "{level} read as {read}");
        assert_eq!(r.report.prepare.passes > 0, level > 0.0);
    }
}

#[test]
fn outliers_are_dropped_and_uneven_clouds_stay_whole() {
    let truth = torus(1.0, 0.4, 100, 50);
    let r = cloud(&corrupted(&truth, 4000, 0.0, 1.0, 0.05, 4));
    assert!(
        r.report.topology.watertight && r.report.topology.euler == 0,
        "{}",
        describe(&r)
    );
    assert!(r.report.prepare.outliers > 150, "{}", r.report.prepare.outliers);
    let r = cloud(&corrupted(&truth, 6000, 0.0, 20.0, 0.0, 4));
    assert!(
        r.report.topology.watertight && r.report.topology.euler == 0,
        "{}",
        describe(&r)
    );
}

#[test]
fn the_order_of_the_points_and_the_threads_do_not_matter() {
    let truth = torus(1.0, 0.4, 60, 30);
    let points = corrupted(&truth, 1500, 0.02, 1.0, 0.0, 8);
    let mut turned = points.clone();
    turned.reverse();
    let (a, b) = (cloud(&points), cloud(&turned));
    assert_eq!(a.triangulation.points, b.triangulation.points);
    assert_eq!(a.segregation.triangles, b.segregation.triangles);
    assert_eq!(a.report, b.report);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread");
    let c = pool.install(|| cloud(&points));
    assert_eq!(a.segregation.triangles, c.segregation.triangles);
    assert_eq!(a.report, c.report);
}

#[test]
fn a_hemisphere_is_open_with_one_rim() {
    let points = patch(3000, 1, |u, v| {
        let (z, a) = (u, TAU * v);
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * a.cos(), r * a.sin(), z)
    });
    let r = cloud(&points);
    println!("hemisphere: {}", describe(&r));
    assert!(!r.segregation.closed && r.segregation.inside.is_empty());
    assert_eq!(
        (
            r.report.rims.len(),
            r.report.topology.euler,
            r.report.topology.nonmanifold_edges
        ),
        (1, 1, 0)
    );
    let closed = SegregationSettings {
        closed: ClosedOrOpen::Closed,
        ..Default::default()
    };
    let r = segregate_cloud(&points, &closed).expect("a finite cloud");
    assert!(r.report.topology.watertight && r.report.topology.euler == 2);
    assert!(!r.report.filled_holes.is_empty() && r.report.doubtful());
    assert!(
        r.report.filled_holes[0].place.z < 0.2,
        "the hole is at the bottom"
    );
}

#[test]
fn a_moebius_band_stays_one_sided_with_one_rim() {
    let points = patch(4000, 2, |u, v| {
        let (a, w) = (TAU * u, 0.8 * (v - 0.5));
        let r = 1.0 + w * (0.5 * a).cos();
        DVec3::new(r * a.cos(), r * a.sin(), w * (0.5 * a).sin())
    });
    let r = cloud(&points);
    println!("moebius: {}", describe(&r));
    assert!(!r.segregation.closed && !r.report.topology.orientable);
    assert_eq!(
        (r.report.rims.len(), r.report.topology.euler),
        (1, 0),
        "{}",
        describe(&r)
    );
}

#[test]
fn crossing_planes_keep_their_crossing() {
    let points = patch(4000, 4, |u, v| {
        if u > 0.5 {
            DVec3::new(4.0 * u - 3.0, 2.0 * v - 1.0, 0.0)
        } else {
            DVec3::new(0.0, 2.0 * v - 1.0, 4.0 * u - 1.0)
        }
    });
    let r = cloud(&points);
    println!("crossing planes: {}", describe(&r));
    assert!(!r.segregation.closed);
    assert_eq!(
        r.report.components[0].points,
        r.report.topology.vertices,
        "{}",
        describe(&r)
    );
    assert!(r.report.topology.vertices as f64 > 0.98 * 4000.0);
}

#[test]
fn several_objects_are_ranked_and_picked() {
    let mut points = sample(&sphere(1.0, 30), 3000, 1);
    points.extend(
        sample(&sphere(0.5, 20), 1500, 2)
            .iter()
            .map(|p| *p + DVec3::X * 3.0),
    );
    let r = cloud(&points);
    assert_eq!(r.report.components.len(), 2);
    assert!(r.report.components[0].points == 3000 && r.report.components[1].points == 1500);
    let one = SegregationSettings {
        component: Some(1),
        ..Default::default()
    };
    let picked = segregate_cloud(&points, &one).expect("two components");
    assert_eq!(
        (picked.report.topology.euler, picked.report.topology.components),
        (2, 1)
    );
    assert!((picked.segregation.surface(&picked.triangulation).signed_volume() - 0.5).abs() < 0.05);
    let none = SegregationSettings {
        component: Some(2),
        ..Default::default()
    };
    assert_eq!(
        segregate_cloud(&points, &none).err(),
        Some(SegregationError::NoSuchComponent { asked: 2, found: 2 })
    );
}

#[test]
fn a_damaged_mesh_is_repaired_and_says_what_changed() {
    let good = cloud(&sample(&torus(1.0, 0.4, 60, 30), 3000, 9));
    let whole = good.segregation.surface(&good.triangulation);
    let mut damaged = whole.clone();
    damaged.triangles[10].swap(0, 1);
    let copy = damaged.triangles[20];
    damaged.triangles.push(copy);
    damaged.triangles.push([0, 0, 1]);
    let hole: Vec<usize> = vec![100, 101, 102];
    let mut index = 0;
    damaged.triangles.retain(|_| {
        index += 1;
        !hole.contains(&(index - 1))
    });
    let repaired = segregate_mesh(
        &damaged.points,
        &damaged.triangles,
        &SegregationSettings::default(),
    )
    .expect("a mesh");
    let report = &repaired.report;
    assert!(repaired.cloud.report.topology.watertight && repaired.cloud.report.topology.euler == 0);
    assert_eq!(
        (report.given, report.kept, report.added),
        (whole.triangles.len() - 1, whole.triangles.len() - 4, 3)
    );
    let kinds: Vec<ChangeKind> = report.changes.iter().map(|c| c.kind).collect();
    assert_eq!(
        kinds,
        [ChangeKind::Turned, ChangeKind::Duplicate, ChangeKind::Degenerate]
    );
    let bad = segregate_mesh(&damaged.points, &[[0, 1, 9999]], &SegregationSettings::default());
    assert!(matches!(
        bad,
        Err(SegregationError::BadTriangle { point: 9999, .. })
    ));
}

#[test]
fn too_few_or_bad_points_are_refused() {
    let flat: Vec<DVec3> = (0..9)
        .map(|i| DVec3::new(f64::from(i % 3), f64::from(i / 3), 0.0))
        .collect();
    assert!(matches!(
        segregate_cloud(&flat, &SegregationSettings::default()),
        Err(SegregationError::FewPoints { dimension: 2, .. })
    ));
    for n in 0..8 {
        // Small clouds are refused or come out, but never panic.
        let points = sample(&sphere(1.0, 6), n, 1);
        let _ = segregate_cloud(&points, &SegregationSettings::default());
    }
    let mut nan = flat;
    nan[4].y = f64::NAN;
    assert!(matches!(
        segregate_cloud(&nan, &SegregationSettings::default()),
        Err(SegregationError::NotFinite { index: 4, .. })
    ));
}
