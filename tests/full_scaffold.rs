//! Full scaffold against a brute-force oracle in whole numbers, the Morse identity, acyclic arcs, accurate spheres.

#[path = "support/exact.rs"]
mod exact;
#[path = "support/fixtures.rs"]
mod fixtures;
#[path = "support/oracle.rs"]
mod oracle;

use glam::DVec3;
use medial_scaffold::delaunay::{DelaunaySettings, Facet, Triangulation, delaunay};
use medial_scaffold::full_scaffold::{Arc, FlowType, FullScaffold, full_scaffold};
use medial_scaffold::geometry::circumsphere;
use oracle::Oracle;
use rand::RngExt;

fn build(points: &[DVec3]) -> (Triangulation, FullScaffold) {
    let t = delaunay(points, &DelaunaySettings::default()).expect("finite points");
    let s = full_scaffold(&t).expect("points in range");
    (t, s)
}

/// Every critical simplex and every flow type, compared with all points.
fn agrees_with_oracle(points: &[DVec3]) {
    let (t, s) = build(points);
    let oracle = Oracle::new(&t.points);
    let critical = oracle.critical();
    assert_eq!(s.counts.generators, critical[0], "generators");
    assert_eq!(s.counts.sheet_sources, critical[1], "sheet sources");
    assert_eq!(s.counts.curve_sources, critical[2], "curve sources");
    assert_eq!(s.counts.sinks, critical[3], "sinks");
    assert_eq!(s.counts.morse, i64::from(!points.is_empty()));
    let mut relays = 0;
    for facet in t.facets() {
        let Some(flow) = s.flow(&t, facet) else {
            continue;
        };
        let v = t.facet_vertices(facet).map(|v| v.index());
        let (gabriel, acute) = (oracle.triangle_is_gabriel(v), oracle.triangle_is_acute(v));
        let expected = match (gabriel, acute) {
            (true, true) => FlowType::Source,
            (true, false) => FlowType::Relay,
            (false, true) => FlowType::PassingAcute,
            (false, false) => FlowType::PassingObtuse,
        };
        assert_eq!(flow, expected, "{v:?}");
        relays += u64::from(flow == FlowType::Relay);
        let mirrored = t.mirror(facet);
        assert_eq!(s.flow(&t, mirrored), Some(flow));
        assert_eq!(s.arc(&t, mirrored), s.arc(&t, facet));
        assert_eq!(s.arc(&t, facet) == Some(Arc::Outward), gabriel);
    }
    if t.dimension == 3 {
        assert_eq!(s.counts.relays, relays);
    }
}

#[test]
fn oracle_agrees_on_points_in_general_position() {
    for seed in 0..12 {
        let mut rng = fixtures::rng(seed);
        let n = if seed == 0 { 60 } else { 6 + 2 * seed as usize };
        let points: Vec<DVec3> = (0..n)
            .map(|_| DVec3::from_array(std::array::from_fn(|_| rng.random_range(-400..400).into())))
            .collect();
        agrees_with_oracle(&points);
    }
}

#[test]
fn oracle_agrees_on_lattice_points() {
    for seed in 0..40 {
        let mut rng = fixtures::rng(100 + seed);
        let size = 2 + seed as i32 % 3;
        let n = 5 + seed as usize % 9;
        let points: Vec<DVec3> = (0..n)
            .map(|_| DVec3::from_array(std::array::from_fn(|_| rng.random_range(0..size).into())))
            .collect();
        agrees_with_oracle(&points);
    }
    agrees_with_oracle(&fixtures::grid(2, 2, 3));
    agrees_with_oracle(&fixtures::grid(3, 2, 2));
    agrees_with_oracle(&fixtures::grid(4, 3, 1));
    agrees_with_oracle(&fixtures::integer_sphere(2));
}

