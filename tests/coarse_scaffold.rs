//! The coarse scaffold of solids whose scaffold is derived by hand, and its views.

use datasets_synthetic::shapes;
use medial_scaffold::coarse_scaffold::{
    CoarseScaffold, CoarseScaffoldSettings, Curve, CurveKind, Host, Node, NodeKind, Sheet, coarse_scaffold,
};
use medial_scaffold::fine_scaffold::{FineScaffold, FineScaffoldSettings, fine_scaffold};
use medial_scaffold::geometry::{CurveId, Length, NodeId, SheetId, TriangleMesh};
use medial_scaffold::regularise::{RegulariseSettings, regularise, replay};
use medial_scaffold::segregation::{KnownSurfaceSettings, segregate_known_refined};

fn scaffold(shape: &shapes::Shape, n: usize, seed: u64) -> CoarseScaffold {
    scaffold_at(shape, n, seed, 1.0)
}

/// At a tolerance in % of the diagonal.
fn scaffold_at(shape: &shapes::Shape, n: usize, seed: u64, percent: f64) -> CoarseScaffold {
    let fine = fine_of(shape, n, seed);
    let settings = RegulariseSettings {
        tolerance: Length::PercentDiagonal(percent),
        ..RegulariseSettings::default()
    };
    let regularised = regularise(&fine, &settings).expect("topology is kept");
    assert!(regularised.fidelity.max_tolerances <= 1.0);
    coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default())
}

fn fine_of(shape: &shapes::Shape, n: usize, seed: u64) -> FineScaffold {
    let mesh = shape.mesh(20_000);
    let surface = TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    };
    let points = shape.sample_poisson(n, seed).points;
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
        // No node in the middle of a rib.
        if let [a, b] = n.curves[..] {
            let [a, b] = [a, b].map(|c| &s.curves[c.index()]);
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
    assert_eq!(counts(&l), [16, 15, 15, 0, 15]);
    check_references(&l);
    // One sheet for certain from 1.5 % of the diagonal on: see the derivation at `slab`.
    for (n, seed) in [(5000, 1), (10_000, 2)] {
        let slab = scaffold_at(&shapes::slab(0.3), n, seed, 1.5);
        assert_eq!(counts(&slab), [1, 0, 1, 0, 0]);
        check_references(&slab);
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
