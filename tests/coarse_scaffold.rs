//! The coarse scaffold of solids whose scaffold is derived by hand.

mod coarse_support;

use coarse_support::{check_references, counts, fine_of, fine_of_mesh, scaffold, scaffold_at, scaffold_of};
use datasets_synthetic::shapes;
use glam::DVec3;
use medial_scaffold::coarse_scaffold::{
    CoarseScaffoldSettings, Curve, CurveKind, Host, NodeKind, coarse_scaffold,
};
use medial_scaffold::geometry::Length;
use medial_scaffold::regularise::{RegulariseSettings, regularise, replay};

#[test]
fn box_and_prism_have_the_counts_derived_by_hand() {
    for seed in 1..=2 {
        let s = scaffold(&shapes::box_shape(1.0, 1.4, 2.0), 10_000, seed);
        assert_eq!(counts(&s), [13, 12, 12, 0, 12]);
        assert_eq!(s.nodes.iter().filter(|n| n.kind == NodeKind::A14).count(), 4);
        check_references(&s);
        let p = scaffold(&shapes::prism(1.0, 1.5), 10_000, seed);
        assert_eq!(counts(&p), [9, 7, 9, 0, 8]);
        check_references(&p);
    }
    // At a spacing of twice the tolerance: a gap of three spacings at one corner, a crumb cut off by a seam at another.
    for seed in [4, 5] {
        let s = scaffold(&shapes::box_shape(1.0, 1.4, 2.0), 5000, seed);
        assert_eq!(counts(&s), [13, 12, 12, 0, 12]);
    }
    // What a hidden axial curve's seam was shrunk to lies on a rib.
    let p = scaffold(&shapes::prism(1.0, 1.5), 5000, 2);
    assert_eq!(counts(&p), [9, 7, 9, 0, 8]);
    check_references(&p);
}

#[test]
fn junctions_and_swellings_of_tubes_leave_wires_only() {
    let y = scaffold(&shapes::y_of_capsules(1.0, 0.25), 10_000, 1);
    assert_eq!(counts(&y), [0, 0, 0, 3, 4]);
    let centre = y
        .nodes
        .iter()
        .find(|n| n.curves.len() == 3)
        .expect("the three wires meet in one node");
    // Inside the circle round the small triangle of the exact medial set, where the radius differs by less than the tolerance.
    assert!(centre.position.length() <= 0.25 / 3f64.sqrt());
    assert!((centre.radius - 0.25).abs() <= y.tolerance_mm);
    check_references(&y);
    let d = scaffold(&shapes::dumbbell(2.0, 0.5, 0.2), 10_000, 1);
    assert_eq!(counts(&d), [0, 0, 0, 1, 2]);
    check_references(&d);
}

#[test]
fn concave_edges_and_corners_held_by_a_single_ball_make_no_elements() {
    let l = scaffold(&shapes::l_block(2.0, 0.8, 0.5), 10_000, 2);
    // Two ribs turn in the reentrant corners of the two ends.
    assert_eq!(counts(&l), [16, 15, 17, 0, 17]);
    assert_eq!(l.nodes.iter().filter(|n| n.kind == NodeKind::Corner).count(), 2);
    check_references(&l);
    // One sheet for certain from 1.5 % of the diagonal on: see the derivation at `slab`.
    for (n, seed) in [(5000, 1), (10_000, 2)] {
        let slab = scaffold_at(&shapes::slab(0.3), n, seed, 1.5);
        // Its bevels are wider than the spacing, so that the border wavers about the edge, and a corner may be missed.
        let [sheets, axial, ribs, wires, nodes] = counts(&slab);
        assert_eq!([sheets, axial, wires], [1, 0, 0]);
        assert!(ribs <= 4 && (2..=4).contains(&nodes), "{ribs} ribs");
        check_references(&slab);
        // The corners of its only sheet, seen from above, are near those of the slab.
        for node in &slab.nodes {
            assert_eq!(node.kind, NodeKind::Corner);
            let off = (node.position.truncate().abs() - glam::DVec2::new(3.0, 2.1)).abs();
            assert!(off.max_element() <= 0.15 + slab.tolerance_mm, "{}", node.position);
        }
    }
}

#[test]
fn the_generator_map_is_total_and_shares_add_up() {
    let s = scaffold(&shapes::box_shape(1.0, 1.4, 2.0), 5000, 2);
    assert!(s.fine.generator_host.iter().all(|h| *h != Host::Absent));
    let shares: f64 = s.sheets.iter().map(|s| s.volume_share).sum();
    assert!((shares - 1.0).abs() < 1e-9);
    let generators: u32 = s.sheets.iter().map(|s| s.generators).sum();
    assert_eq!(generators as usize, s.fine.generator_host.len());
}

#[test]
fn spines_keep_the_surface_and_change_nothing_in_the_graph() {
    // A slab whose edges are below the tolerance: their crests are what the one sheet that stays is farthest from.
    let fine = fine_of(&shapes::slab(0.3), 5000, 1);
    let run = |spine_from: f64| {
        let settings = RegulariseSettings {
            tolerance: Length::PercentDiagonal(1.5),
            spine_from,
            ..RegulariseSettings::default()
        };
        let regularised = regularise(&fine, &settings).expect("topology is kept");
        let coarse = coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default());
        (regularised, coarse)
    };
    let (none, without) = run(1.0);
    assert!(none.spines.is_empty());
    assert!(
        none.fidelity.max_tolerances > 0.3,
        "{}",
        none.fidelity.max_tolerances
    );
    let (spines, with) = run(0.3);
    assert!(!spines.spines.is_empty());
    assert!(
        spines.fidelity.max_tolerances <= 0.3,
        "{}",
        spines.fidelity.max_tolerances
    );
    assert_eq!(replay(&fine, &spines.log).as_ref(), Ok(&spines.alive));
    assert_eq!(with.nodes, without.nodes);
    assert_eq!(with.curves, without.curves);
    assert_eq!(counts(&with), counts(&without));
    assert!(with.fine.generator_host.iter().all(|h| *h != Host::Absent));
}

