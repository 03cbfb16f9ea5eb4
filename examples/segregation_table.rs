//! Prints how often a surface comes out right from raw clouds, and how near: shapes x noise levels x seeds.
//!
//! ```text
//! cargo run --release --example segregation_table -- --n 10000 --seeds 3 --noise 0,0.05,0.1,0.25,0.5,0.75
//!     [--shapes torus,bunny] [--density 20] [--outliers 0.05] [--verbose] [--rows] [--no-second] [--no-retry] [--closed] [--time]
//! cargo run --release --example segregation_table -- --n 10000 --all-meshes [--verbose]
//! cargo run --release --example segregation_table -- --n 4000 --seeds 2 --holes 0,0.04,0.06,0.1 [--noise 0,0.1]
//! ```
//! "Right": closed, no open or non-manifold edge or vertex, the true Euler number and number of components. Distances are
//! in mean spacings `sqrt(area / n)` against the true mesh, both ways. `--time` prints every run's processor seconds (all
//! threads, sampling and judging left out) instead of judging it. Real shapes are read from `../shared/data` (or
//! `MEDIAL_DATA`) when they are there.

#[path = "../tests/segregation_support/mod.rs"]
mod support;

use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::segregation::{
    ClosedOrOpen, CloudSegregation, Denoise, SegregationSettings, segregate_cloud,
};
use std::time::Instant;
use support::{all_shapes, corrupted};

struct Options {
    n: usize,
    seeds: u64,
    first_seed: u64,
    noise: Vec<f64>,
    shapes: Vec<String>,
    density: f64,
    outliers: f64,
    verbose: bool,
    rows: bool,
    time: bool,
    holes: Vec<f64>,
    settings: SegregationSettings,
}

/// One run against the truth.
struct Row {
    right: bool,
    near: bool,
    flagged: bool,
    hausdorff: f64,
    mean: f64,
    volume_error: f64,
    inscription_error: f64,
    off: f64,
    open_edges: usize,
    bad: usize,
    noise: f64,
    seconds: f64,
}

fn main() {
    let options = parse();
    if std::env::args().any(|a| a == "--all-meshes") {
        return all_meshes(&options);
    }
    if std::env::args().any(|a| a == "--holes") {
        return holes(&options);
    }
    println!(
        "n {} seeds {} density 1:{} outliers {}",
        options.n, options.seeds, options.density, options.outliers
    );
    if !options.time {
        println!(
            "noise  right right+near runs | hausdorff med p95 max | mean | vol % med max | signed, inscribed med | off % max | open bad | noise read min max | flagged wrong, flagged right | s med"
        );
    }
    let truths: Vec<(String, TriangleMesh)> = all_shapes()
        .into_iter()
        .filter(|(name, _)| options.shapes.is_empty() || options.shapes.contains(name))
        .collect();
    for &noise in &options.noise {
        let mut rows = Vec::new();
        for (name, truth) in &truths {
            for seed in options.first_seed..options.first_seed + options.seeds {
                if options.time {
                    time(name, truth, noise, seed, &options);
                    continue;
                }
                let row = run(name, truth, noise, seed, &options);
                rows.push(row);
            }
        }
        if !options.time {
            summary(noise, &rows);
        }
    }
}

/// Processor seconds of this process so far, all threads, to a hundredth; 0 on systems without `/proc`.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}

fn time(name: &str, truth: &TriangleMesh, noise: f64, seed: u64, options: &Options) {
    let spacing = (truth.area() / options.n as f64).sqrt();
    let points = corrupted(
        truth,
        options.n,
        noise * spacing,
        options.density,
        options.outliers,
        seed,
    );
    let (wall, before) = (Instant::now(), processor_seconds());
    let result = segregate_cloud(&points, &options.settings).expect("a finite cloud");
    println!(
        "{name} {} points noise {noise} seed {seed}: {:.2} processor s, {:.2} wall s, Euler {}, {}",
        points.len(),
        processor_seconds() - before,
        wall.elapsed().as_secs_f64(),
        result.report.topology.euler,
        if result.segregation.closed {
            "closed"
        } else {
            "open"
        },
    );
}

fn parse() -> Options {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let value = |key: &str| {
        args.iter()
            .position(|a| a == key)
            .and_then(|i| args.get(i + 1))
            .cloned()
    };
    let list = |key: &str, default: &str| -> Vec<String> {
        value(key)
            .unwrap_or_else(|| default.to_owned())
            .split(',')
            .filter(|s| !s.is_empty())
            .map(str::to_owned)
            .collect()
    };
    let number = |key: &str, default: f64| value(key).and_then(|v| v.parse().ok()).unwrap_or(default);
    let mut settings = SegregationSettings::default();
    if args.iter().any(|a| a == "--no-second") {
        settings.second_opinion_noise = f64::INFINITY;
    }
    if args.iter().any(|a| a == "--no-retry") {
        settings.denoise = Denoise::Always;
    }
    if args.iter().any(|a| a == "--closed") {
        settings.closed = ClosedOrOpen::Closed;
    }
    Options {
        n: number("--n", 10_000.0) as usize,
        seeds: number("--seeds", 1.0) as u64,
        first_seed: number("--first", 1.0) as u64,
        noise: list("--noise", "0,0.05,0.1,0.25,0.5,0.75")
            .iter()
            .filter_map(|s| s.parse().ok())
            .collect(),
        shapes: list("--shapes", ""),
        density: number("--density", 1.0),
        outliers: number("--outliers", 0.0),
        verbose: args.iter().any(|a| a == "--verbose"),
        rows: args.iter().any(|a| a == "--rows"),
        holes: list("--holes", "")
            .iter()
            .filter_map(|s| s.parse().ok())
            .collect(),
        time: args.iter().any(|a| a == "--time"),
        settings,
    }
}

