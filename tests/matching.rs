//! Matching of hand-made scaffolds whose correspondences are known.

use glam::{DMat3, DVec3};
use medial_scaffold::coarse_scaffold::{
    CoarseScaffold, Curve, CurveKind, MedialPoint, Node, NodeKind, Sheet, SheetMesh, SheetMoments,
};
use medial_scaffold::geometry::{CurveId, NodeId, Rigid, SheetId};
use medial_scaffold::matching::{
    EditElement, EditKind, EditSide, Matching, MatchingSettings, ShapeDistance, match_scaffolds,
    match_scaffolds_at,
};

/// A curved sheet with a fin on it, an axial curve where they meet, and ribs: no symmetry, chiral. `fin` scales the fin.
fn scaffold(fin: f64, fin_persistence: f64) -> CoarseScaffold {
    let main = patch(24, |u, v| {
        let p = DVec3::new(
            30.0 * u - 15.0,
            16.0 * v - 8.0 + 4.0 * u * u,
            3.0 * u * v + 2.0 * v * v,
        );
        (p, 3.0 + 2.0 * u - 3.0 * (v - 0.4) * (v - 0.4))
    });
    let fin_mesh = patch(12, |u, v| {
        let along = 0.3 + 0.5 * u;
        let base = DVec3::new(30.0 * along - 15.0, 4.0 * along * along, 3.0 * along * 0.5 + 0.5);
        (base + DVec3::new(0.0, 1.0, 6.0 * fin) * v, 2.5 + along - v)
    });
    let axis: Vec<MedialPoint> = (0..=12).map(|i| fin_mesh.vertices[i * 13]).collect();
    let nodes = [axis[0], axis[12]]
        .iter()
        .enumerate()
        .map(|(i, m)| Node {
            id: NodeId(i as u32),
            kind: NodeKind::A1A3,
            position: m.position,
            radius: m.radius,
            curves: vec![CurveId(0), CurveId(2)],
            sheets: Vec::new(),
            persistence: fin_persistence,
        })
        .collect();
    let border = |mesh: &SheetMesh, n: usize| -> Vec<MedialPoint> {
        let at = |i: usize, j: usize| mesh.vertices[i * (n + 1) + j];
        let mut line: Vec<MedialPoint> = (0..n).map(|j| at(0, j)).collect();
        line.extend((0..n).map(|i| at(i, n)));
        line.extend((1..=n).rev().map(|j| at(n, j)));
        line.extend((1..=n).rev().map(|i| at(i, 0)));
        line
    };
    let curve = |id, kind, persistence, nodes: &[u32], sheets: &[u32], polyline: Vec<MedialPoint>| Curve {
        id: CurveId(id),
        kind,
        persistence,
        nodes: nodes.iter().map(|&n| NodeId(n)).collect(),
        closed: nodes.is_empty(),
        sheets: sheets.iter().map(|&s| SheetId(s)).collect(),
        length: polyline
            .windows(2)
            .map(|w| w[0].position.distance(w[1].position))
            .sum(),
        polyline,
    };
    let curves = vec![
        curve(0, CurveKind::Axial, fin_persistence, &[0, 1], &[0, 0, 1], axis),
        curve(1, CurveKind::Rib, 6.0, &[], &[0], border(&main, 24)),
        curve(
            2,
            CurveKind::Rib,
            fin_persistence,
            &[0, 1],
            &[1],
            border(&fin_mesh, 12)[12..].to_vec(),
        ),
    ];
    CoarseScaffold {
        tolerance_mm: 0.4,
        diagonal_mm: 40.0,
        nodes,
        curves,
        sheets: vec![sheet(0, 6.0, main), sheet(1, fin_persistence, fin_mesh)],
        ..Default::default()
    }
}

