//! From a shape to its coarse scaffold, and what every coarse scaffold must be.
#![allow(dead_code)] // every test file uses its own part

use datasets_synthetic::shapes;
use glam::DVec3;
use medial_scaffold::coarse_scaffold::{
    CoarseScaffold, CoarseScaffoldSettings, CurveKind, NodeKind, coarse_scaffold,
};
use medial_scaffold::fine_scaffold::{FineScaffold, FineScaffoldSettings, fine_scaffold};
use medial_scaffold::geometry::{Length, TriangleMesh};
use medial_scaffold::regularise::{RegulariseSettings, regularise};
use medial_scaffold::segregation::{KnownSurfaceSettings, segregate_known_refined};

pub fn scaffold(shape: &shapes::Shape, n: usize, seed: u64) -> CoarseScaffold {
    scaffold_at(shape, n, seed, 1.0)
}

/// At a tolerance in % of the diagonal.
pub fn scaffold_at(shape: &shapes::Shape, n: usize, seed: u64, percent: f64) -> CoarseScaffold {
    scaffold_of(fine_of(shape, n, seed), Length::PercentDiagonal(percent))
}

pub fn scaffold_of(fine: FineScaffold, tolerance: Length) -> CoarseScaffold {
    let settings = RegulariseSettings {
        tolerance,
        ..RegulariseSettings::default()
    };
    let regularised = regularise(&fine, &settings).expect("topology is kept");
    assert!(regularised.fidelity.max_tolerances <= 1.0);
    coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default())
}

pub fn fine_of(shape: &shapes::Shape, n: usize, seed: u64) -> FineScaffold {
    fine_of_mesh(&shape.mesh(20_000), shape.sample_poisson(n, seed).points)
}

pub fn fine_of_mesh(mesh: &datasets_synthetic::TriangleMesh, points: Vec<DVec3>) -> FineScaffold {
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
pub fn counts(s: &CoarseScaffold) -> [usize; 5] {
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
pub fn check_references(s: &CoarseScaffold) {
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