fn run(name: &str, truth: &TriangleMesh, noise: f64, seed: u64, options: &Options) -> Row {
    let spacing = (truth.area() / options.n as f64).sqrt();
    let points = corrupted(
        truth,
        options.n,
        noise * spacing,
        options.density,
        options.outliers,
        seed,
    );
    let start = Instant::now();
    let result = segregate_cloud(&points, &options.settings).expect("a finite cloud");
    let seconds = start.elapsed().as_secs_f64();
    let row = judge(&result, truth, spacing, noise, seconds);
    if options.rows || (options.verbose && !(row.right && row.near)) {
        let r = &result.report;
        println!(
            "  {name} seed {seed} noise {noise}: {} euler {} comps {} H {:.2} mean {:.3} vol {:+.3} % off {:.3} % unsup {:.4} pinched {} flips {} adopted {} dropped {} it {} undone {} read {:.3} out {} kept {} opinions {:?} {:?} {:.2} s {}",
            if row.right { "right" } else { "WRONG" },
            r.topology.euler,
            r.topology.components,
            row.hausdorff,
            row.mean,
            row.volume_error,
            row.off,
            r.decision.unsupported_area_share,
            r.closing.pinched,
            r.closing.flips,
            r.closing.adopted,
            r.closing.dropped,
            r.closing.diffusion_iterations,
            r.closing.greedy_undone,
            r.prepare.noise_over_spacing,
            r.prepare.outliers,
            r.prepare.kept,
            r.second_opinions.iter().map(|o| o.euler).collect::<Vec<_>>(),
            r.prepare.strength,
            seconds,
            r.doubts
                .iter()
                .map(|d| format!("{:?}", d.kind))
                .collect::<Vec<_>>()
                .join(" "),
        );
        let c = &r.self_check;
        println!(
            "      far {} spikes {} farthest {:.2} handles {:?} removed {:?} thin {:.4} thinnest {:.2} patches {:?}",
            c.far_points,
            c.spikes,
            c.farthest_over_spacing,
            c.narrow_handles
                .iter()
                .map(|h| (h.rings, h.place))
                .collect::<Vec<_>>(),
            r.closing
                .handles_removed
                .iter()
                .map(|h| (h.rings, h.filled, h.energy as f32))
                .collect::<Vec<_>>(),
            c.thin_share,
            c.thinnest_over_spacing,
            r.filled_holes
                .iter()
                .take(3)
                .map(|p| (p.triangles, p.area_mm2 / spacing / spacing, p.place))
                .collect::<Vec<_>>(),
        );
    }
    row
}

fn judge(result: &CloudSegregation, truth: &TriangleMesh, spacing: f64, noise: f64, seconds: f64) -> Row {
    let topology = &result.report.topology;
    let surface = result.segregation.surface(&result.triangulation);
    let v = support::judge(&surface, truth, spacing);
    Row {
        right: v.right,
        near: v.hausdorff <= if noise > 0.25 { 3.0 * noise + 2.0 } else { 2.0 },
        flagged: result.report.doubtful(),
        hausdorff: v.hausdorff,
        mean: v.mean,
        volume_error: v.volume_error,
        inscription_error: v.inscription_error,
        off: 100.0 * result.report.closing.off_share,
        open_edges: topology.boundary_edges,
        bad: topology.nonmanifold_edges + topology.nonmanifold_vertices,
        noise: result.report.prepare.noise_over_spacing,
        seconds,
    }
}