fn patch(n: usize, place: impl Fn(f64, f64) -> (DVec3, f64)) -> SheetMesh {
    let mut mesh = SheetMesh::default();
    for i in 0..=n {
        for j in 0..=n {
            let (position, radius) = place(j as f64 / n as f64, i as f64 / n as f64);
            // Rows run along u: the first row is the base of the fin.
            mesh.vertices.push(MedialPoint { position, radius });
        }
    }
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    for i in 0..n {
        for j in 0..n {
            mesh.triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    mesh
}

fn sheet(id: u32, persistence: f64, mesh: SheetMesh) -> Sheet {
    let area = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| mesh.vertices[i as usize].position);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let n = mesh.vertices.len() as f64;
    let centroid = mesh.vertices.iter().map(|m| m.position).sum::<DVec3>() / n;
    Sheet {
        id: SheetId(id),
        persistence,
        boundary: Vec::new(),
        area,
        mean_radius: mesh.vertices.iter().map(|m| m.radius).sum::<f64>() / n,
        max_radius: mesh.vertices.iter().map(|m| m.radius).fold(0.0, f64::max),
        volume_share: 0.5,
        generators: 100,
        moments: SheetMoments {
            centroid,
            deviations: [9.0, 4.0, 1.0],
            axes: [DVec3::X, DVec3::Y, DVec3::Z],
        },
        mesh,
    }
}

fn moved(s: &CoarseScaffold, motion: &Rigid) -> CoarseScaffold {
    let mut out = s.clone();
    let go = |p: &mut DVec3| *p = motion.apply(*p);
    out.nodes.iter_mut().for_each(|n| go(&mut n.position));
    out.curves
        .iter_mut()
        .flat_map(|c| &mut c.polyline)
        .for_each(|m| go(&mut m.position));
    for sheet in &mut out.sheets {
        go(&mut sheet.moments.centroid);
        sheet.mesh.vertices.iter_mut().for_each(|m| go(&mut m.position));
    }
    out
}

fn motion() -> Rigid {
    Rigid {
        linear: DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 2.2),
        translation: DVec3::new(50.0, -20.0, 7.0),
    }
}

fn matched(a: &CoarseScaffold, b: &CoarseScaffold) -> Matching {
    match_scaffolds(a, b, &MatchingSettings::default())
}

#[test]
fn a_scaffold_is_at_no_distance_from_itself_in_any_pose() {
    let a = scaffold(1.0, 2.0);
    let motion = motion();
    for b in [a.clone(), moved(&a, &motion)] {
        let found = matched(&a, &b);
        assert!(
            found.shape_distance.with_size_mm < 1e-6,
            "{:?}",
            found.shape_distance
        );
        assert!(found.shape_distance.without_size < 1e-6);
        assert!(found.shape_distance.structure_mm < 1e-6);
        assert!(!found.ambiguous);
        let c = &found.correspondences;
        assert!(
            c.nodes.len() == 2 && c.curves.len() == 3 && c.sheets.len() == 2,
            "{c:?}"
        );
        assert!(c.nodes.iter().all(|p| p.target == p.source));
        assert!(c.curves.iter().all(|p| p.target == p.source));
        assert!(c.sheets.iter().all(|p| p.target == p.source));
        assert_eq!(c.unmatched_target, Default::default());
    }
    let found = matched(&a, &moved(&a, &motion));
    assert!(found.T_target_source.rotation_angle_deg(&motion.inverse()) < 1e-4);
}

#[test]
fn both_directions_say_the_same() {
    let a = scaffold(1.0, 2.0);
    let b = moved(&scaffold(0.7, 1.1), &motion());
    let (ab, ba) = (matched(&a, &b), matched(&b, &a));
    assert_eq!(ab.shape_distance, ba.shape_distance);
    assert!(ab.shape_distance.with_size_mm > 0.01);
    assert_eq!(ab.edit.upper_bound, ba.edit.upper_bound);
    let turned: Vec<_> = ba
        .correspondences
        .curves
        .iter()
        .map(|p| (p.source, p.target))
        .collect();
    let straight: Vec<_> = ab
        .correspondences
        .curves
        .iter()
        .map(|p| (p.target, p.source))
        .collect();
    assert_eq!(turned, straight);
    assert!(
        ab.T_target_source
            .after(&ba.T_target_source)
            .linear
            .abs_diff_eq(DMat3::IDENTITY, 1e-9)
    );
    assert!(ab.edit.lower_bound <= ab.edit.upper_bound + 1e-12);
    assert!(ab.edit.exact, "seven elements are few enough for a proof");
    let sum: f64 = ab.edit.operations.iter().map(|o| o.price).sum();
    assert!((sum - ab.edit.upper_bound).abs() < 1e-9 * (1.0 + sum));
}

