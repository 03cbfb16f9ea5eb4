//! Clouds for other reconstructors, and a judge of what they make of them; `compare/reconstruction.sh` runs the race.
//!
//! ```text
//! cargo run --release --example reconstruction_race -- dump FOLDER [N [NOISE,NOISE... [SEEDS]]]
//! cargo run --release --example reconstruction_race -- judge FOLDER
//! ```
//! `dump` writes, for every case, `CASE.raw.xyz` (the cloud), `CASE.clean.xyz` (as this project de-noised it),
//! `CASE.truth.off` and `CASE.ours.raw.off` with its seconds in `.txt`. `judge` reads every `CASE.METHOD.INPUT.off` and prints
//! one line of a table for each method, input and noise.

#[path = "../tests/segregation_support/mod.rs"]
mod support;

use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::input::{Geometry, ReadSettings, read_shape};
use medial_scaffold::segregation::{SegregationSettings, segregate_cloud};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["dump", folder, ref rest @ ..] => dump(Path::new(folder), rest),
        ["judge", folder] => judge(Path::new(folder)),
        _ => Err("usage: reconstruction_race dump FOLDER [N [NOISE,... [SEEDS]]] | judge FOLDER".into()),
    }
}

fn dump(folder: &Path, rest: &[&str]) -> Result<(), Failure> {
    let n: usize = rest.first().map_or(Ok(3000), |s| s.parse())?;
    let noises: Vec<f64> = rest
        .get(1)
        .unwrap_or(&"0,0.1,0.25,0.5")
        .split(',')
        .map(str::parse)
        .collect::<Result<_, _>>()?;
    let seeds: u64 = rest.get(2).map_or(Ok(1), |s| s.parse())?;
    std::fs::create_dir_all(folder)?;
    for (name, truth) in support::all_shapes() {
        let spacing = (truth.area() / n as f64).sqrt();
        for &noise in &noises {
            for seed in 1..=seeds {
                let points = support::corrupted(&truth, n, noise * spacing, 1.0, 0.0, seed);
                let start = Instant::now();
                let found = segregate_cloud(&points, &SegregationSettings::default())?;
                let seconds = start.elapsed().as_secs_f64();
                let case = folder.join(format!("{name}_{noise}_{seed}"));
                let file = |end: &str| format!("{}.{end}", case.display());
                write_points(&file("raw.xyz"), &points)?;
                write_points(&file("clean.xyz"), &found.triangulation.points)?;
                write_off(&file("truth.off"), &truth)?;
                write_off(
                    &file("ours.raw.off"),
                    &found.segregation.surface(&found.triangulation),
                )?;
                std::fs::write(file("ours.raw.txt"), format!("{seconds}"))?;
                std::fs::write(file("spacing.txt"), format!("{spacing}"))?;
            }
        }
    }
    Ok(())
}

fn write_points(path: &str, points: &[glam::DVec3]) -> Result<(), Failure> {
    let mut text = String::new();
    for p in points {
        writeln!(text, "{} {} {}", p.x, p.y, p.z)?;
    }
    Ok(std::fs::write(path, text)?)
}

fn write_off(path: &str, mesh: &TriangleMesh) -> Result<(), Failure> {
    let mut text = format!("OFF\n{} {} 0\n", mesh.points.len(), mesh.triangles.len());
    for p in &mesh.points {
        writeln!(text, "{} {} {}", p.x, p.y, p.z)?;
    }
    for [a, b, c] in &mesh.triangles {
        writeln!(text, "3 {a} {b} {c}")?;
    }
    Ok(std::fs::write(path, text)?)
}

fn read_off(path: &Path) -> Result<TriangleMesh, Failure> {
    match read_shape(path, &ReadSettings::default())?.geometry {
        Geometry::Mesh(mesh) => Ok(mesh),
        _ => Err(format!("{}: no mesh", path.display()).into()),
    }
}

/// What one method made of one kind of input at one noise level.
#[derive(Default)]
struct Line {
    runs: usize,
    right: usize,
    near: usize,
    hausdorff: Vec<f64>,
    volume: Vec<f64>,
    seconds: Vec<f64>,
}

fn judge(folder: &Path) -> Result<(), Failure> {
    let mut lines: BTreeMap<(String, String), Line> = BTreeMap::new();
    let mut files: Vec<_> = std::fs::read_dir(folder)?
        .filter_map(|e| Some(e.ok()?.path()))
        .collect();
    files.sort();
    for path in files {
        let file = path.file_name().and_then(|f| f.to_str()).unwrap_or_default();
        let Some(stem) = file.strip_suffix(".off") else {
            continue;
        };
        // CASE.METHOD.INPUT, where CASE is SHAPE_NOISE_SEED and NOISE may hold a point.
        let parts: Vec<&str> = stem.rsplitn(3, '.').collect();
        let [input, method, case] = parts[..] else {
            continue;
        };
        if method == "truth" || stem.ends_with(".truth") {
            continue;
        }
        let noise = case.rsplit('_').nth(1).unwrap_or("?").to_owned();
        let beside = |end: &str| folder.join(format!("{case}.{end}"));
        let spacing: f64 = std::fs::read_to_string(beside("spacing.txt"))?.trim().parse()?;
        let truth = read_off(&beside("truth.off"))?;
        let line = lines.entry((noise, format!("{method} {input}"))).or_default();
        line.runs += 1;
        if let Ok(s) = std::fs::read_to_string(beside(&format!("{method}.{input}.txt"))) {
            line.seconds.push(s.trim().parse()?);
        }
        let mesh = read_off(&path).unwrap_or_default();
        if mesh.triangles.is_empty() {
            continue;
        }
        let used: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        let v = support::judge(&mesh.submesh(&used), &truth, spacing);
        line.right += usize::from(v.right);
        line.near += usize::from(v.right && v.hausdorff <= 2.0);
        line.hausdorff.push(v.hausdorff);
        if v.volume_error.is_finite() {
            line.volume.push(v.volume_error.abs());
        }
    }
    println!(
        "| noise | method, input | right | right and near | runs | Hausdorff median, largest | volume error % median (closed ones) | s median |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for ((noise, method), line) in &mut lines {
        println!(
            "| {noise} | {method} | {} | {} | {} | {:.2}, {:.2} | {} | {:.2} |",
            line.right,
            line.near,
            line.runs,
            median(&mut line.hausdorff),
            line.hausdorff.last().copied().unwrap_or(f64::NAN),
            match line.volume.len() {
                0 => "all open".to_owned(),
                n => format!("{:.2} ({n})", median(&mut line.volume)),
            },
            median(&mut line.seconds),
        );
    }
    Ok(())
}

/// Sorts and takes the middle.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
