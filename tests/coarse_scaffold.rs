//! The coarse scaffold of solids whose scaffold is derived by hand, and its views.

use datasets_synthetic::shapes;
use glam::DVec3;
use medial_scaffold::coarse_scaffold::{
    CoarseScaffold, CoarseScaffoldSettings, Curve, CurveKind, Host, Node, NodeKind, Sheet, coarse_scaffold,
};
use medial_scaffold::fine_scaffold::{FineScaffold, FineScaffoldSettings, fine_scaffold};
use medial_scaffold::geometry::{CurveId, Length, NodeId, SheetId, TriangleMesh};
use medial_scaffold::input::{Geometry, ReadSettings, read_shape};
use medial_scaffold::regularise::{RegulariseSettings, regularise, replay};
use medial_scaffold::segregation::{KnownSurfaceSettings, segregate_known_refined};

fn scaffold(shape: &shapes::Shape, n: usize, seed: u64) -> CoarseScaffold {
    scaffold_at(shape, n, seed, 1.0)
}

/// At a tolerance in % of the diagonal.
fn scaffold_at(shape: &shapes::Shape, n: usize, seed: u64, percent: f64) -> CoarseScaffold {
    scaffold_of(fine_of(shape, n, seed), Length::PercentDiagonal(percent))
}

fn scaffold_of(fine: FineScaffold, tolerance: Length) -> CoarseScaffold {
    let settings = RegulariseSettings {
        tolerance,
        ..RegulariseSettings::default()
    };
    let regularised = regularise(&fine, &settings).expect("topology is kept");
    assert!(regularised.fidelity.max_tolerances <= 1.0);
    coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default())
}

fn fine_of(shape: &shapes::Shape, n: usize, seed: u64) -> FineScaffold {
    fine_of_mesh(&shape.mesh(20_000), shape.sample_poisson(n, seed).points)
}

fn fine_of_mesh(mesh: &datasets_synthetic::TriangleMesh, points: Vec<DVec3>) -> FineScaffold {
    let surface = TriangleMesh {
        points: mesh.points.clone(),
        triangles: mesh.triangles.clone(),
    };
    let refined = segregate_known_refined(&points, &surface, &KnownSurfaceSettings::default())
        .expect("a closed surface");
    fine_scaffold(
        &refined.triangulation,
        &refined.result.segregation,
        &FineScaffoldSettings::default(),
    )
    .expect("an inside")
}

/// Sheets, axial curves, ribs, wires, nodes.
fn counts(s: &CoarseScaffold) -> [usize; 5] {
    let kind = |k| s.curves.iter().filter(|c| c.kind == k).count();
    [
        s.sheets.len(),
        kind(CurveKind::Axial),
        kind(CurveKind::Rib),
        kind(CurveKind::Wire),
        s.nodes.len(),
    ]
}

