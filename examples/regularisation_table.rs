//! Tables of the regularisation: counts on analytic shapes, stability on real bones, cost models.
//!
//! ```text
//! cargo run --release --example regularisation_table -- analytic
//! cargo run --release --example regularisation_table -- bones [points]
//! cargo run --release --example regularisation_table -- speed [points]
//! cargo run --release --example regularisation_table -- draw SHAPE_OR_FILE points tolerance picture.png
//! cargo run --release --example regularisation_table -- list SHAPE_OR_FILE points seed
//! cargo run --release --example regularisation_table -- pairs FILE points
//! ```
//! Real shapes are looked for in `../shared/data` (or `MEDIAL_DATA`).

mod support;

use glam::DVec3;
use medial_scaffold::coarse_scaffold::{CoarseScaffold, Curve, CurveKind};
use medial_scaffold::geometry::{Length, Neighbours, TriangleMesh};
use medial_scaffold::regularise::{Cost, RegulariseSettings};
use std::error::Error;
use std::path::{Path, PathBuf};
use support::run::{Run, analytic, data, mesh_of, read_mesh, run, sample};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let word = |i: usize| arguments.get(i).map(String::as_str);
    match word(0) {
        Some("analytic") => analytic_table(),
        Some("bones") => bone_table(word(1).unwrap_or("20000").parse()?),
        Some("speed") => speed_table(word(1).unwrap_or("100000").parse()?),
        Some("draw") if arguments.len() == 5 => draw(&arguments[1..]),
        Some("list") if arguments.len() == 4 => list(&arguments[1..]),
        Some("pairs") if arguments.len() == 3 => pairs(&arguments[1..]),
        _ => Err(
            "say analytic, bones, speed, draw SHAPE points tolerance picture.png, or list SHAPE points seed"
                .into(),
        ),
    }
}

fn settings(tolerance: Length) -> RegulariseSettings {
    RegulariseSettings {
        tolerance,
        ..RegulariseSettings::default()
    }
}

/// Counts of analytic shapes at three densities.
fn analytic_table() -> Result<(), Box<dyn Error>> {
    println!(
        "| shape | points | seed | sheets | axial | ribs | wires | nodes | Betti = solid's | fidelity / tolerance |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, seeds) in [
        ("box", 5),
        ("prism", 5),
        ("l", 2),
        ("slab", 2),
        ("ellipsoid", 2),
        ("torus", 2),
        ("y", 2),
        ("hollow", 2),
        ("dumbbell", 2),
        ("genus5", 1),
    ] {
        let shape = analytic(name).ok_or("no such shape")?;
        let mesh = mesh_of(&shape, 40_000);
        for n in [5_000, 10_000, 20_000] {
            for seed in 1..=seeds {
                let points = shape.sample_poisson(n, seed).points;
                let r = run(&points, &mesh, &settings(Length::PercentDiagonal(1.0)))?;
                let truth = shape.truth.solid_betti.map(|b| b.map(i64::from));
                println!(
                    "| {name} | {n} | {seed} | {} | {} | {} | {} | {} | {} | {:.2} |",
                    r.coarse.sheets.len(),
                    r.count(CurveKind::Axial),
                    r.count(CurveKind::Rib),
                    r.count(CurveKind::Wire),
                    r.coarse.nodes.len(),
                    r.regularised.betti() == r.solid && Some(r.solid.into()) == truth,
                    r.regularised.fidelity.max_tolerances
                );
            }
        }
    }
    Ok(())
}

/// The real bones: 16 tarsals, 8 carpals, 2 femurs.
fn bones() -> Vec<PathBuf> {
    let Some(root) = data() else { return Vec::new() };
    let mut files: Vec<PathBuf> = [
        "tarsal_visiblehuman_ccby4/VHF_Left",
        "tarsal_visiblehuman_ccby4/VHF_Right",
        "carpal_myosim_apache2/frameA",
        "femur_libhip_mit",
    ]
    .iter()
    .filter_map(|folder| std::fs::read_dir(root.join(folder)).ok())
    .flat_map(|entries| entries.filter_map(|e| e.ok().map(|e| e.path())))
    .filter(|p| p.extension().is_some_and(|e| e == "stl"))
    .filter(|p| !p.to_string_lossy().contains("pisiform"))
    .collect();
    files.sort();
    files
}

/// Means over bones.
#[derive(Default)]
struct Row {
    shapes: usize,
    sheets: f64,
    axial: f64,
    kept: usize,
    found: usize,
    log_ratios: Vec<f64>,
    same_at_gap: usize,
    medial: f64,
    fidelity: Vec<f64>,
    over: usize,
    betti: usize,
}

