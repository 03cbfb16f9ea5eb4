//! The command line as a user meets it: exit codes, where output goes, and what damaged files are told.

mod support;

use std::fs;
use support::{medial, stderr, write_ply};

#[test]
fn help_names_every_command() {
    let out = medial(&["--help"]);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    for command in ["demo", "check", "scaffold", "match", "synth"] {
        assert!(text.contains(command), "{command} is missing from\n{text}");
    }
    assert_eq!(out.status.code(), Some(0));
}

#[test]
fn a_missing_file_and_an_unknown_option_exit_2() {
    for args in [
        &["check", "no-such-file.ply"][..],
        &["scaffold", "--no-such-option"],
        &["scaffold"],
    ] {
        assert_eq!(medial(args).status.code(), Some(2), "{args:?}");
    }
    assert!(stderr(&medial(&["check", "no-such-file.ply"])).contains("no-such-file.ply"));
}

#[test]
fn folders_without_names_are_told_of_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().to_str().expect("a path of text");
    let out = medial(&["match", path, path, "--json"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("--names"), "{}", stderr(&out));
}

/// Each damaged file must end in exit 2 and a message that names the file, for every command that reads it.
#[test]
fn damaged_files_exit_2_and_are_named() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let at = |name: &str| dir.path().join(name);
    let ply = |vertices: &str, body: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty double x\nproperty double y\nproperty double z\nend_header\n{body}"
        )
    };
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("empty.ply", Vec::new()),
        ("truncated.ply", ply("4", "0 0 0\n1 0 0\n").into_bytes()),
        ("nan.ply", ply("4", "0 0 0\n1 0 0\n0 nan 0\n0 0 1\n").into_bytes()),
        ("huge.ply", ply("1000000000000", "0 0 0\n").into_bytes()),
        ("equal.xyz", "1 2 3\n".repeat(50).into_bytes()),
        (
            "coplanar.xyz",
            (0..100)
                .map(|i| format!("{} {} 0\n", i % 10, i / 10))
                .collect::<String>()
                .into_bytes(),
        ),
        ("three.xyz", b"0 0 0\n1 0 0\n0 1 0\n".to_vec()),
        ("stl-named.ply", b"solid x\nfacet normal 0 0 1\n".to_vec()),
        (
            "noise.stl",
            (0..500u32)
                .map(|i| (i.wrapping_mul(2654435761) >> 13) as u8)
                .collect(),
        ),
        (
            "noise.nii.gz",
            (0..500u32).map(|i| (i.wrapping_mul(40503) >> 3) as u8).collect(),
        ),
        (
            "text.nrrd",
            b"NRRD0004\ntype: short\ndimension: 3\nsizes: 1000000 1000000 1\nencoding: raw\n\nab".to_vec(),
        ),
    ];
    for (name, bytes) in &cases {
        fs::write(at(name), bytes).expect("writable");
        let path = at(name);
        let path = path.to_str().expect("utf-8");
        let target = dir.path().join("out");
        let target = target.to_str().expect("utf-8");
        let out = medial(&["scaffold", path, "-o", target, "--no-report"]);
        let message = stderr(&out);
        assert_eq!(out.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains(name), "{name} is not named in: {message}");
        assert!(!message.contains("panicked"), "{name}: {message}");
    }
}

#[test]
fn check_says_what_an_open_mesh_is_fit_for() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let mut mesh = support::bone();
    let good = dir.path().join("closed.ply");
    write_ply(&good, &mesh);
    let out = medial(&["check", good.to_str().expect("utf-8"), "--json"]);
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    serde_json::from_slice::<serde_json::Value>(&out.stdout).expect("stdout is JSON and nothing else");

    mesh.triangles.truncate(mesh.triangles.len() * 2 / 3);
    let open = dir.path().join("open.ply");
    write_ply(&open, &mesh);
    let open = open.to_str().expect("utf-8");
    let out = medial(&["check", open]);
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert_eq!(out.status.code(), Some(0), "{text}");
    assert!(
        text.contains("scaffold: yes") && text.contains("change: NO"),
        "{text}"
    );
    assert_eq!(
        medial(&["check", open, "--for", "scaffold"]).status.code(),
        Some(0)
    );
    assert_eq!(medial(&["check", open, "--for", "change"]).status.code(), Some(1));
    // What `check` promises, `scaffold` keeps: one scaffold of both sides.
    let out = medial(&["scaffold", open, "--json", "--side", "both"]);
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).expect("one document");
    assert_eq!(json["side"], "joined");
    assert_eq!(json["topology"]["agree"], true);
    assert!(stderr(&out).contains("both its sides"), "{}", stderr(&out));
}

#[test]
fn scaffold_writes_what_the_contract_names_and_the_same_bytes_on_any_number_of_threads() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let input = dir.path().join("bone.ply");
    write_ply(&input, &support::bone());
    let mut seen: Vec<Vec<u8>> = Vec::new();
    for threads in ["1", "2"] {
        let target = dir.path().join(format!("out{threads}"));
        let out = medial(&[
            "scaffold",
            input.to_str().expect("utf-8"),
            "-o",
            target.to_str().expect("utf-8"),
            "--threads",
            threads,
            "--json",
        ]);
        assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
        for file in [
            "run.json",
            "scaffold.json",
            "surface.ply",
            "fine.ma",
            "sheets.vtp",
            "curves.vtp",
            "scene.glb",
            "report.html",
        ] {
            assert!(target.join(file).is_file(), "{file} is missing");
        }
        let json: serde_json::Value =
            serde_json::from_slice(&fs::read(target.join("scaffold.json")).expect("readable")).expect("JSON");
        assert_eq!(json["full"]["morse"], 1);
        assert_eq!(json["topology"]["agree"], true, "{}", json["topology"]);
        assert_eq!(json["topology"]["solid_betti"], serde_json::json!([1, 0, 0]));
        seen.push(
            [
                "scaffold.json",
                "surface.ply",
                "fine.ma",
                "sheets.vtp",
                "curves.vtp",
                "scene.glb",
            ]
            .iter()
            .flat_map(|f| fs::read(target.join(f)).expect("readable"))
            .collect(),
        );
    }
    assert!(seen[0] == seen[1], "threads change the output");
}

