//! Files are read back by other people's readers, and hold exactly what was written.

use glam::{DMat3, DVec3};
use medial_scaffold::coarse_scaffold::hypergraph::{
    CoarseScaffold, Curve, CurveKind, MedialPoint, Node, NodeKind, Sheet, SheetMesh, SheetMoments,
};
use medial_scaffold::geometry::{CurveId, NodeId, Rigid, SheetId, TriangleMesh};
use medial_scaffold::reports::{self, LayerKind, MedialMesh, PlyEncoding, Quantity, Scene, VertexField};
use std::path::PathBuf;

/// A tetrahedron with awkward digits.
fn tetrahedron() -> TriangleMesh {
    TriangleMesh {
        points: vec![
            DVec3::new(0.1, 1.0 / 3.0, -1e-17),
            DVec3::new(10.0, 0.0, 0.2),
            DVec3::new(0.0, 7.0, 1e5),
            DVec3::new(-2.5, 0.3, 4.0),
        ],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    }
}

/// Two square sheets that share an axial curve, three ribs each, and a wire.
fn scaffold() -> CoarseScaffold {
    let m = |x: f64, y: f64, z: f64, r: f64| MedialPoint {
        position: DVec3::new(x, y, z),
        radius: r,
    };
    let sheet = |id: u32, corners: [MedialPoint; 4]| Sheet {
        id: SheetId(id),
        persistence: 1.0 + f64::from(id),
        boundary: vec![vec![CurveId(0), CurveId(1 + id)]],
        area: 100.0,
        mean_radius: 2.5,
        max_radius: 4.0,
        volume_share: 0.5,
        generators: 10,
        moments: SheetMoments::default(),
        mesh: SheetMesh {
            vertices: corners.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        },
    };
    let (a, b) = (m(0.0, 0.0, 0.0, 3.0), m(0.0, 10.0, 0.0, 2.0));
    let curve = |id: u32, kind: CurveKind, polyline: Vec<MedialPoint>, sheets: Vec<SheetId>| Curve {
        id: CurveId(id),
        kind,
        persistence: 0.5,
        nodes: vec![NodeId(0), NodeId(1)],
        closed: false,
        sheets,
        length: 10.0,
        polyline,
    };
    let node = |id: u32, p: MedialPoint| Node {
        id: NodeId(id),
        kind: NodeKind::A1A3,
        position: p.position,
        radius: p.radius,
        curves: vec![CurveId(0)],
        sheets: Vec::new(),
        persistence: 0.5,
    };
    let (c, d) = (m(10.0, 10.0, 1.0, 1.0), m(10.0, 0.0, 1.0, 1.5));
    let (e, f) = (m(-10.0, 10.0, 2.0, 1.0), m(-10.0, 0.0, 2.0, 1.5));
    CoarseScaffold {
        tolerance_mm: 0.2,
        diagonal_mm: 25.0,
        nodes: vec![node(0, a), node(1, b)],
        curves: vec![
            curve(0, CurveKind::Axial, vec![a, b], vec![SheetId(0), SheetId(1)]),
            curve(1, CurveKind::Rib, vec![b, c, d, a], vec![SheetId(0)]),
            curve(2, CurveKind::Rib, vec![b, e, f, a], vec![SheetId(1)]),
            curve(
                3,
                CurveKind::Wire,
                vec![b, m(0.0, 15.0, 0.0, 1.0), m(0.0, 20.0, 0.0, 0.5)],
                vec![],
            ),
        ],
        sheets: vec![sheet(0, [a, d, c, b]), sheet(1, [a, b, e, f])],
        ..CoarseScaffold::default()
    }
}

struct Folder {
    dir: tempfile::TempDir,
}

impl Folder {
    fn new() -> Self {
        Self {
            dir: tempfile::tempdir().expect("a temporary folder"),
        }
    }
    fn file(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }
}

