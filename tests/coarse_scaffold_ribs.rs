//! Ribs and the borders of sheets: corners, strips, tongues and bridges.

mod coarse_support;

use coarse_support::{check_references, counts, fine_of, fine_of_mesh, scaffold, scaffold_of};
use datasets_synthetic::shapes;
use glam::DVec3;
use medial_scaffold::coarse_scaffold::{
    CoarseScaffold, CoarseScaffoldSettings, Host, NodeKind, coarse_scaffold,
};
use medial_scaffold::fine_scaffold::FineScaffold;
use medial_scaffold::geometry::Length;
use medial_scaffold::input::{Geometry, ReadSettings, read_shape};
use medial_scaffold::regularise::{RegulariseSettings, regularise};

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