/// Every reference names an element that names it back.
fn check_references(s: &CoarseScaffold) {
    for (i, n) in s.nodes.iter().enumerate() {
        assert_eq!(n.id.index(), i);
        // No node in the middle of a rib, but for its corners.
        if let ([a, b], false) = (&n.curves[..], n.kind == NodeKind::Corner) {
            let [a, b] = [*a, *b].map(|c| &s.curves[c.index()]);
            assert!(a.kind != CurveKind::Rib || b.kind != CurveKind::Rib || a.sheets != b.sheets);
        }
        for c in &n.curves {
            assert!(s.curves[c.index()].nodes.contains(&n.id));
        }
    }
    for (i, c) in s.curves.iter().enumerate() {
        assert_eq!(c.id.index(), i);
        assert!(matches!(c.nodes.len(), 0 | 2));
        for n in &c.nodes {
            assert!(s.nodes[n.index()].curves.contains(&c.id));
        }
        for sheet in &c.sheets {
            let boundary = &s.sheets[sheet.index()].boundary;
            assert!(boundary.iter().flatten().any(|b| *b == c.id));
        }
        assert!(c.length.is_finite() && c.persistence.is_finite());
    }
    for (i, sheet) in s.sheets.iter().enumerate() {
        assert_eq!(sheet.id.index(), i);
    }
}

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
fn views_are_nested_and_keep_what_there_is() {
    let s = scaffold(&shapes::box_shape(1.0, 1.4, 2.0), 5000, 2);
    assert_eq!(s.view(0.0), s);
    let area: f64 = s.sheets.iter().map(|x| x.area).sum();
    let mut last = counts(&s);
    // Above the persistence of the twelve outer sheets only the middle rectangle is left.
    for percent in [2.0, 5.0, 9.0, 40.0] {
        let v = s.view(percent / 100.0 * s.diagonal_mm);
        check_references(&v);
        let now = counts(&v);
        assert!(now[0] <= last[0] && now[1] <= last[1]);
        assert!((v.sheets.iter().map(|x| x.volume_share).sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(v.sheets.iter().map(|x| x.area).sum::<f64>() <= area + 1e-9);
        last = now;
    }
    assert_eq!((last[0], last[1]), (1, 0));
    // The levels, which the plot and the slider of the report speak from, count what the views hold.
    let levels = s.levels();
    assert_eq!(levels[0].tolerance_mm, s.tolerance_mm);
    for pair in levels.windows(2) {
        let (from, to) = (pair[0].tolerance_mm, pair[1].tolerance_mm);
        for t in [from + 1e-9 * s.diagonal_mm, 0.5 * (from + to), to] {
            let v = counts(&s.view(t.min(to)));
            let level =
                [pair[1].sheets, pair[1].axial_curves, pair[1].wires, pair[1].nodes].map(|n| n as usize);
            assert_eq!([v[0], v[1], v[3], v[4]], level, "at {t} mm");
        }
    }
    let text = serde_json::to_string(&s).expect("finite numbers");
    let back: CoarseScaffold = serde_json::from_str(&text).expect("the same fields");
    assert_eq!(back.curves, s.curves);
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

/// A scaffold of curves between nodes, all persistences as given; no geometry.
fn drawn(nodes: u32, sheets: &[f64], curves: &[(CurveKind, f64, [u32; 2], &[u32])]) -> CoarseScaffold {
    let curves: Vec<Curve> = curves
        .iter()
        .enumerate()
        .map(|(i, &(kind, persistence, ends, sheets))| Curve {
            id: CurveId::from_index(i),
            kind,
            persistence,
            nodes: ends.map(NodeId).to_vec(),
            closed: ends[0] == ends[1],
            sheets: sheets.iter().copied().map(SheetId).collect(),
            length: 1.0,
            polyline: Vec::new(),
        })
        .collect();
    CoarseScaffold {
        tolerance_mm: 1.0,
        diagonal_mm: 100.0,
        nodes: (0..nodes)
            .map(|n| Node {
                id: NodeId(n),
                kind: NodeKind::Degenerate,
                position: Default::default(),
                radius: 1.0,
                curves: curves
                    .iter()
                    .filter(|c| c.nodes.contains(&NodeId(n)))
                    .map(|c| c.id)
                    .collect(),
                sheets: Vec::new(),
                persistence: 0.0,
            })
            .collect(),
        sheets: sheets
            .iter()
            .enumerate()
            .map(|(i, &persistence)| Sheet {
                id: SheetId::from_index(i),
                persistence,
                boundary: Vec::new(),
                area: 1.0,
                mean_radius: 1.0,
                max_radius: 1.0,
                volume_share: 1.0 / sheets.len() as f64,
                generators: 1,
                moments: Default::default(),
                mesh: Default::default(),
            })
            .collect(),
        curves,
        ..CoarseScaffold::default()
    }
}

#[test]
fn in_a_view_an_axial_curve_goes_on_where_only_ribs_end_beside_it() {
    use CurveKind::{Axial, Rib};
    // Two fins, sheets 2 and 3, on one curve between sheets 0 and 1, with a gap at node 1; node 4 is the tip of what hung on it.
    let s = drawn(
        5,
        &[9.0, 8.0, 4.0, 3.0],
        &[
            (Axial, 4.0, [1, 0], &[0, 1, 2]),
            (Rib, 4.0, [0, 1], &[2]),
            (Axial, 3.0, [1, 2], &[0, 1, 3]),
            (Rib, 3.0, [1, 2], &[3]),
            (Axial, 1.2, [1, 4], &[0, 0, 1]),
            (Rib, 9.0, [4, 0], &[0]),
        ],
    );
    let at = |t: f64| {
        let view = s.view(t);
        check_references(&view);
        counts(&view)
    };
    // With a third curve there the node is one; without it the curve runs through from node 0 to 2.
    assert_eq!(at(1.1)[..2], [4, 3]);
    assert_eq!(at(2.0)[..2], [4, 1]);
    let through = s.view(2.0);
    let axial = through
        .curves
        .iter()
        .find(|c| c.kind == Axial)
        .expect("one is left");
    assert_eq!((axial.persistence, axial.length), (4.0, 2.0));
    assert_eq!(axial.sheets, [0, 1, 2, 3].map(SheetId));
    let ends: Vec<usize> = axial
        .nodes
        .iter()
        .map(|n| through.nodes[n.index()].curves.len())
        .collect();
    assert_eq!(ends, [3, 2]);
    // The ribs of the two fins stay two.
    assert_eq!(through.curves.iter().filter(|c| c.kind == Rib).count(), 3);

    // Of curves that share one sheet only, or with a wire beside them, none goes on.
    for (other, beside) in [(&[1, 3, 3][..], Rib), (&[0, 1, 3][..], CurveKind::Wire)] {
        let s = drawn(
            4,
            &[9.0, 8.0, 4.0, 3.0],
            &[
                (Axial, 4.0, [0, 1], &[0, 1, 2]),
                (Axial, 3.0, [1, 2], other),
                (beside, 9.0, [1, 3], if beside == Rib { &[0] } else { &[] }),
            ],
        );
        assert_eq!(counts(&s.view(2.0))[1], 2);
    }
}

/// A tube of radius 1 with flat ends.
#[test]
fn a_seam_parts_two_sheets_of_a_view_or_is_not_in_it() {
    use CurveKind::{Axial, Rib, Seam};
    // A curve 0-1-2 between sheets 0 and 1 with fins 2 and 3; at node 1 the seam of another curve meets it, which ends at node 3 and of
    // which the fin is sheet 4. The seam parts sheet 0 from sheet 5.
    let s = drawn(
        6,
        &[9.0, 8.0, 4.0, 3.0, 1.5, 7.0],
        &[
            (Axial, 4.0, [0, 1], &[0, 1, 2]),
            (Axial, 3.0, [1, 2], &[5, 1, 2]),
            (Seam, 1.5, [3, 1], &[0, 5]),
            (Axial, 1.5, [3, 4], &[0, 5, 4]),
            (Rib, 1.5, [3, 4], &[4]),
            (Rib, 9.0, [4, 0], &[0]),
        ],
    );
    let seams = |v: &CoarseScaffold| v.curves.iter().filter(|c| c.kind == Seam).count();
    // While both are there the seam parts them; sheets 5 and 1 and 2 are beside the first curve on both sides of it, so it is one.
    let fine = s.view(1.2);
    check_references(&fine);
    assert_eq!((seams(&fine), counts(&fine)[..2].to_vec()), (1, vec![6, 2]));
    // Without the other curve sheets 0 and 5 are one, and nothing of the seam is left.
    let coarse = s.view(2.0);
    check_references(&coarse);
    assert_eq!((seams(&coarse), counts(&coarse)[..2].to_vec()), (0, vec![4, 1]));

    // A seam that stays, because its curve does, but has one sheet on both sides.
    let idle = drawn(
        4,
        &[9.0, 8.0, 4.0],
        &[
            (Axial, 4.0, [0, 1], &[0, 1, 2]),
            (Seam, 4.0, [1, 2], &[0, 0]),
            (Rib, 9.0, [2, 0], &[0]),
        ],
    );
    assert_eq!((seams(&idle), seams(&idle.view(2.0))), (1, 0));
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
fn only_what_holds_a_tunnel_open_has_the_diagonal_for_its_persistence() {
    let ring = scaffold(&shapes::torus(1.0, 0.3), 6000, 1);
    assert_eq!(counts(&ring), [0, 0, 0, 1, 0]);
    assert_eq!(ring.curves[0].persistence, ring.diagonal_mm);
    assert_eq!(counts(&ring.view(0.9 * ring.diagonal_mm)), [0, 0, 0, 1, 0]);
    let bone = scaffold(&shapes::dumbbell(2.0, 0.5, 0.2), 6000, 1);
    assert!(bone.curves.iter().all(|c| c.persistence < bone.diagonal_mm));
}

/// A plate of thickness 0.4 over a regular hexagon with sides of 10.
fn hexagonal_plate() -> datasets_synthetic::TriangleMesh {
    let rim = |k: usize, z: f64| {
        let (s, c) = (std::f64::consts::TAU * k as f64 / 6.0).sin_cos();
        DVec3::new(10.0 * c, 10.0 * s, z)
    };
    let mut mesh = datasets_synthetic::TriangleMesh::default();
    for z in [-0.2, 0.2] {
        mesh.points.extend((0..6).map(|k| rim(k, z)));
        mesh.points.push(DVec3::new(0.0, 0.0, z));
    }
    for k in 0..6u32 {
        let next = (k + 1) % 6;
        let (below, above) = ([k, next], [k + 7, next + 7]);
        mesh.triangles
            .extend([[6, below[1], below[0]], [13, above[0], above[1]]]);
        mesh.triangles
            .extend([[below[0], below[1], above[1]], [below[0], above[1], above[0]]]);
    }
    shapes::subdivide(&mesh, 8)
}

#[test]
fn ribs_are_cut_at_the_corners_of_the_surface_and_smooth_ribs_nowhere() {
    let plate = hexagonal_plate();
    for seed in 1..=3 {
        let points = datasets_synthetic::sample_poisson(&plate, 15_000, seed).points;
        let s = scaffold_of(fine_of_mesh(&plate, points), Length::PercentDiagonal(1.0));
        assert_eq!(counts(&s), [1, 0, 6, 0, 6]);
        check_references(&s);
        for node in &s.nodes {
            assert_eq!(node.kind, NodeKind::Corner);
            let near = (0..6)
                .map(|k| {
                    let (s, c) = (std::f64::consts::TAU * k as f64 / 6.0).sin_cos();
                    node.position.distance(DVec3::new(10.0 * c, 10.0 * s, 0.0))
                })
                .fold(f64::INFINITY, f64::min);
            assert!(near <= 0.2 + s.tolerance_mm, "{near}");
        }
        // Corners stay in views.
        assert_eq!(counts(&s.view(2.0 * s.tolerance_mm)), [1, 0, 6, 0, 6]);
        let e = scaffold(&shapes::ellipsoid(1.0, 0.7, 0.4), 8000, seed);
        assert_eq!(counts(&e), [1, 0, 1, 0, 0]);
    }
}

#[test]
fn every_border_of_a_sheet_is_a_curve_or_a_node() {
    for shape in [
        shapes::box_shape(1.0, 1.4, 2.0),
        shapes::l_block(2.0, 0.8, 0.5),
        shapes::three_lobed_blob(),
    ] {
        let fine = fine_of(&shape, 8000, 3);
        let regularised = regularise(&fine, &RegulariseSettings::default()).expect("topology is kept");
        let coarse = coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default());
        check_borders(&fine, &coarse);
    }
}

/// Each edge that bounds a sheet belongs to one curve, or lies inside a node, which is drawn as a point; and the sheet's mesh reaches
/// the curve there.
fn check_borders(fine: &FineScaffold, coarse: &CoarseScaffold) {
    let mut curve_of = vec![Vec::new(); fine.num_edges()];
    for (c, edges) in coarse.fine.curve_edges.iter().enumerate() {
        edges.iter().for_each(|&e| curve_of[e as usize].push(c));
    }
    let mut node_of = vec![usize::MAX; fine.num_vertices()];
    for (n, vertices) in coarse.fine.node_vertices.iter().enumerate() {
        vertices.iter().for_each(|&v| node_of[v as usize] = n);
    }
    for (sheet, facets) in coarse.sheets.iter().zip(&coarse.fine.sheet_facets) {
        let mut used: Vec<u32> = facets
            .iter()
            .flat_map(|&f| fine.facet_vertices(f as usize))
            .copied()
            .collect();
        used.sort_unstable();
        used.dedup();
        let drawn =
            |v: u32| sheet.mesh.vertices[used.binary_search(&v).expect("a vertex of the sheet")].position;
        let mut times = std::collections::BTreeMap::new();
        for &e in facets.iter().flat_map(|&f| fine.facet_edges(f as usize)) {
            *times.entry(e).or_insert(0) += 1;
        }
        for (&e, _) in times.iter().filter(|(_, n)| **n == 1) {
            let ends = fine.edge_vertices[e as usize];
            match curve_of[e as usize].as_slice() {
                [c] => {
                    let curve = &coarse.curves[*c];
                    assert!(curve.sheets.contains(&sheet.id));
                    for v in ends {
                        let off = curve.polyline.iter().map(|p| p.position.distance(drawn(v)));
                        assert!(
                            off.fold(f64::INFINITY, f64::min) < 1e-9,
                            "{:?} of sheet {}",
                            curve.kind,
                            sheet.id.0
                        );
                    }
                }
                [] => {
                    assert_eq!(node_of[ends[0] as usize], node_of[ends[1] as usize]);
                    assert_ne!(node_of[ends[0] as usize], usize::MAX);
                    assert_eq!(drawn(ends[0]), drawn(ends[1]));
                }
                _ => panic!("an edge of two curves"),
            }
        }
    }
}

#[test]
fn every_border_of_the_sheets_of_bones_is_a_curve_or_a_node() {
    let folder = std::env::var_os("MEDIAL_DATA")
        .map_or_else(|| std::path::PathBuf::from("../shared/data"), Into::into);
    for name in ["Talus", "Cuboid", "Navicular"] {
        let file = folder.join(format!(
            "tarsal_visiblehuman_ccby4/VHF_Right/VHF_Right_Bone_{name}_smooth.stl"
        ));
        if !file.is_file() {
            eprintln!("skipped: no {}", file.display());
            continue;
        }
        let shape = read_shape(&file, &ReadSettings::default()).expect("a readable file");
        let Geometry::Mesh(mesh) = shape.geometry else {
            panic!("{name} is a mesh");
        };
        let mesh = datasets_synthetic::TriangleMesh {
            points: mesh.points,
            triangles: mesh.triangles,
        };
        let points = datasets_synthetic::sample_poisson(&mesh, 10_000, 1).points;
        let fine = fine_of_mesh(&mesh, points);
        let regularised = regularise(&fine, &RegulariseSettings::default()).expect("topology is kept");
        let coarse = coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default());
        check_references(&coarse);
        check_borders(&fine, &coarse);
    }
}

/// A winding band of the given width and thickness along `y = sin(2 pi x / 8)`, with the point and normal of its middle line at `x`.
fn winding_band(
    width: f64,
    thickness: f64,
) -> (datasets_synthetic::TriangleMesh, impl Fn(f64) -> [glam::DVec2; 2]) {
    let middle = |x: f64| {
        let turn = std::f64::consts::TAU / 8.0;
        let across = glam::DVec2::new(-turn * (turn * x).cos(), 1.0).normalize();
        [glam::DVec2::new(x, (turn * x).sin()), across]
    };
    let stations = 400u32;
    let mut mesh = datasets_synthetic::TriangleMesh::default();
    for i in 0..=stations {
        let [at, across] = middle(30.0 * f64::from(i) / f64::from(stations));
        for (side, z) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
            mesh.points
                .push((at + side * width * across).extend(z * thickness));
        }
    }
    let mut square = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    for i in 0..stations {
        let ring = |k: u32| {
            [
                4 * i + k,
                4 * i + (k + 1) % 4,
                4 * i + 4 + (k + 1) % 4,
                4 * i + 4 + k,
            ]
        };
        (0..4).for_each(|k| square(ring(k)));
    }
    square([3, 2, 1, 0]);
    square([0, 1, 2, 3].map(|k| 4 * stations + k));
    (mesh, middle)
}

#[test]
fn a_winding_strip_keeps_its_ribs_on_its_borders_and_its_mesh_between_them() {
    // Half as wide as ribs are smoothed over elsewhere.
    let (width, thickness) = (2.4, 0.5);
    let (mesh, middle) = winding_band(width, thickness);
    let outline: Vec<glam::DVec2> = (0..=2000)
        .flat_map(|i| {
            let [at, across] = middle(30.0 * f64::from(i) / 2000.0);
            [-0.5, 0.5].map(|side| at + side * (width - thickness) * across)
        })
        .collect();
    for seed in 1..=2 {
        let points = datasets_synthetic::sample_poisson(&mesh, 12_000, seed).points;
        let s = scaffold_of(fine_of_mesh(&mesh, points), Length::Millimetres(1.2));
        assert_eq!(counts(&s), [1, 0, 1, 0, 0]);
        let rib: Vec<DVec3> = s.curves[0].polyline.iter().map(|p| p.position).collect();
        // But for the ends, where the strip ends in an edge across.
        for p in rib.iter().filter(|p| (2.0..28.0).contains(&p.x)) {
            let off = outline
                .iter()
                .map(|q| q.distance(p.truncate()))
                .fold(f64::INFINITY, f64::min);
            assert!(off < 0.4, "{p} is {off} off");
        }
        // In its plane the mesh covers each place once: its triangles have the area that the rib goes round.
        let flat = |p: DVec3| p.truncate();
        let round: f64 = (0..rib.len())
            .map(|k| 0.5 * flat(rib[k]).perp_dot(flat(rib[(k + 1) % rib.len()])))
            .sum();
        let sheet = &s.sheets[0].mesh;
        let covered: f64 = sheet
            .triangles
            .iter()
            .map(|t| t.map(|v| flat(sheet.vertices[v as usize].position)))
            .map(|[a, b, c]| 0.5 * (b - a).perp_dot(c - a).abs())
            .sum();
        assert!(
            (covered / round.abs() - 1.0).abs() < 0.02,
            "{covered} within {round}"
        );
    }
}

/// A round plate of radius 6 and thickness 0.4 with a tongue of width 0.7 that reaches out to 11.
fn plate_with_tongue() -> datasets_synthetic::TriangleMesh {
    let start = (0.35f64 / 6.0).asin();
    let steps = 120;
    let mut outline: Vec<[f64; 2]> = (0..=steps)
        .map(|k| start + (std::f64::consts::TAU - 2.0 * start) * f64::from(k) / f64::from(steps))
        .map(|a| [6.0 * a.cos(), 6.0 * a.sin()])
        .collect();
    outline.extend([[11.0, -0.35], [11.0, 0.35]]);
    let n = outline.len() as u32;
    let mut mesh = datasets_synthetic::TriangleMesh::default();
    for z in [-0.2, 0.2] {
        mesh.points
            .extend(outline.iter().map(|p| DVec3::new(p[0], p[1], z)));
        mesh.points.push(DVec3::new(0.0, 0.0, z));
    }
    for k in 0..n {
        let (a, b) = (k, (k + 1) % n);
        let (c, d) = (a + n + 1, b + n + 1);
        mesh.triangles
            .extend([[n, b, a], [2 * n + 1, c, d], [a, b, d], [a, d, c]]);
    }
    mesh
}

#[test]
fn a_tongue_below_the_cut_stays_in_the_complex_and_is_not_shown() {
    let plate = plate_with_tongue();
    for seed in 1..=2 {
        let points = datasets_synthetic::sample_poisson(&plate, 12_000, seed).points;
        let fine = fine_of_mesh(&plate, points);
        let settings = RegulariseSettings {
            tolerance: Length::Millimetres(0.25),
            ..RegulariseSettings::default()
        };
        let mut regularised = regularise(&fine, &settings).expect("topology is kept");
        let alive = (0..fine.num_facets())
            .filter(|&f| regularised.alive.facets[f])
            .flat_map(|f| fine.facet_vertices(f))
            .map(|&v| fine.vertex_position[v as usize].x)
            .fold(0.0, f64::max);
        assert!(alive > 10.0, "it is there up to {alive}");
        // It stands for one tolerance and is shown; where the cut is above that, it is there for the surface only.
        let shown = coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default());
        assert_eq!(counts(&shown)[..2], [1, 0]);
        let drawn = |s: &CoarseScaffold| {
            let points = s.curves.iter().flat_map(|c| &c.polyline);
            points.map(|p| p.position.x).fold(0.0, f64::max)
        };
        assert!(drawn(&shown) > 10.0);
        regularised.cut = 2.0;
        let s = coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default());
        assert_eq!(counts(&s), [1, 0, 1, 0, 0]);
        check_references(&s);
        check_borders(&fine, &s);
        assert!(drawn(&s) < 6.0 + 1.5 * s.tolerance_mm, "{}", drawn(&s));
        // The rest of the rib is where the plate ends, less half its thickness.
        for p in &s.curves[0].polyline {
            let off = p.position.truncate().length() - 5.8;
            assert!(off.abs() < 0.3 || p.position.x > 5.0, "{}", p.position);
        }
        assert!(s.fine.generator_host.iter().all(|h| *h != Host::Absent));
    }
}

#[test]
fn ribs_on_both_sides_of_a_bridge_stay_where_they_are() {
    // A disc with five round holes: between a hole and the border, erosion thickness rises to the middle of the bridge only.
    let s = scaffold(&shapes::genus_five(), 10_000, 1);
    assert_eq!(counts(&s), [1, 0, 6, 0, 0]);
    let off = s.curves.iter().map(|rib| {
        let points = || rib.polyline.iter().map(|p| p.position);
        let n = rib.polyline.len() as f64;
        let (low, high) = points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
            (l.min(p), h.max(p))
        });
        let centre = 0.5 * (low + high);
        let radius = points().map(|p| p.distance(centre)).sum::<f64>() / n;
        let square: f64 = points().map(|p| (p.distance(centre) - radius).powi(2)).sum();
        (square / n).sqrt() / s.tolerance_mm
    });
    let off: Vec<f64> = off.collect();
    assert!(
        off.iter().all(|off| *off < 0.36),
        "off circles by {off:?} tolerances"
    );
}