#[test]
fn an_element_at_the_cut_costs_nothing_whether_it_is_there_or_not() {
    let full = scaffold(1.0, 2.0);
    let without = |persistence: f64| {
        let mut s = scaffold(1.0, persistence);
        s.sheets.truncate(1);
        s.curves.retain(|c| c.id == CurveId(1));
        s.curves[0].id = CurveId(0);
        s.nodes.clear();
        s
    };
    let gap = |persistence: f64| matched(&scaffold(1.0, persistence), &without(persistence)).shape_distance;
    let (at, near, far) = (gap(0.4 + 1e-6), gap(0.5), gap(2.0));
    // Not exactly zero: a fading element shifts the samples of the others by a share of their spacing.
    assert!(at.structure_mm < 0.02, "{at:?}");
    assert!(at.with_size_mm < 0.02, "{at:?}");
    assert!(at.structure_mm < near.structure_mm && near.structure_mm < far.structure_mm);
    assert!(near.with_size_mm < far.with_size_mm);
    // And across the cut there is no jump, in the price for a given pose and in the distance of the best one.
    let step = |p: f64| {
        let at = Rigid::IDENTITY;
        match_scaffolds_at(&full, &scaffold(1.0, p), &at, &MatchingSettings::default()).shape_distance
    };
    let (below, above) = (step(0.4 - 1e-6), step(0.4 + 1e-6));
    let jump = (below.structure_mm - above.structure_mm).abs();
    // As above, the samples shift a little, and with them the centroid that places are measured from.
    assert!(jump < 0.02, "{below:?} {above:?}");
    assert!((below.with_size_mm - above.with_size_mm).abs() < 0.02);
}

#[test]
fn the_edit_path_says_in_words_what_goes_and_what_it_costs() {
    let a = scaffold(1.0, 2.0);
    let mut b = a.clone();
    b.sheets.truncate(1);
    b.curves.retain(|c| c.id == CurveId(1));
    b.curves[0].id = CurveId(0);
    b.nodes.clear();
    for (target, source, side) in [(&a, &b, EditSide::Target), (&b, &a, EditSide::Source)] {
        let found = match_scaffolds_at(target, source, &Rigid::IDENTITY, &MatchingSettings::default());
        assert!(found.edit.exact);
        let axial: Vec<_> = found
            .edit
            .operations
            .iter()
            .filter(|o| o.element == EditElement::AxialCurve)
            .collect();
        assert_eq!(axial.len(), 1);
        assert_eq!(
            (axial[0].operation, axial[0].side),
            (EditKind::Splice, Some(side))
        );
        // Its persistence 2.0 above the cut 0.4, at least, and what hung on it.
        assert!(axial[0].price >= 1.6 && axial[0].price < 5.0, "{}", axial[0].text);
        assert_eq!(
            axial[0].text,
            format!("splice axial curve 0 of {side}: {:.3} mm", axial[0].price)
        );
        let kept: Vec<_> = found
            .edit
            .operations
            .iter()
            .filter(|o| o.operation == EditKind::Deform)
            .collect();
        let words: Vec<_> = found.edit.operations.iter().map(|o| &o.text).collect();
        assert_eq!(kept.len(), 2, "the sheet and its rib stay: {words:#?}");
        // Without the fin the scaffold's centroid lies elsewhere, and with it all distances from it.
        assert!(kept.iter().all(|o| o.price < 1.0), "{words:#?}");
    }
}

/// The cut passes the fin's persistence; the other shape differs in pose, size of the fin and evidence. The smaller the step, the smaller the
/// change of the price. The aligned residual, read off samples, changes by a tenth at most when the last sample of a fin goes
/// whose counterpart is there in full.
#[test]
fn the_distance_does_not_jump_while_the_cut_passes_an_element() {
    let other = moved(&scaffold(0.7, 3.0), &motion());
    let settings = MatchingSettings {
        samples: 500,
        ..Default::default()
    };
    let at = |tolerance_mm: f64| {
        let mut s = scaffold(1.0, 1.0);
        s.tolerance_mm = tolerance_mm;
        match_scaffolds(&other, &s, &settings).shape_distance
    };
    for step in [0.02, 0.0005] {
        let sweep: Vec<_> = (-1..3).map(|k| at(1.0 + step * (f64::from(k) - 0.5))).collect();
        for pair in sweep.windows(2) {
            let change = |f: &dyn Fn(&ShapeDistance) -> f64| {
                (f(&pair[1]) - f(&pair[0])).abs() / f(&pair[0]).max(f(&pair[1]))
            };
            assert!(change(&|d| d.structure_mm) < step, "step {step}: {pair:?}");
            assert!(change(&|d| d.structure) < step, "step {step}: {pair:?}");
            assert!(change(&|d| d.distribution_mm) < 0.05, "step {step}: {pair:?}");
            assert!(change(&|d| d.with_size_mm) < 0.1, "step {step}: {pair:?}");
        }
    }
}