#[test]
fn ply_reads_back_bit_for_bit_with_its_fields_and_frame() {
    use ply_rs_bw::{parser::Parser, ply::DefaultElement, ply::Property};
    let (folder, mesh) = (Folder::new(), tetrahedron());
    let thickness = vec![0.1, f64::MIN_POSITIVE, 3.0, 1.0 / 7.0];
    let fields = [
        VertexField::real("thickness", thickness.clone()),
        VertexField::integer("sheet", vec![3, -1, 0, 7]),
    ];
    for encoding in [PlyEncoding::Binary, PlyEncoding::Ascii] {
        let path = folder.file("a.ply");
        reports::write_ply(&path, &mesh, &fields, encoding).expect("writes");
        let bytes = std::fs::read(&path).expect("reads");
        let ply = Parser::<DefaultElement>::new()
            .read_ply(&mut bytes.as_slice())
            .expect("a PLY file");
        assert!(ply.header.comments.iter().any(|c| c.contains("SPACE=LPS")));
        for (i, v) in ply.payload["vertex"].iter().enumerate() {
            let read = |name: &str| match v[name] {
                Property::Double(x) => x,
                ref other => panic!("{name} is {other:?}"),
            };
            let p = DVec3::new(read("x"), read("y"), read("z"));
            assert_eq!(
                p.to_array().map(f64::to_bits),
                mesh.points[i].to_array().map(f64::to_bits)
            );
            assert_eq!(read("thickness").to_bits(), thickness[i].to_bits());
            assert!(matches!(v["sheet"], Property::Int(s) if s == [3, -1, 0, 7][i]));
        }
        for (i, f) in ply.payload["face"].iter().enumerate() {
            let Property::ListInt(ref ids) = f["vertex_indices"] else {
                panic!("indices");
            };
            assert_eq!(*ids, mesh.triangles[i].map(|x| x as i32).to_vec());
        }
    }
    let short = [VertexField::real("thickness", vec![1.0])];
    let error = reports::write_ply(&folder.file("b.ply"), &mesh, &short, PlyEncoding::Binary)
        .expect_err("one value for four vertices");
    assert!(error.to_string().contains("1 values for 4 vertices"), "{error}");
    assert!(!folder.file("b.ply").exists());
}

#[test]
fn stl_obj_and_off_read_back() {
    let (folder, mesh) = (Folder::new(), tetrahedron());
    reports::write_mesh(&folder.file("a.stl"), &mesh, &[]).expect("writes");
    let mut file = std::fs::File::open(folder.file("a.stl")).expect("opens");
    let stl = stl_io::read_stl(&mut file).expect("an STL file");
    assert_eq!((stl.vertices.len(), stl.faces.len()), (4, 4));

    reports::write_mesh(&folder.file("a.obj"), &mesh, &[]).expect("writes");
    let (models, _) =
        tobj::load_obj(folder.file("a.obj"), &tobj::LoadOptions::default()).expect("an OBJ file");
    // The reader numbers vertices in the order faces name them, so corners are compared, not arrays.
    let read = &models[0].mesh;
    let corners = |ids: &[u32], points: &dyn Fn(usize) -> [f64; 3]| -> Vec<[f64; 3]> {
        ids.iter().map(|i| points(*i as usize)).collect()
    };
    assert_eq!(
        corners(&read.indices, &|i| [0, 1, 2].map(|k| read.positions[3 * i + k])),
        corners(&mesh.triangles.concat(), &|i| mesh.points[i].to_array())
    );

    reports::write_mesh(&folder.file("a.off"), &mesh, &[]).expect("writes");
    let text = std::fs::read_to_string(folder.file("a.off")).expect("reads");
    assert!(
        text.contains("\n4 4 0\n") && text.contains("\n3 0 2 1\n"),
        "{text}"
    );

    let error = reports::write_mesh(&folder.file("a.docx"), &mesh, &[]).expect_err("no mesh format");
    assert!(error.to_string().contains("ply, stl, obj, off, vtp"), "{error}");
}