/// Closed shapes with a hole of a share of their area: are they called open, and those without closed?
fn holes(options: &Options) {
    println!("hole share, noise: decided right of runs, with one rim, doubted");
    let shapes: Vec<(String, TriangleMesh)> = all_shapes()
        .into_iter()
        .filter(|(name, _)| options.shapes.is_empty() || options.shapes.contains(name))
        .collect();
    for &share in &options.holes {
        for &noise in &options.noise {
            let (mut right, mut one_rim, mut doubted, mut runs) = (0, 0, 0, 0);
            for (name, truth) in &shapes {
                let spacing = (truth.area() * (1.0 - share) / options.n as f64).sqrt();
                for seed in options.first_seed..options.first_seed + options.seeds {
                    let mut points = support::sample_with_hole(truth, options.n, share, seed);
                    support::shake(&mut points, noise * spacing, seed);
                    let result = segregate_cloud(&points, &options.settings).expect("a finite cloud");
                    let good = result.segregation.closed == (share == 0.0);
                    runs += 1;
                    right += usize::from(good);
                    one_rim += usize::from(result.report.rims.len() == 1);
                    doubted += usize::from(result.report.doubtful());
                    if options.verbose && !good || options.rows {
                        println!(
                            "  {name} hole {share} noise {noise} seed {seed}: {}, {} rims {:?}, {}",
                            if good { "right" } else { "WRONG" },
                            result.report.rims.len(),
                            result.report.rims.iter().map(|r| r.edges).collect::<Vec<_>>(),
                            result.report.decision.reason
                        );
                    }
                }
            }
            println!("{share:5.3} {noise:5.2}: {right} of {runs}, {one_rim}, {doubted}");
        }
    }
}

/// Every closed mesh of the data folder, one component at a time (the largest), re-sampled at random without noise.
fn all_meshes(options: &Options) {
    let Some(root) = support::data() else {
        println!("skipped: no folder of real shapes (set MEDIAL_DATA)");
        return;
    };
    let mut files = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            match path.extension().and_then(|e| e.to_str()) {
                _ if path.is_dir() => folders.push(path),
                Some("stl" | "ply" | "off" | "obj" | "mesh") => files.push(path),
                _ => {}
            }
        }
    }
    files.sort();
    let (mut right, mut flagged, mut runs) = (0, 0, 0);
    for path in files {
        use medial_scaffold::input::{Geometry, ReadSettings, read_shape};
        let Ok(shape) = read_shape(&path, &ReadSettings::default()) else {
            continue;
        };
        let Geometry::Mesh(mesh) = shape.geometry else {
            continue;
        };
        let parts = mesh.components();
        let Some(largest) = parts.iter().max_by_key(|c| c.len()) else {
            continue;
        };
        let truth = mesh.submesh(largest);
        let wanted = truth.topology();
        let name = path.strip_prefix(&root).unwrap_or(&path).display().to_string();
        if !(wanted.watertight && wanted.oriented && wanted.nonmanifold_vertices == 0) {
            println!("  {name}: not a closed manifold, left out");
            continue;
        }
        let row = run(&name, &truth, 0.0, options.first_seed, options);
        right += usize::from(row.right);
        flagged += usize::from(!row.right && row.flagged);
        runs += 1;
        println!(
            "{name}: true Euler {} {} H {:.2} volume {:+.3} %{}",
            wanted.euler,
            if row.right { "right" } else { "WRONG" },
            row.hausdorff,
            row.volume_error,
            if row.flagged { " doubted" } else { "" }
        );
    }
    println!(
        "{right} of {runs} right; {flagged} of {} wrong ones say so",
        runs - right
    );
}

fn summary(noise: f64, rows: &[Row]) {
    let sorted = |f: &dyn Fn(&Row) -> f64| {
        let mut v: Vec<f64> = rows.iter().map(f).collect();
        v.sort_by(f64::total_cmp);
        v
    };
    let at = |v: &[f64], share: f64| {
        v.get(((v.len() as f64 * share) as usize).min(v.len().saturating_sub(1)))
            .copied()
            .unwrap_or(0.0)
    };
    let h = sorted(&|r| r.hausdorff);
    let m = sorted(&|r| r.mean);
    let v = sorted(&|r| r.volume_error.abs());
    let w = sorted(&|r| r.volume_error);
    let i = sorted(&|r| r.inscription_error);
    let o = sorted(&|r| r.off);
    let z = sorted(&|r| r.noise);
    let s = sorted(&|r| r.seconds);
    let wrong = |r: &&Row| !(r.right && r.near);
    println!(
        "{noise:5.2} {:5} {:5} {:5} | {:.2} {:.2} {:.2} | {:.3} | {:.2} {:.2} | {:+.2} {:+.2} | {:.2} | {} {} | {:.3} {:.3} | {} of {}, {} | {:.2}",
        rows.iter().filter(|r| r.right).count(),
        rows.iter().filter(|r| r.right && r.near).count(),
        rows.len(),
        at(&h, 0.5),
        at(&h, 0.95),
        at(&h, 1.0),
        at(&m, 0.5),
        at(&v, 0.5),
        at(&v, 1.0),
        at(&w, 0.5),
        at(&i, 0.5),
        at(&o, 1.0),
        rows.iter().map(|r| r.open_edges).sum::<usize>(),
        rows.iter().map(|r| r.bad).sum::<usize>(),
        at(&z, 0.0),
        at(&z, 1.0),
        rows.iter().filter(wrong).filter(|r| r.flagged).count(),
        rows.iter().filter(wrong).count(),
        rows.iter().filter(|r| !wrong(r) && r.flagged).count(),
        at(&s, 0.5),
    );
}
