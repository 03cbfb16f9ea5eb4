//! Views of a coarse scaffold: the same at a coarser tolerance.

mod coarse_support;

use coarse_support::{check_references, counts, scaffold};
use datasets_synthetic::shapes;
use medial_scaffold::coarse_scaffold::{CoarseScaffold, Curve, CurveKind, Node, NodeKind, Sheet};
use medial_scaffold::geometry::{CurveId, NodeId, SheetId};

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