#[test]
fn vtp_reads_back_with_curve_kinds_and_radii() {
    use vtkio::model::{Attribute, DataSet, Piece};
    let folder = Folder::new();
    let data = reports::curves_polydata(&scaffold());
    let path = folder.file("curves.vtp");
    reports::write_vtp(&path, &data).expect("writes");
    let vtk = vtkio::Vtk::import(&path).expect("a VTP file");
    let DataSet::PolyData { pieces, .. } = vtk.data else {
        panic!("not polydata");
    };
    let Some(Piece::Inline(piece)) = pieces.into_iter().next() else {
        panic!("no inline piece");
    };
    let points: Vec<f64> = piece.points.cast_into::<f64>().expect("points");
    assert_eq!(
        points,
        data.points.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>()
    );
    assert_eq!(piece.lines.expect("lines").num_cells(), 4);
    let kind = piece.data.cell.iter().find_map(|a| match a {
        Attribute::DataArray(d) if d.name == "kind" => d.data.clone().cast_into::<i32>(),
        _ => None,
    });
    assert_eq!(kind, Some(vec![0, 1, 1, 2]));
    // Same data, same bytes.
    let first = std::fs::read(&path).expect("reads");
    reports::write_vtp(&path, &data).expect("writes");
    assert_eq!(first, std::fs::read(&path).expect("reads"));

    let sheets = reports::sheets_polydata(&scaffold());
    assert_eq!((sheets.points.len(), sheets.triangles.len()), (8, 4));
    reports::write_vtp(&folder.file("sheets.vtp"), &sheets).expect("writes");
    assert!(vtkio::Vtk::import(folder.file("sheets.vtp")).is_ok());
}

#[test]
fn fine_ma_joins_sheets_along_the_axial_curve() {
    let ma = MedialMesh::from_scaffold(&scaffold());
    // Eight corners less the two shared ones, plus two of the wire; Euler number of a contractible complex.
    assert_eq!(ma.vertices.len(), 8);
    assert_eq!(ma.triangles.len(), 4);
    assert_eq!(
        ma.vertices.len() as i64 - ma.edges.len() as i64 + ma.triangles.len() as i64,
        1
    );
    let folder = Folder::new();
    reports::write_ma(&folder.file("fine.ma"), &ma).expect("writes");
    let text = std::fs::read_to_string(folder.file("fine.ma")).expect("reads");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("8 11 4"));
    assert_eq!(lines.next(), Some("v 0 0 0 3"));
    assert_eq!(text.lines().filter(|l| l.starts_with("e ")).count(), 11);
}

#[test]
fn the_itk_transform_is_the_inverse_that_itk_wants() {
    let motion = Rigid {
        linear: DMat3::from_rotation_z(0.4),
        translation: DVec3::new(3.0, -2.0, 7.5),
    };
    let folder = Folder::new();
    reports::write_tfm(&folder.file("T.tfm"), &motion).expect("writes");
    let text = std::fs::read_to_string(folder.file("T.tfm")).expect("reads");
    let line = text
        .lines()
        .find_map(|l| l.strip_prefix("Parameters: "))
        .expect("parameters");
    let p: Vec<f64> = line.split(' ').map(|x| x.parse().expect("a number")).collect();
    let source = DVec3::new(1.0, 2.0, 3.0);
    let target = motion.apply(source);
    let back: Vec<f64> = (0..3)
        .map(|i| (0..3).map(|j| p[3 * i + j] * target[j]).sum::<f64>() + p[9 + i])
        .collect();
    assert!((DVec3::new(back[0], back[1], back[2]) - source).length() < 1e-12);
}

#[test]
fn csv_quotes_what_needs_it() {
    let folder = Folder::new();
    let rows = vec![vec!["a,b".to_owned(), "0.1".to_owned()]];
    reports::write_csv(&folder.file("t.csv"), &["name", "x"], &rows).expect("writes");
    let text = std::fs::read_to_string(folder.file("t.csv")).expect("reads");
    assert_eq!(text, "name,x\n\"a,b\",0.1\n");
    let ragged = vec![vec!["only one".to_owned()]];
    assert!(reports::write_csv(&folder.file("u.csv"), &["name", "x"], &ragged).is_err());
}

