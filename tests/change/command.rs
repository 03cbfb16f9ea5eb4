//! `medial change` as it is called: dates aligned on a bone by its label, and segmentations of one date against each other.

use crate::common::ball_volume;
use glam::{DMat3, DVec3};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn medial(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_medial"))
        .args(args)
        .output()
        .expect("the program runs")
}

/// Writes a 1 mm label map about the origin as MetaImage.
fn write_mask(path: &Path, half: i32, label: impl Fn(DVec3) -> u8) {
    let n = 2 * half + 1;
    let mut bytes = format!(
        "ObjectType = Image\nNDims = 3\nDimSize = {n} {n} {n}\nElementSpacing = 1 1 1\nOffset = -{half} -{half} -{half}\n\
         ElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
    )
    .into_bytes();
    let voxel = |v: i32| DVec3::new(f64::from(v % n), f64::from(v / n % n), f64::from(v / n / n));
    bytes.extend((0..n * n * n).map(|v| label(voxel(v) - f64::from(half))));
    std::fs::write(path, bytes).expect("writes");
}

fn json(out: &Output) -> Value {
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("stdout is JSON and nothing else")
}

#[test]
fn dates_are_aligned_on_the_label_of_a_bone() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = |name: &str| -> PathBuf { dir.path().join(name) };
    // A bone without symmetry (5), and a lesion (1) beside it that grows from 4 to 5 mm.
    let bone = |p: DVec3| {
        let body = ((p - DVec3::new(-6.0, 0.0, 0.0)) / DVec3::new(6.0, 9.0, 14.0)).length() < 1.0;
        let knob = p.distance(DVec3::new(-4.0, 8.0, 9.0)) < 4.5;
        let spur = p.distance(DVec3::new(-11.0, -3.0, -9.0)) < 4.0;
        body || knob || spur
    };
    let scene = move |p: DVec3, radius: f64| {
        if p.distance(DVec3::new(10.0, 2.0, 3.0)) < radius {
            1
        } else {
            5 * u8::from(bone(p))
        }
    };
    // The patient lies otherwise at the second date: x_followup = R x + t.
    let turn = DMat3::from_rotation_z(0.15) * DMat3::from_rotation_x(-0.1);
    let shift = DVec3::new(3.0, -4.0, 2.0);
    write_mask(&file("a.mha"), 26, |p| scene(p, 4.0));
    write_mask(&file("b.mha"), 26, |p| scene(turn.transpose() * (p - shift), 5.0));
    let [a, b] = ["a.mha", "b.mha"].map(|n| file(n).display().to_string());
    let out = medial(&["change", &a, &b, "--align-on", "5", "--json", "-q"]);
    let found = json(&out);
    let lesions = found["lesions"].as_array().expect("lesions");
    assert_eq!(lesions.len(), 1, "the bone is no lesion");
    // A ball of 4 voxels radius is counted to some percent: the interval says so and holds the truth.
    let interval = &lesions[0]["change"]["ci95_percent"];
    let truth = 100.0 * (ball_volume(5.0) / ball_volume(4.0) - 1.0);
    let end = |k: usize| interval[k].as_f64().expect("a number");
    assert!(end(0) < truth && truth < end(1), "{interval} for {truth}");
    let alignment = &found["alignment"];
    assert_eq!(alignment["on"], "label 5");
    let rows: [[f64; 4]; 4] =
        serde_json::from_value(alignment["T_baseline_followup"].clone()).expect("a matrix");
    let row = |i: usize| DVec3::new(rows[i][0], rows[i][1], rows[i][2]);
    for p in [DVec3::new(10.0, 2.0, 3.0), DVec3::new(-10.0, 5.0, -8.0)] {
        let q = turn * p + shift;
        let back = DVec3::new(row(0).dot(q), row(1).dot(q), row(2).dot(q))
            + DVec3::new(rows[0][3], rows[1][3], rows[2][3]);
        assert!(back.distance(p) < 0.5, "{back} for {p}");
    }
    // The lesion grew all round; not aligned, it seems to have moved.
    assert_eq!(lesions[0]["parts"][0]["name"], "grew all round");
    let missing = medial(&["change", &a, &b, "--align-on", "7", "--json"]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("label 7"));
}

#[test]
fn segmentations_are_compared_with_the_truth_and_give_the_interval_their_spread() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = |name: &str| dir.path().join(name).display().to_string();
    for (name, radius) in [
        ("one.mha", 7.8),
        ("two.mha", 8.2),
        ("truth.mha", 8.0),
        ("later.mha", 9.0),
    ] {
        write_mask(Path::new(&at(name)), 12, |p| u8::from(p.length() < radius));
    }
    let named = |name: &str| format!("{name}={}", at(&format!("{name}.mha")));
    let (one, two, truth, out_dir) = (named("one"), named("two"), named("truth"), at("out"));
    let segmentations = [
        "--segmentation",
        &one,
        "--segmentation",
        &two,
        "--segmentation",
        &truth,
    ];
    let mut args = vec!["change", "--truth", "truth", "-o", &out_dir, "--json", "-q"];
    args.extend(segmentations);
    let found = json(&medial(&args));
    let s = &found["segmentations"];
    assert_eq!(s["reference"], "truth");
    assert_eq!(
        (
            s["lesions"].as_array().map(Vec::len),
            s["pairs"].as_array().map(Vec::len)
        ),
        (Some(3), Some(2))
    );
    for pair in s["pairs"].as_array().expect("pairs") {
        assert_eq!(pair["first"], "truth");
        let a = &pair["agreement"];
        assert!(a["dice"].as_f64().expect("Dice") > 0.93);
        assert!(
            (a["mesh"]["assd"].as_f64().expect("a distance") - 0.2).abs() < 0.12,
            "{a}"
        );
        assert_eq!(a["voxel"]["surface_dice"], 1.0);
    }
    assert_eq!(s["pooled"]["degrees_of_freedom"], 1);
    let tables = dir.path().join("out/tables");
    let table =
        std::fs::read_to_string(tables.join("segmentations-of-one-date-size-of-each.csv")).expect("a table");
    let voxel = s["lesions"][0]["volume_voxel"].to_string();
    assert!(
        table.contains(&voxel.trim_end_matches(".0").to_owned()),
        "{voxel} in\n{table}"
    );

    // Two dates: two segmentations and the baseline's own give two degrees of freedom.
    let (baseline, later) = (at("truth.mha"), at("later.mha"));
    let mut args = vec!["change", &baseline, &later, "--json", "-q"];
    args.extend(&segmentations[..4]);
    let found = json(&medial(&args));
    let pooled = &found["segmentations"]["pooled"];
    assert_eq!(pooled["degrees_of_freedom"], 2);
    let cv = pooled["cv"].as_f64().expect("a number");
    let error = &found["lesions"][0]["baseline_error"];
    let wanted = 4.303 / 1.959_963_984_540_054
        * cv
        * found["lesions"][0]["baseline"]["volume_best"]
            .as_f64()
            .expect("a volume");
    assert!((error["boundary_mm3"].as_f64().expect("a number") / wanted - 1.0).abs() < 1e-9);

    let mut args = vec!["change", "--truth", "three", "--json"];
    args.extend(segmentations);
    let out = medial(&args);
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("one, two, truth"));
}