/// A mask of thick slices does not know its surface better than half a slice: the tolerance is at least that unless one is asked for,
/// and the result says so.
#[test]
fn the_bones_of_one_folder_are_named_by_those_of_another() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let folder = |name: &str| {
        let path = dir.path().join(name);
        fs::create_dir(&path).expect("a folder");
        path
    };
    let [known, unknown, out] = ["known", "unknown", "out"].map(folder);
    // The second set a quarter larger, in another pose, under names in another order.
    let motion = datasets_synthetic::rigid::random(3);
    let bones = [("capitate", "c"), ("lunate", "a"), ("pisiform", "b")];
    for (name, other) in bones {
        let made = match name {
            "capitate" => datasets_synthetic::bones::capitate_like(0),
            "lunate" => datasets_synthetic::bones::lunate_like(0),
            _ => datasets_synthetic::bones::pisiform_like(0),
        }
        .mesh(1_500);
        let mut mesh = medial_scaffold::geometry::TriangleMesh {
            points: made.points,
            triangles: made.triangles,
        };
        write_ply(&known.join(format!("{name}.ply")), &mesh);
        for p in &mut mesh.points {
            *p = motion.apply(1.25 * *p);
        }
        write_ply(&unknown.join(format!("{other}.ply")), &mesh);
    }
    fs::write(unknown.join("notes.txt"), "no shape").expect("a file");
    let path = |p: &std::path::Path| p.to_str().expect("utf-8").to_owned();
    let args = ["match", &path(&known), &path(&unknown), "--names"];
    let run = medial(&[&args[..], &["--json", "-o", &path(&out)]].concat());
    assert_eq!(run.status.code(), Some(0), "{}", stderr(&run));
    let json: serde_json::Value = serde_json::from_slice(&run.stdout).expect("one document");
    assert_eq!(json["schema"], "medial-scaffold/names");
    let pairs = json["pairs"].as_array().expect("pairs");
    assert_eq!(pairs.len(), 3);
    for (name, other) in bones {
        let found = pairs.iter().find(|p| p["source"] == format!("{other}.ply"));
        assert_eq!(found.expect("a pair")["target"], format!("{name}.ply"));
    }
    assert!((json["size_ratio"].as_f64().expect("a number") - 1.25).abs() < 0.02);
    assert!(stderr(&run).contains("notes.txt"), "{}", stderr(&run));
    let table = fs::read_to_string(out.join("names.csv")).expect("a table");
    assert_eq!(table.lines().count(), 4);
    assert!(out.join("names.json").is_file());
    // One file where a folder is wanted, and nowhere to put the result.
    let one = path(&known.join("lunate.ply"));
    let wrong = medial(&["match", &path(&known), &one, "--names", "--json"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(stderr(&wrong).contains("lunate.ply"), "{}", stderr(&wrong));
    assert_eq!(medial(&args).status.code(), Some(2));
}

#[test]
fn the_tolerance_of_a_mask_is_at_least_half_its_largest_voxel_edge() {
    let dir = tempfile::tempdir().expect("a temporary directory");
    let mask = dir.path().join("ball.nrrd");
    let (across, slices) = (24usize, 9usize);
    let mut bytes = format!(
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: {across} {across} {slices}\nspace: left-posterior-superior\n\
         space directions: (1,0,0) (0,1,0) (0,0,3)\nspace origin: (0,0,0)\nendian: little\nencoding: raw\n\n"
    )
    .into_bytes();
    for k in 0..slices {
        for j in 0..across {
            for i in 0..across {
                let d = [i as f64 - 11.5, j as f64 - 11.5, 3.0 * (k as f64 - 4.0)];
                bytes.push(u8::from(d.iter().map(|x| x * x).sum::<f64>() < 100.0));
            }
        }
    }
    fs::write(&mask, bytes).expect("the mask is written");
    let run = |extra: &[&str]| -> serde_json::Value {
        let out_dir = dir.path().join("out");
        let mut args = vec![
            "scaffold",
            mask.to_str().expect("a text path"),
            "-o",
            out_dir.to_str().expect("a text path"),
            "--json",
            "--no-report",
        ];
        args.extend(extra);
        let out = medial(&args);
        assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
        serde_json::from_slice(&out.stdout).expect("JSON on stdout")
    };
    let floored = run(&[]);
    assert_eq!(floored["tolerance_mm"], 1.5);
    assert!(
        floored["notes"].to_string().contains("largest voxel edge"),
        "{}",
        floored["notes"]
    );
    let asked = run(&["--tolerance", "0.4mm"]);
    assert_eq!(asked["tolerance_mm"], 0.4);
    assert!(!asked["notes"].to_string().contains("largest voxel edge"));
}