#[test]
fn glb_holds_named_layers_and_reads_back() {
    let mut scene = Scene::default();
    let mut mesh = tetrahedron();
    mesh.points[2].z = 1.0;
    for p in &mut mesh.points {
        *p += DVec3::new(512.0, -300.0, 1024.0);
    }
    let thickness = Quantity::positive("thickness", "mm", vec![1.0, 2.0, 3.0, 4.0]);
    scene.add_surface("", &mesh, [0.9, 0.85, 0.8, 1.0], Some(thickness));
    let shift = Rigid {
        translation: DVec3::new(512.0, -300.0, 1024.0),
        ..Rigid::IDENTITY
    };
    scene.add_scaffold("", &scaffold(), &shift);
    let bytes = reports::glb_bytes(&scene);
    assert_eq!(&bytes[..4], b"glTF");
    assert_eq!(
        u32::from_le_bytes(bytes[8..12].try_into().expect("four")) as usize,
        bytes.len()
    );

    let back = reports::scene_from_glb(&bytes).expect("reads back");
    let names: Vec<&str> = back.layers.iter().map(|l| l.name.as_str()).collect();
    for name in [
        "surface", "sheet 0", "sheet 1", "axial 0", "rib 1", "rib 2", "wire 3", "node 0", "node 1",
    ] {
        assert!(names.contains(&name), "{names:?}");
    }
    assert_eq!(back.layers.len(), scene.layers.len());
    for (a, b) in scene.layers.iter().zip(&back.layers) {
        assert_eq!(
            (a.kind, &a.mesh.triangles, &a.properties),
            (b.kind, &b.mesh.triangles, &b.properties)
        );
        assert_eq!(a.quantity, b.quantity);
        for (p, q) in a.mesh.points.iter().zip(&b.mesh.points) {
            assert!(p.distance(*q) < 1e-5);
        }
    }
    // Same scene, same bytes.
    assert!(reports::glb_bytes(&scene) == bytes);
    let axial = back
        .layers
        .iter()
        .find(|l| l.kind == LayerKind::Axial)
        .expect("an axial curve");
    assert!(axial.colour[0] > 0.8 && axial.colour[2] < 0.3);

    for cut in [0, 3, 11, 40, bytes.len() / 2, bytes.len() - 1] {
        assert!(reports::scene_from_glb(&bytes[..cut]).is_err(), "cut at {cut}");
    }
}

/// What `scaffold.json` says of the two squares.
fn scaffold_json() -> serde_json::Value {
    let mut s = serde_json::to_value(scaffold()).expect("JSON");
    s["name"] = "two <squares>".into();
    s["counts"] = serde_json::json!({"nodes": 2, "axial_curves": 1, "rib_curves": 2, "sheets": 2});
    s["topology"] = serde_json::json!({"solid_betti": [1, 0, 0], "scaffold_betti": [1, 0, 0], "agree": true});
    s
}

fn scaffold_scene() -> Scene {
    let mut scene = Scene::default();
    let mut mesh = tetrahedron();
    mesh.points[2].z = 1.0;
    scene.add_surface("", &mesh, [0.9, 0.85, 0.8, 1.0], None);
    scene.add_scaffold("", &scaffold(), &Rigid::IDENTITY);
    scene
}

#[test]
fn a_page_holds_its_data_and_is_rebuilt_from_the_files_alone() {
    let folder = Folder::new();
    let (result, run) = (
        scaffold_json(),
        serde_json::json!({"seed": 0, "warnings": ["mind the gap", "mind the gap"]}),
    );
    let report =
        reports::scaffold_report("two <squares>", &result, &run, scaffold_scene()).expect("a report");
    let page = report.html().expect("a page");
    assert_eq!(page, report.html().expect("a page"), "same report, same bytes");
    assert!(page.contains("two &lt;squares&gt;") && !page.contains("<squares>"));
    assert_eq!(
        page.matches("mind the gap").count(),
        3,
        "once as a note, twice in the record"
    );
    for id in ["result", "run", "view-settings", "scene-glb"] {
        assert!(page.contains(&format!("id=\"{id}\"")), "{id}");
    }
    assert!(!page.contains("src=\"http") && !page.contains("href=\"http"));

    reports::write_json(&folder.file("scaffold.json"), &result).expect("writes");
    reports::write_json(&folder.file("run.json"), &run).expect("writes");
    let dir = folder.dir.path();
    let bare = reports::rebuild(dir).expect("rebuilds without a scene");
    assert!(bare.notes.iter().any(|n| n.text.contains("scene.glb")));
    reports::write_bytes(&folder.file("scene.glb"), reports::glb_bytes(&scaffold_scene())).expect("writes");
    let again = reports::rebuild(dir).expect("rebuilds");
    assert_eq!(again.title, "Medial scaffold of two <squares>");
    assert_eq!((again.sections, again.figures), (report.sections, report.figures));

    std::fs::write(folder.file("scaffold.json"), "{").expect("writes");
    assert!(
        reports::rebuild(dir)
            .expect_err("damaged")
            .to_string()
            .contains("scaffold.json")
    );
    let empty = Folder::new();
    assert!(
        reports::rebuild(empty.dir.path())
            .expect_err("empty")
            .to_string()
            .contains("change.json")
    );
    let mut cut = result;
    cut.as_object_mut().expect("an object").remove("counts");
    let error = reports::scaffold_report("x", &cut, &run, Scene::default()).expect_err("no counts");
    assert!(error.to_string().contains("counts.sheets"), "{error}");
}

