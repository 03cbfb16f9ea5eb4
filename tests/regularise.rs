//! Regularisation on shapes whose topology is known.

use glam::DVec3;
use medial_scaffold::coarse_scaffold::{CoarseScaffold, CoarseScaffoldSettings, CurveKind, coarse_scaffold};
use medial_scaffold::delaunay::{DelaunaySettings, delaunay};
use medial_scaffold::fine_scaffold::{
    Betti, FineScaffold, FineScaffoldSettings, Side, fine_scaffold, solid_betti,
};
use medial_scaffold::geometry::{Length, circumsphere};
use medial_scaffold::regularise::{RegulariseSettings, Regularised, regularise, replay};
use medial_scaffold::segregation::Segregation;

/// The golden angle, for even spirals on a sphere.
const GOLDEN: f64 = 2.399_963_229_728_653;

fn sphere(n: usize, radius: f64) -> Vec<DVec3> {
    (0..n)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
            let (s, c) = (GOLDEN * i as f64).sin_cos();
            radius * DVec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z)
        })
        .collect()
}

fn torus(n: usize, large: f64, small: f64) -> Vec<DVec3> {
    (0..n)
        .map(|i| {
            let u = std::f64::consts::TAU * (i as f64 * 0.754_877_666_246_692_7).fract();
            let v = std::f64::consts::TAU * (i as f64 * 0.569_840_290_998_053_2).fract();
            let ring = large + small * v.cos();
            DVec3::new(ring * u.cos(), ring * u.sin(), small * v.sin())
        })
        .collect()
}

/// Fine, regularised and coarse scaffold of points whose inside is given.
fn run(points: &[DVec3], inside: impl Fn(DVec3) -> bool) -> (FineScaffold, Regularised, CoarseScaffold) {
    let triangulation = delaunay(points, &DelaunaySettings::default()).expect("finite points");
    let labels = triangulation
        .tets()
        .map(|t| {
            triangulation.is_finite(t) && inside(circumsphere::tetrahedron(triangulation.corners(t)).centre)
        })
        .collect();
    let segregation = Segregation {
        inside: labels,
        closed: true,
        ..Segregation::default()
    };
    let fine =
        fine_scaffold(&triangulation, &segregation, &FineScaffoldSettings::default()).expect("an inside");
    assert_eq!(
        fine.betti(),
        solid_betti(&triangulation, &segregation, Side::Interior).expect("labels of this triangulation")
    );
    let settings = RegulariseSettings {
        tolerance: Length::PercentDiagonal(1.0),
        ..RegulariseSettings::default()
    };
    let regularised = regularise(&fine, &settings).expect("topology is kept");
    assert!(regularised.betti.iter().all(|s| s.betti == fine.betti()));
    assert_eq!(replay(&fine, &regularised.log).as_ref(), Ok(&regularised.alive));
    assert!(regularised.fidelity.max_tolerances <= 1.0);
    let coarse = coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default());
    (fine, regularised, coarse)
}

fn count(coarse: &CoarseScaffold, kind: CurveKind) -> usize {
    coarse.curves.iter().filter(|c| c.kind == kind).count()
}

#[test]
fn a_torus_is_one_closed_wire() {
    let (fine, _, coarse) = run(&torus(6000, 1.0, 0.3), |p| {
        let q = p.truncate().length() - 1.0;
        q * q + p.z * p.z < 0.09
    });
    assert_eq!(fine.betti(), Betti { b0: 1, b1: 1, b2: 0 });
    assert_eq!((coarse.sheets.len(), coarse.nodes.len()), (0, 0));
    assert_eq!(count(&coarse, CurveKind::Wire), 1);
    let length = coarse.curves[0].length;
    assert!((length / std::f64::consts::TAU - 1.0).abs() < 0.01, "{length}");
}

#[test]
fn a_hollow_sphere_is_one_closed_sheet() {
    let mut points = sphere(6000, 1.0);
    points.extend(sphere(2200, 0.6));
    let (fine, _, coarse) = run(&points, |p| (p.length() - 0.8).abs() < 0.2);
    assert_eq!(fine.betti(), Betti { b0: 1, b1: 0, b2: 1 });
    assert_eq!((coarse.sheets.len(), coarse.curves.len()), (1, 0));
    let exact = 4.0 * std::f64::consts::PI * 0.64;
    assert!((coarse.sheets[0].area / exact - 1.0).abs() < 0.01);
    assert!((coarse.sheets[0].volume_share - 1.0).abs() < 1e-9);
}

#[test]
fn an_ellipsoid_is_one_sheet_with_one_rib() {
    let axes = DVec3::new(1.0, 0.7, 0.4);
    let points: Vec<DVec3> = sphere(8000, 1.0).into_iter().map(|p| p * axes).collect();
    let (_, _, coarse) = run(&points, |p| (p / axes).length() < 1.0);
    assert_eq!(coarse.sheets.len(), 1);
    assert_eq!((coarse.curves.len(), count(&coarse, CurveKind::Rib)), (1, 1));
    assert!(
        coarse.sheets[0]
            .mesh
            .vertices
            .iter()
            .all(|p| p.position.z.abs() < 0.01)
    );
}
