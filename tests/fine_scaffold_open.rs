//! The scaffold of open surfaces: both sides joined, cut where large balls come from outside, against known topology and a known sheet.

use datasets_synthetic::shapes::{self, Shape};
use glam::DVec3;
use medial_scaffold::coarse_scaffold::{CoarseScaffoldSettings, Sheet, coarse_scaffold};
use medial_scaffold::fine_scaffold::{
    Domain, FineScaffold, FineScaffoldError, Side, fine_scaffold_of, solid_betti_of,
};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::regularise::{RegulariseSettings, regularise};
use medial_scaffold::segregation::{
    CloudSegregation, KnownSurfaceSettings, SegregationSettings, segregate_cloud, segregate_known_refined,
};

fn segregated(points: &[DVec3]) -> CloudSegregation {
    let found = segregate_cloud(points, &SegregationSettings::default()).expect("a finite cloud");
    assert!(!found.segregation.closed, "{}", found.report.decision.reason);
    found
}

fn joined(shape: &Shape, n: usize) -> (Domain, FineScaffold, CloudSegregation) {
    let found = segregated(&shape.sample_poisson(n, 7).points);
    let domain =
        Domain::new(&found.triangulation, &found.segregation, Side::Joined).expect("its own surface");
    let fine = fine_scaffold_of(&found.triangulation, &domain).expect("it is deep enough");
    (domain, fine, found)
}

/// The dual complex and the unpinched boundary of the domain, in which a wall counts on both its sides, agree.
#[test]
fn betti_numbers_of_joined_sides_agree_by_two_routes() {
    for shape in [
        shapes::hemisphere(1.0),
        shapes::sphere_with_cap_missing(1.0, 0.1),
        shapes::open_tube(0.5, 2.0),
        shapes::moebius_band(1.0, 0.8),
        shapes::crossing_planes(2.0),
        shapes::planes_with_bump(1.0, 0.2),
    ] {
        let (domain, fine, found) = joined(&shape, 3000);
        assert!(!found.segregation.triangles.is_empty());
        assert_eq!(
            fine.betti(),
            solid_betti_of(&found.triangulation, &domain),
            "{}",
            shape.name
        );
        assert!(fine.betti().b0 >= 1, "{}", shape.name);
    }
}

/// All balls of a hemisphere are one: they touch all of it, and their common centre is its own.
#[test]
fn the_scaffold_of_a_hemisphere_is_its_centre() {
    let (_, fine, _) = joined(&shapes::hemisphere(1.0), 2000);
    for (p, r) in fine.vertex_position.iter().zip(&fine.vertex_radius) {
        assert!(p.length() < 1e-6 && (r - 1.0).abs() < 1e-6, "{p} {r}");
    }
}

/// The pair of planes of Leymarie & Kimia 2007: one sheet between them, in its known place.
#[test]
fn between_two_planes_lies_one_sheet() {
    const GAP: f64 = 0.2;
    let shape = shapes::planes_with_bump(1.0, GAP);
    let (domain, fine, found) = joined(&shape, 6000);
    let regularised = regularise(&fine, &RegulariseSettings::default()).expect("a tolerance in its units");
    let coarse = coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default());
    let (between, above): (Vec<&Sheet>, Vec<&Sheet>) =
        coarse.sheets.iter().partition(|s| s.moments.centroid.z < GAP);
    assert_eq!((between.len(), above.len()), (1, 1));
    assert!(
        above[0].area < 0.3 * between[0].area,
        "the other is that of the dent, outside"
    );
    assert_eq!(regularised.betti(), solid_betti_of(&found.triangulation, &domain));
    let truth = shape.truth.medial.expect("the sheet is known");
    let mut far = 0.0f64;
    for &facet in &coarse.fine.sheet_facets[between[0].id.index()] {
        for &v in fine.facet_vertices(facet as usize) {
            let (p, r) = (fine.vertex_position[v as usize], fine.vertex_radius[v as usize]);
            // The truth ends at the border of the planes, the scaffold a ball beyond it.
            if p.x.abs().max(p.y.abs()) < 0.4 {
                let (distance, radius) = truth.closest(p);
                far = far.max(distance).max((radius - r).abs());
            }
        }
    }
    assert!(far > 0.0 && far < 0.01, "{far}");
}

/// What is left of the outside of a torus is its hole, between two lids (where they meet the surface a generator may pierce them); under the hull
/// nothing hangs about, and no ball is far away.
#[test]
fn the_outside_of_a_torus_is_in_its_hole() {
    let shape = shapes::torus(1.0, 0.4);
    let mesh = shape.mesh(20_000);
    let surface = TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    };
    let points = shape.sample_poisson(4000, 1).points;
    let found = segregate_known_refined(&points, &surface, &KnownSurfaceSettings::default())
        .expect("a closed surface");
    let domain =
        Domain::new(&found.triangulation, &found.result.segregation, Side::Exterior).expect("its labels");
    let fine = fine_scaffold_of(&found.triangulation, &domain).expect("the hole is deep");
    assert_eq!((fine.betti().b0, fine.betti().b2), (1, 0));
    assert_eq!(fine.betti(), solid_betti_of(&found.triangulation, &domain));
    let diagonal = fine.scale.diagonal_mm;
    for (p, r) in fine.vertex_position.iter().zip(&fine.vertex_radius) {
        assert!(*r < 0.5 * diagonal && p.truncate().length() < 1.1, "{p} {r}");
    }
}

#[test]
fn a_surface_of_other_points_is_refused() {
    let (_, _, mut found) = joined(&shapes::hemisphere(1.0), 500);
    let [a, b, _] = found.segregation.triangles[0];
    let last = *found.segregation.triangles.last().expect("a surface");
    let far = last
        .into_iter()
        .find(|v| *v != a && *v != b)
        .expect("three corners");
    found.segregation.triangles.push([a, b, far]);
    assert!(matches!(
        Domain::new(&found.triangulation, &found.segregation, Side::Joined),
        Err(FineScaffoldError::Surface { missing: 1, .. })
    ));
    assert!(matches!(
        Domain::new(&found.triangulation, &found.segregation, Side::Interior),
        Err(FineScaffoldError::Open)
    ));
}