/// Every number of a value, as text.
fn numbers(value: &serde_json::Value, out: &mut std::collections::BTreeSet<String>) {
    match value {
        serde_json::Value::Number(n) => {
            let x = n.as_f64().expect("a number");
            out.insert(x.to_string());
        }
        serde_json::Value::Array(list) => list.iter().for_each(|v| numbers(v, out)),
        serde_json::Value::Object(map) => map.values().for_each(|v| numbers(v, out)),
        _ => {}
    }
}

#[test]
fn every_number_in_the_tables_of_a_change_is_in_its_json_and_in_the_csv() {
    use medial_scaffold::change::{ChangeSettings, change};
    use medial_scaffold::input::{Geometry, Shape};
    let ball = |radius: f64| {
        let mut mesh = TriangleMesh::default();
        let (rings, around) = (24u32, 48u32);
        for i in 0..=rings {
            for j in 0..around {
                let (a, b) = (
                    std::f64::consts::PI * f64::from(i) / f64::from(rings),
                    std::f64::consts::TAU * f64::from(j) / f64::from(around),
                );
                mesh.points
                    .push(radius * DVec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos()));
            }
        }
        // The rings at the poles shrink to one point each.
        let at = |i: u32, j: u32| match i {
            0 => 0,
            i if i == rings => rings * around,
            i => i * around + j % around,
        };
        for i in 0..rings {
            for j in 0..around {
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                mesh.triangles.extend(
                    [[a, b, c], [a, c, d]]
                        .into_iter()
                        .filter(|t| t[0] != t[1] && t[1] != t[2] && t[0] != t[2]),
                );
            }
        }
        Shape::generated("ball", Geometry::Mesh(mesh))
    };
    let found = change(&ball(8.0), &ball(9.0), &ChangeSettings::default()).expect("two solids");
    let json = serde_json::to_value(&found).expect("JSON");
    let scene = reports::change_scene(&found);
    let report = reports::change_report("x", &json, &serde_json::Value::Null, scene).expect("a report");
    let mut known = std::collections::BTreeSet::new();
    numbers(&json, &mut known);
    let mut checked = 0;
    for table in report.sections.iter().flat_map(|s| &s.tables) {
        for cell in table.rows.iter().flatten() {
            if let Ok(x) = cell.exact.parse::<f64>() {
                assert!(
                    known.contains(&x.to_string()),
                    "{}: {} is not in the JSON",
                    table.caption,
                    cell.exact
                );
                checked += 1;
            }
        }
    }
    assert!(checked > 40, "{checked}");
    let folder = Folder::new();
    let files = reports::write_tables(folder.dir.path(), &report).expect("writes");
    let names: Vec<String> = files
        .iter()
        .map(|f| f.file_name().expect("a name").to_string_lossy().into_owned())
        .collect();
    assert!(names.contains(&"volume-change.csv".to_owned()), "{names:?}");
    let text = std::fs::read_to_string(folder.file("tables/volume-change.csv")).expect("reads");
    assert!(text.starts_with("lesion,baseline [mm\u{b3}],"), "{text}");
    assert!(
        text.contains(&found.lesions[0].change.percent.to_string()),
        "{text}"
    );
}