/// A deformation of a thousandth moves every part of the distance by about a thousandth.
#[test]
fn a_small_deformation_changes_the_distance_a_little() {
    let other = moved(&scaffold(0.7, 1.1), &motion());
    let base = matched(&scaffold(1.0, 2.0), &other).shape_distance;
    for fin in [1.001, 0.999, 1.01] {
        let d = matched(&scaffold(fin, 2.0), &other).shape_distance;
        let share = (fin - 1.0f64).abs();
        let close = |a: f64, b: f64| (a - b).abs() <= 20.0 * share * a.max(b);
        assert!(close(d.structure_mm, base.structure_mm), "{d:?} {base:?}");
        assert!(close(d.distribution_mm, base.distribution_mm), "{d:?} {base:?}");
        assert!(close(d.with_size_mm, base.with_size_mm), "{d:?} {base:?}");
    }
}

/// Equal results on one thread and on several.
#[test]
fn threads_change_nothing() {
    let (a, b) = (scaffold(1.0, 2.0), moved(&scaffold(0.7, 1.1), &motion()));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| matched(&a, &b))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn size_counts_or_not() {
    let a = scaffold(1.0, 2.0);
    let mut b = a.clone();
    let grow = 1.2;
    let scale = |m: &mut MedialPoint| {
        m.position *= grow;
        m.radius *= grow;
    };
    b.nodes.iter_mut().for_each(|n| n.position *= grow);
    b.curves.iter_mut().flat_map(|c| &mut c.polyline).for_each(scale);
    for s in &mut b.sheets {
        s.moments.centroid *= grow;
        s.mesh.vertices.iter_mut().for_each(scale);
    }
    b.diagonal_mm *= grow;
    let d = matched(&a, &b).shape_distance;
    assert!(d.with_size_mm > 0.5, "{d:?}");
    assert!(d.without_size < 0.01, "{d:?}");
}

#[test]
fn a_mirrored_scaffold_needs_the_mirror() {
    let a = scaffold(1.0, 2.0);
    let flip = Rigid {
        linear: DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)),
        translation: DVec3::Y,
    };
    let motion = motion().after(&flip);
    let b = moved(&a, &motion);
    let plain = matched(&a, &b).shape_distance.with_size_mm;
    let settings = MatchingSettings {
        mirrored: true,
        ..Default::default()
    };
    let found = match_scaffolds(&a, &b, &settings);
    // Samples of a mirrored scaffold are the mirrored samples, so the distance is rounding only.
    assert!(
        found.shape_distance.with_size_mm < 1e-6,
        "{:?}",
        found.shape_distance
    );
    assert!(plain > 0.1);
    assert!(found.mirrored && found.T_target_source.is_mirrored());
    let p = DVec3::new(1.0, 2.0, 3.0);
    assert!(found.T_target_source.apply(motion.apply(p)).distance(p) < 1e-5);
    let at = match_scaffolds_at(&a, &b, &motion.inverse(), &MatchingSettings::default());
    assert!(at.mirrored && at.correspondences.sheets.len() == 2);
}

#[test]
fn what_is_missing_is_named() {
    let a = scaffold(1.0, 2.0);
    let mut b = a.clone();
    b.sheets.truncate(1);
    b.curves.retain(|c| c.id == CurveId(1));
    b.curves[0].id = CurveId(0);
    b.nodes.clear();
    let found = match_scaffolds(&a, &moved(&b, &motion()), &MatchingSettings::default());
    assert_eq!(found.correspondences.unmatched_target.sheets, [SheetId(1)]);
    assert_eq!(
        found.correspondences.unmatched_target.nodes,
        [NodeId(0), NodeId(1)]
    );
    assert_eq!(found.correspondences.sheets.len(), 1);
    assert!(found.correspondences.unmatched_source.sheets.is_empty());
}

#[test]
fn empty_scaffolds_do_not_stop_anything() {
    let empty = CoarseScaffold::default();
    let found = match_scaffolds(&empty, &scaffold(1.0, 2.0), &MatchingSettings::default());
    assert!(found.ambiguous && found.hypotheses.is_empty());
    assert_eq!(found.T_target_source, Rigid::IDENTITY);
}