#[test]
fn morse_is_one_and_arcs_are_acyclic() {
    let random = (0..200).map(|seed| (format!("seed {seed}"), fixtures::random(seed)));
    for (name, points) in fixtures::degenerate().into_iter().chain(random) {
        let (t, s) = build(&points);
        assert_eq!(s.counts.morse, i64::from(!points.is_empty()), "{name}");
        let order = s.acyclic_order(&t);
        let mut rank = vec![0; t.num_finite()];
        for (i, tet) in order.iter().enumerate() {
            rank[tet.index()] = i;
        }
        for facet in t.facets() {
            if let Some(Arc::Along { from, to }) = s.arc(&t, facet)
                && t.is_finite(to)
            {
                assert!(rank[from.index()] < rank[to.index()], "{name}");
                let (a, b) = (s.radius_mm(from), s.radius_mm(to));
                assert!(a <= b * (1.0 + 1e-9), "{name}: radius {a} -> {b}");
            }
        }
        for sphere in &s.spheres {
            assert!(
                sphere.centre.is_finite() && sphere.radius > 0.0,
                "{name}: {sphere:?}"
            );
        }
    }
}

#[test]
fn spheres_of_slivers_are_right() {
    let mut rng = fixtures::rng(5);
    for flat in [1e-3, 1e-6, 1e-9, 1e-12] {
        for _ in 0..50 {
            // Four points near a circle of radius 1 far from the origin.
            let corners = [0.1, 1.7, 3.3, 4.9].map(|a: f64| {
                let a = a + rng.random_range(-0.1..0.1);
                DVec3::new(a.cos(), a.sin(), flat * rng.random_range(-1.0..1.0))
                    + DVec3::new(10.0, 20.0, 30.0)
            });
            let s = circumsphere::tetrahedron(corners);
            let whole = exact::whole(&corners);
            let (centre, radius) = exact::circumsphere(&whole, &corners);
            let scale = radius.max(1.0);
            assert!(
                (s.centre - centre).length() <= 1e-10 * scale,
                "{flat:e}: {} {centre}",
                s.centre
            );
            assert!(
                (s.radius - radius).abs() <= 1e-10 * scale,
                "{flat:e}: {} {radius}",
                s.radius
            );
        }
    }
}

#[test]
fn a_cube_has_one_degenerate_vertex() {
    let (t, s) = build(&fixtures::grid(2, 2, 2));
    assert_eq!(
        t.num_finite(),
        s.degenerate.iter().map(|d| d.tets.len()).sum::<usize>()
    );
    assert_eq!((s.degenerate.len(), s.degenerate[0].generators.len()), (1, 8));
    let (_, s) = build(&fixtures::grid(5, 5, 5));
    assert_eq!(s.degenerate.len(), 64);
    assert!(s.degenerate.iter().all(|d| d.generators.len() == 8));
}

#[test]
fn unbounded_curves_leave_the_hull() {
    let (t, s) = build(&fixtures::random(0));
    let middle = t.points.iter().sum::<DVec3>() / t.points.len() as f64;
    let mut count = 0;
    for curve in s.unbounded(&t) {
        count += 1;
        let a = t.points[t.facet_vertices(curve.facet)[0].index()];
        assert!((curve.direction.length() - 1.0).abs() < 1e-12);
        assert!(curve.direction.dot(a - middle) > 0.0);
        assert!(!t.is_finite(t.mirror(curve.facet).tet));
    }
    assert_eq!(count, t.num_tets() - t.num_finite());
}

#[test]
fn tie_signs_of_a_facet_agree() {
    let (t, s) = build(&fixtures::grid(4, 4, 4));
    for tet in t.finite_tets() {
        for index in 0..4 {
            let facet = Facet { tet, index };
            let other = t.mirror(facet);
            if t.is_finite(other.tet) {
                assert_eq!(s.is_zero_length(facet), s.is_zero_length(other));
                assert!(s.opposite_is_outside(facet) || s.opposite_is_outside(other));
            }
        }
    }
}