fn flat_ended_tube(length: f64) -> (datasets_synthetic::TriangleMesh, Vec<DVec3>) {
    let mesh = shapes::grids::revolve(&[[0.0, 0.0], [1.0, 0.0], [1.0, length], [0.0, length]], 0.06);
    let points = datasets_synthetic::sample_poisson(&mesh, 12_000, 1).points;
    (mesh, points)
}

#[test]
fn a_tolerance_relative_to_the_radius_is_relative_to_the_tube_and_not_to_the_edge_of_its_end() {
    // The cone of balls that touch wall and end, tip at the axis: its rim burns for sqrt 2 radii, less the radius.
    let cone = 2f64.sqrt() - 1.0;
    let (mesh, points) = flat_ended_tube(8.0);
    let fine = scaffold_of(fine_of_mesh(&mesh, points.clone()), Length::LocalRadii(0.3));
    assert_eq!(counts(&fine), [2, 0, 2, 1, 2]);
    check_references(&fine);
    for sheet in &fine.sheets {
        assert!(
            (sheet.persistence / cone - 1.0).abs() < 0.1,
            "{}",
            sheet.persistence
        );
    }
    // Every persistence is that of a movement of the surface: the whole tube but a ball at its end, for the wire.
    let wire = fine
        .curves
        .iter()
        .find(|c| c.kind == CurveKind::Wire)
        .expect("one");
    assert!((wire.persistence - 6.0).abs() < 0.5, "{}", wire.persistence);
    // A view above the cones shows the tube alone, and any view something.
    for (at, shown) in [(0.5, [0, 0, 0, 1, 2]), (0.99 * fine.diagonal_mm, [0, 0, 0, 1, 2])] {
        let view = fine.view(at);
        assert_eq!(counts(&view), shown);
        check_references(&view);
    }
    let coarse = scaffold_of(fine_of_mesh(&mesh, points), Length::LocalRadii(0.6));
    assert_eq!(counts(&coarse), [0, 0, 0, 1, 2]);

    let y = fine_of(&shapes::y_of_capsules(1.0, 0.25), 10_000, 1);
    let y = scaffold_of(y, Length::LocalRadii(0.3));
    assert_eq!(counts(&y), [0, 0, 0, 3, 4]);
    // Without an arm the surface moves by the arm's length; what is left then is one wire.
    let mut arms: Vec<f64> = y.curves.iter().map(|c| c.persistence).collect();
    arms.sort_unstable_by(f64::total_cmp);
    assert!(
        (arms[0] - 1.0).abs() < 0.1 && arms[2] < 0.9 * y.diagonal_mm,
        "{arms:?}"
    );
    let view = y.view(0.9 * y.diagonal_mm);
    assert_eq!(counts(&view)[3], 1);
    check_references(&view);
}

#[test]
fn with_a_tolerance_relative_to_the_radius_thick_and_thin_parts_are_graded_alike() {
    // A box and the same box at two fifths of its size, with the same points: what is along a length is so in the tolerance of each.
    let shape = shapes::box_shape(1.0, 1.4, 2.0);
    let small = |p: DVec3| 0.4 * p + DVec3::X * 5.0;
    let mut mesh = shape.mesh(5_000);
    let offset = mesh.points.len() as u32;
    mesh.points.extend(mesh.points.clone().into_iter().map(small));
    mesh.triangles
        .extend(mesh.triangles.clone().into_iter().map(|t| t.map(|i| i + offset)));
    let mut points = shape.sample_poisson(8_000, 3).points;
    points.extend(points.clone().into_iter().map(small));
    let s = scaffold_of(fine_of_mesh(&mesh, points), Length::LocalRadii(0.25));
    let axial = |small: bool| -> Vec<f64> {
        let here = |c: &&Curve| (c.polyline[0].position.x > 3.0) == small;
        let axial = s.curves.iter().filter(|c| c.kind == CurveKind::Axial);
        let mut own: Vec<f64> = axial.filter(here).map(|c| c.persistence).collect();
        own.sort_by(f64::total_cmp);
        own
    };
    let (thick, thin) = (axial(false), axial(true));
    assert!(!thick.is_empty());
    assert_eq!(thick.len(), thin.len(), "{thick:?} {thin:?}");
    for (a, b) in thick.iter().zip(&thin) {
        assert!((a / b - 1.0).abs() < 0.02, "{thick:?} {thin:?}");
    }
}

#[test]
fn only_what_holds_a_tunnel_open_has_the_diagonal_for_its_persistence() {
    let ring = scaffold(&shapes::torus(1.0, 0.3), 6000, 1);
    assert_eq!(counts(&ring), [0, 0, 0, 1, 0]);
    assert_eq!(ring.curves[0].persistence, ring.diagonal_mm);
    assert_eq!(counts(&ring.view(0.9 * ring.diagonal_mm)), [0, 0, 0, 1, 0]);
    let bone = scaffold(&shapes::dumbbell(2.0, 0.5, 0.2), 6000, 1);
    assert!(bone.curves.iter().all(|c| c.persistence < bone.diagonal_mm));
}
