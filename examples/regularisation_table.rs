//! Tables of the regularisation: counts on analytic shapes, stability on real bones, cost models.
//!
//! ```text
//! cargo run --release --example regularisation_table -- analytic [names...]
//! cargo run --release --example regularisation_table -- bones [points [first words of variants...]]
//! cargo run --release --example regularisation_table -- speed [points]
//! cargo run --release --example regularisation_table -- corners [points]
//! cargo run --release --example regularisation_table -- draw SHAPE_OR_FILE points tolerance picture.png
//! cargo run --release --example regularisation_table -- list SHAPE_OR_FILE points seed
//! cargo run --release --example regularisation_table -- pairs FILE points
//! ```
//! Real shapes are looked for in `../shared/data` (or `MEDIAL_DATA`).

mod support;

use glam::DVec3;
use medial_scaffold::coarse_scaffold::{CoarseScaffold, CurveKind, NodeKind};
use medial_scaffold::geometry::{Length, TriangleMesh};
use medial_scaffold::regularise::RegulariseSettings;
use std::error::Error;
use std::path::Path;
use support::bones::bones;
use support::run::{analytic, mesh_of, read_mesh, run, sample};
use support::stability::{axial, distance_along};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let word = |i: usize| arguments.get(i).map(String::as_str);
    match word(0) {
        Some("analytic") => analytic_table(&arguments[1..]),
        Some("bones") => support::bones::table(
            word(1).unwrap_or("20000").parse()?,
            &arguments[2.min(arguments.len())..],
        ),
        Some("speed") => speed_table(word(1).unwrap_or("100000").parse()?),
        Some("corners") => corner_table(word(1).unwrap_or("10000").parse()?),
        Some("draw") if arguments.len() == 5 => draw(&arguments[1..]),
        Some("list") if arguments.len() == 4 => list(&arguments[1..]),
        Some("pairs") if arguments.len() == 3 => pairs(&arguments[1..]),
        _ => Err(
            "say analytic, bones, speed, corners, draw SHAPE points tolerance picture.png, or list SHAPE points seed"
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
fn analytic_table(names: &[String]) -> Result<(), Box<dyn Error>> {
    println!(
        "| shape | tolerance, % of diagonal | points | seed | sheets | axial | ribs | wires | nodes | Betti = solid's | fidelity / tolerance |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for (name, seeds, percent) in [
        ("box", 5, 1.0),
        ("prism", 5, 1.0),
        ("l", 2, 1.0),
        ("slab", 2, 0.5),
        ("slab", 2, 1.0),
        ("slab", 2, 1.5),
        ("ellipsoid", 2, 1.0),
        ("torus", 2, 1.0),
        ("y", 2, 1.0),
        ("hollow", 2, 1.0),
        ("dumbbell", 2, 1.0),
        ("genus5", 1, 1.0),
    ] {
        if !names.is_empty() && !names.iter().any(|n| n == name) {
            continue;
        }
        let shape = analytic(name).ok_or("no such shape")?;
        let mesh = mesh_of(&shape, 40_000);
        for n in [5_000, 10_000, 20_000] {
            for seed in 1..=seeds {
                let points = shape.sample_poisson(n, seed).points;
                let r = run(&points, &mesh, &settings(Length::PercentDiagonal(percent)))?;
                let truth = shape.truth.solid_betti.map(|b| b.map(i64::from));
                println!(
                    "| {name} | {percent} | {n} | {seed} | {} | {} | {} | {} | {} | {} | {:.2} |",
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

/// Where the ribs of bones are cut at corners, in two samplings of each.
fn corner_table(n: usize) -> Result<(), Box<dyn Error>> {
    println!("| shape | cuts with seed 1 | with seed 2 | of them at one place |");
    println!("|---|---|---|---|");
    for file in bones() {
        let mesh = read_mesh(&file)?;
        let one = settings(Length::PercentDiagonal(1.0));
        let [first, second] = [1, 2].map(|seed| run(&sample(&mesh, n, seed), &mesh, &one));
        let (first, second) = (first?.coarse, second?.coarse);
        let near = 5.0 * first.tolerance_mm;
        let corners = |s: &CoarseScaffold| -> Vec<DVec3> {
            let own = s.nodes.iter().filter(|n| n.kind == NodeKind::Corner);
            own.map(|n| n.position).collect()
        };
        let (a, b) = (corners(&first), corners(&second));
        let both = a.iter().filter(|p| b.iter().any(|q| p.distance(*q) < near));
        println!(
            "| {} | {} | {} | {} |",
            file.file_stem().unwrap_or_default().to_string_lossy(),
            a.len(),
            b.len(),
            both.count()
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