fn bone_table(n: usize) -> Result<(), Box<dyn Error>> {
    let one = Length::PercentDiagonal(1.0);
    type Variant = (&'static str, usize, u64, RegulariseSettings);
    let count = RegulariseSettings {
        cost: Cost::Count,
        ..settings(one)
    };
    let variants: Vec<(Variant, Variant)> = vec![
        (("re-sampled", n, 1, settings(one)), ("", n, 2, settings(one))),
        (
            ("4 x density", n, 1, settings(one)),
            ("", 4 * n, 3, settings(one)),
        ),
        (
            ("count, re-sampled", n, 1, count.clone()),
            ("", n, 2, count.clone()),
        ),
        (("count, 4 x density", n, 1, count.clone()), ("", 4 * n, 3, count)),
    ];
    let only = std::env::var("ONLY").ok();
    println!(
        "| variant | shapes | sheets change | axial change | curves re-found | persistence change | same at gap | medial distance %D | fidelity median / max (tau) | Betti = surface's |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (base, other) in variants {
        if only.as_ref().is_some_and(|o| !base.0.starts_with(o.as_str())) {
            continue;
        }
        let mut row = Row::default();
        for file in bones() {
            let mesh = read_mesh(&file)?;
            let a = run(&sample(&mesh, base.1, base.2), &mesh, &base.3)?;
            let b = run(&sample(&mesh, other.1, other.2), &mesh, &other.3)?;
            compare(&mut row, &a, &b);
            if std::env::var("MEDIAL_VERBOSE").is_ok() {
                eprintln!(
                    "{:50} sheets {:2} {:2} axial {:2} {:2} fidelity {:.2} {:.2}",
                    file.file_name().unwrap_or_default().to_string_lossy(),
                    a.coarse.sheets.len(),
                    b.coarse.sheets.len(),
                    a.count(CurveKind::Axial),
                    b.count(CurveKind::Axial),
                    a.regularised.fidelity.max_tolerances,
                    b.regularised.fidelity.max_tolerances,
                );
            }
        }
        row.print(base.0);
    }
    Ok(())
}

fn compare(row: &mut Row, a: &Run, b: &Run) {
    let d = a.coarse.diagonal_mm;
    row.shapes += 1;
    let change = |x: usize, y: usize| x.abs_diff(y) as f64 / x.max(1) as f64;
    row.sheets += change(a.coarse.sheets.len(), b.coarse.sheets.len());
    row.axial += change(a.count(CurveKind::Axial), b.count(CurveKind::Axial));
    let cut = 1.5 * a.coarse.tolerance_mm;
    for curve in axial(&a.coarse).filter(|c| c.persistence >= cut) {
        row.kept += 1;
        if let Some(ratio) = found_again(curve, &b.coarse, 0.06 * d) {
            row.found += 1;
            row.log_ratios.push(ratio);
        }
    }
    let gap = shared_gap(&a.coarse);
    let above = |s: &CoarseScaffold| axial(s).filter(|c| c.persistence >= gap).count();
    row.same_at_gap += usize::from(above(&a.coarse) == above(&b.coarse));
    row.medial +=
        0.5 * (medial_distance(&a.coarse, &b.coarse) + medial_distance(&b.coarse, &a.coarse)) / d * 100.0;
    for r in [a, b] {
        row.fidelity.push(r.regularised.fidelity.max_tolerances);
        row.over += usize::from(r.regularised.fidelity.max_tolerances > 1.0);
        row.betti += usize::from(r.regularised.betti() == r.solid && r.known.is_none_or(|k| k == r.solid));
    }
}

fn axial(s: &CoarseScaffold) -> impl Iterator<Item = &Curve> {
    s.curves.iter().filter(|c| c.kind == CurveKind::Axial)
}

/// Least change of persistence (absolute logarithm) among the axial curves in the same place, when below 0.35.
fn found_again(curve: &Curve, other: &CoarseScaffold, near: f64) -> Option<f64> {
    axial(other)
        .filter(|c| distance_along(curve, c) <= near)
        .map(|c| (c.persistence / curve.persistence).ln().abs())
        .filter(|r| *r < 0.35)
        .min_by(f64::total_cmp)
}

/// The middle of the widest gap of the persistences between one tolerance and 1.8.
fn shared_gap(s: &CoarseScaffold) -> f64 {
    let (lo, hi) = (s.tolerance_mm, 1.8 * s.tolerance_mm);
    let mut p: Vec<f64> = axial(s)
        .map(|c| c.persistence)
        .filter(|p| (lo..hi).contains(p))
        .collect();
    p.extend([lo, hi]);
    p.sort_by(f64::total_cmp);
    p.windows(2)
        .max_by(|a, b| (a[1] / a[0]).total_cmp(&(b[1] / b[0])))
        .map_or(lo, |w| (w[0] * w[1]).sqrt())
}

/// Mean distance from the medial points of one scaffold to those of another, mm.
fn medial_distance(a: &CoarseScaffold, b: &CoarseScaffold) -> f64 {
    let surface = |s: &CoarseScaffold| {
        let mut mesh = TriangleMesh::default();
        for sheet in &s.sheets {
            let base = mesh.points.len() as u32;
            mesh.points.extend(sheet.mesh.vertices.iter().map(|v| v.position));
            mesh.triangles
                .extend(sheet.mesh.triangles.iter().map(|t| t.map(|i| i + base)));
        }
        mesh
    };
    let (from, to) = (surface(a), surface(b));
    let Some(to) = medial_scaffold::geometry::closest::ClosestOnMesh::new(&to) else {
        return f64::NAN;
    };
    let mut weight = vec![0.0; from.points.len()];
    for t in &from.triangles {
        let [p, q, r] = t.map(|i| from.points[i as usize]);
        let area = 0.5 * (q - p).cross(r - p).length();
        for &i in t {
            weight[i as usize] += area;
        }
    }
    let total: f64 = weight.iter().sum();
    let found = to.closest_many(&from.points);
    let sum: f64 = from
        .points
        .iter()
        .zip(&found)
        .zip(&weight)
        .map(|((p, c), w)| w * p.distance(c.point))
        .sum();
    sum / total
}

impl Row {
    fn print(mut self, name: &str) {
        let n = self.shapes.max(1) as f64;
        self.log_ratios.sort_by(f64::total_cmp);
        self.fidelity.sort_by(f64::total_cmp);
        println!(
            "| {name} | {} | {:.1} % | {:.1} % | {}/{} = {:.1} % | {:.1} % | {:.0} % | {:.2} | {:.2} / {:.2} | {}/{} |",
            self.shapes,
            100.0 * self.sheets / n,
            100.0 * self.axial / n,
            self.found,
            self.kept,
            100.0 * self.found as f64 / self.kept.max(1) as f64,
            100.0
                * self
                    .log_ratios
                    .get(self.log_ratios.len() / 2)
                    .copied()
                    .unwrap_or(0.0),
            100.0 * self.same_at_gap as f64 / n,
            self.medial / n,
            self.fidelity.get(self.fidelity.len() / 2).copied().unwrap_or(0.0),
            self.fidelity.last().copied().unwrap_or(0.0),
            self.betti,
            2 * self.shapes
        );
    }
}

/// Seconds of each stage.
fn speed_table(n: usize) -> Result<(), Box<dyn Error>> {
    println!("| shape | points | segregate | fine scaffold | regularise | coarse scaffold |");
    println!("|---|---|---|---|---|---|");
    for file in bones().into_iter().take(3) {
        let mesh = read_mesh(&file)?;
        let r = run(
            &sample(&mesh, n, 1),
            &mesh,
            &settings(Length::PercentDiagonal(1.0)),
        )?;
        println!(
            "| {} | {n} | {:.2} | {:.2} | {:.2} | {:.2} |",
            file.file_stem().unwrap_or_default().to_string_lossy(),
            r.seconds_segregate,
            r.seconds_fine,
            r.seconds_regularise,
            r.seconds_coarse
        );
    }
    Ok(())
}

/// A synthetic shape by name or a mesh by file, with points on it.
fn shape_or_file(word: &str, n: usize, seed: u64) -> Result<(TriangleMesh, Vec<DVec3>), Box<dyn Error>> {
    Ok(match analytic(word) {
        Some(shape) => (mesh_of(&shape, 40_000), shape.sample_poisson(n, seed).points),
        None => {
            let mesh = read_mesh(Path::new(word))?;
            let points = sample(&mesh, n, seed);
            (mesh, points)
        }
    })
}

/// Every element of one scaffold at 1 % of the diagonal, lengths in tolerances.
fn list(words: &[String]) -> Result<(), Box<dyn Error>> {
    let (mesh, points) = shape_or_file(&words[0], words[1].parse()?, words[2].parse()?)?;
    let r = run(&points, &mesh, &settings(Length::PercentDiagonal(1.0)))?;
    let tau = r.coarse.tolerance_mm;
    for s in &r.coarse.sheets {
        println!(
            "sheet {:2} persistence {:6.2} area {:8.2} radius {:6.2} at {:.2} boundary {:?}",
            s.id.0,
            s.persistence / tau,
            s.area / tau / tau,
            s.max_radius / tau,
            s.moments.centroid / tau,
            s.boundary
                .iter()
                .map(|b| b.iter().map(|c| c.0).collect::<Vec<_>>())
                .collect::<Vec<_>>()
        );
    }
    for c in &r.coarse.curves {
        println!(
            "curve {:2} {:5} persistence {:6.2} length {:6.2} nodes {:?} sheets {:?} radius {:.2} to {:.2} at {:.1}",
            c.id.0,
            format!("{:?}", c.kind),
            c.persistence / tau,
            c.length / tau,
            c.nodes.iter().map(|n| n.0).collect::<Vec<_>>(),
            c.sheets.iter().map(|s| s.0).collect::<Vec<_>>(),
            c.polyline.first().map_or(0.0, |p| p.radius) / tau,
            c.polyline.last().map_or(0.0, |p| p.radius) / tau,
            c.polyline
                .get(c.polyline.len() / 2)
                .map_or(DVec3::ZERO, |p| p.position)
                / tau,
        );
    }
    for t in r.regularised.history.iter().filter(|t| t.cost_mm > 0.5 * tau) {
        println!(
            "{:?} cost {:.2} applied {} at {:.1}",
            t.kind,
            t.cost_mm / tau,
            t.applied,
            t.position / tau
        );
    }
    for t in &r.coarse.transforms {
        println!("{:?} cost {:.2} applied {}", t.kind, t.cost_mm / tau, t.applied);
    }
    println!(
        "fidelity {:.2} spacing {:.2}",
        r.regularised.fidelity.max_tolerances,
        r.fine.scale.spacing_mm / tau
    );
    Ok(())
}

/// The axial curves of two samplings of one shape that have no counterpart in the other, and how the others differ.
fn pairs(words: &[String]) -> Result<(), Box<dyn Error>> {
    let n: usize = words[1].parse()?;
    let mesh = read_mesh(Path::new(&words[0]))?;
    let one = settings(Length::PercentDiagonal(1.0));
    let a = run(&sample(&mesh, n, 1), &mesh, &one)?;
    let b = run(&sample(&mesh, n, 2), &mesh, &one)?;
    let tau = a.coarse.tolerance_mm;
    for (name, from, to) in [("first", &a, &b), ("second", &b, &a)] {
        for c in axial(&from.coarse) {
            let far = axial(&to.coarse)
                .map(|d| distance_along(c, d) / tau)
                .fold(f64::INFINITY, f64::min);
            println!(
                "{name} curve {:2} persistence {:5.2} length {:6.2} sheets {:?} nodes {:?} radius {:.1} to {:.1}: nearest {far:.2}{}",
                c.id.0,
                c.persistence / tau,
                c.length / tau,
                c.sheets.iter().map(|s| s.0).collect::<Vec<_>>(),
                c.nodes.iter().map(|n| n.0).collect::<Vec<_>>(),
                c.polyline.first().map_or(0.0, |p| p.radius) / tau,
                c.polyline.last().map_or(0.0, |p| p.radius) / tau,
                if far > 1.5 { "  <-- only here" } else { "" }
            );
        }
        for e in from.regularised.history.iter().chain(&from.coarse.transforms) {
            if !e.applied {
                println!(
                    "   refused {:?} at cost {:.2} {:.1}",
                    e.kind,
                    e.cost_mm / tau,
                    e.position / tau
                );
            }
        }
    }
    Ok(())
}

/// Mean distance from the points of a curve to those of another.
fn distance_along(curve: &Curve, other: &Curve) -> f64 {
    let there = Neighbours::new(&other.polyline.iter().map(|p| p.position).collect::<Vec<_>>());
    let sum: f64 = curve
        .polyline
        .iter()
        .filter_map(|p| there.nearest(p.position).map(|n| n.distance2.sqrt()))
        .sum();
    sum / curve.polyline.len() as f64
}

fn draw(words: &[String]) -> Result<(), Box<dyn Error>> {
    let (mesh, points) = shape_or_file(&words[0], words[1].parse()?, 1)?;
    let r = run(&points, &mesh, &settings(words[2].parse()?))?;
    let bounds = mesh.bounds().ok_or("an empty mesh")?;
    let size = bounds[1] - bounds[0];
    // Seen a little from the side, the longest axis upright.
    let (out, up) = if size.z >= size.x && size.z >= size.y {
        (DVec3::new(1.0, 0.6, 0.35), DVec3::Z)
    } else if size.y >= size.x {
        (DVec3::new(0.6, 0.35, 1.0), DVec3::Y)
    } else {
        (DVec3::new(0.35, 0.6, 1.0), DVec3::X)
    };
    let mut picture = support::picture::Picture::new(1600, 1600, bounds, out, up);
    picture.scaffold(&r.coarse);
    picture.write_png(Path::new(&words[3]))?;
    Ok(())
}
