//! Prints how often a surface comes out right from raw clouds, and how near: shapes x noise levels x seeds.
//!
//! ```text
//! cargo run --release --example segregation_table -- --n 10000 --seeds 3 --noise 0,0.05,0.1,0.25,0.5,0.75
//!     [--shapes torus,bunny] [--density 20] [--outliers 0.05] [--verbose] [--rows] [--no-second]
//! ```
//! "Right": closed, no open or non-manifold edge or vertex, the true Euler number and number of components. Distances are
//! in mean spacings `sqrt(area / n)` against the true mesh, both ways. Real shapes are read from `../shared/data` (or
//! `MEDIAL_DATA`) when they are there.

#[path = "../tests/segregation_support/mod.rs"]
mod support;

use medial_scaffold::geometry::{ClosestOnMesh, TriangleMesh};
use medial_scaffold::segregation::{ClosedOrOpen, CloudSegregation, SegregationSettings, segregate_cloud};
use std::time::Instant;
use support::{corrupted, data_shape, shapes};

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
    off: f64,
    open_edges: usize,
    bad: usize,
    noise: f64,
    seconds: f64,
}

fn main() {
    let options = parse();
    println!(
        "n {} seeds {} density 1:{} outliers {}",
        options.n, options.seeds, options.density, options.outliers
    );
    println!(
        "noise  right right+near runs | hausdorff med p95 max | mean | vol % med max | off % max | open bad | noise read min max | flagged wrong, flagged right | s med"
    );
    let truths: Vec<(String, TriangleMesh)> = shapes()
        .into_iter()
        .chain(
            [
                ("fandisk", "generic_mixed_localonly/fandisk.off"),
                ("bunny", "generic_mixed_localonly/bunny.off"),
                ("rocker", "generic_mixed_localonly/rocker-arm.obj"),
                ("hand", "generic_mixed_localonly/hand.off"),
                (
                    "calcaneus",
                    "tarsal_visiblehuman_ccby4/VHF_Right/VHF_Right_Bone_Calcaneous_smooth.stl",
                ),
                ("capitate", "carpal_myosim_apache2/frameB/capitate.stl"),
            ]
            .into_iter()
            .filter_map(|(name, path)| Some((name.to_owned(), data_shape(path)?))),
        )
        .filter(|(name, _)| options.shapes.is_empty() || options.shapes.contains(name))
        .collect();
    for &noise in &options.noise {
        let mut rows = Vec::new();
        for (name, truth) in &truths {
            for seed in options.first_seed..options.first_seed + options.seeds {
                let row = run(name, truth, noise, seed, &options);
                rows.push(row);
            }
        }
        summary(noise, &rows);
    }
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
            "  {name} seed {seed} noise {noise}: {} euler {} comps {} H {:.2} mean {:.3} vol {:+.3} % off {:.3} % unsup {:.4} pinched {} flips {} adopted {} dropped {} it {} undone {} read {:.3} out {} kept {} opinions {:?} {:.2} s {}",
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
            c.narrow_handles.iter().map(|h| h.rings).collect::<Vec<_>>(),
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
    let wanted = truth.topology();
    let surface = result.segregation.surface(&result.triangulation);
    let to_truth = ClosestOnMesh::new(truth).expect("the truth has triangles");
    let mut distances: Vec<f64> = surface
        .triangles
        .iter()
        .flat_map(|t| {
            let [a, b, c] = t.map(|i| surface.points[i as usize]);
            [a, (a + b + c) / 3.0, 0.5 * (a + b), 0.5 * (b + c)]
        })
        .map(|p| to_truth.closest(p).distance2.sqrt())
        .collect();
    if let Some(to_surface) = ClosestOnMesh::new(&surface) {
        distances.extend(
            support::sample(truth, 40_000, 99)
                .iter()
                .map(|&p| to_surface.closest(p).distance2.sqrt()),
        );
    }
    let hausdorff = distances.iter().copied().fold(0.0, f64::max) / spacing;
    let mean = distances.iter().sum::<f64>() / distances.len().max(1) as f64 / spacing;
    let volume = truth.signed_volume();
    let right = topology.watertight
        && topology.nonmanifold_vertices == 0
        && topology.euler == wanted.euler
        && topology.components == wanted.components;
    Row {
        right,
        near: hausdorff <= if noise > 0.25 { 3.0 * noise + 2.0 } else { 2.0 },
        flagged: result.report.doubtful(),
        hausdorff,
        mean,
        volume_error: 100.0 * (surface.signed_volume() - volume) / volume,
        off: 100.0 * result.report.closing.off_share,
        open_edges: topology.boundary_edges,
        bad: topology.nonmanifold_edges + topology.nonmanifold_vertices,
        noise: result.report.prepare.noise_over_spacing,
        seconds,
    }
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
    let o = sorted(&|r| r.off);
    let z = sorted(&|r| r.noise);
    let s = sorted(&|r| r.seconds);
    let wrong = |r: &&Row| !(r.right && r.near);
    println!(
        "{noise:5.2} {:5} {:5} {:5} | {:.2} {:.2} {:.2} | {:.3} | {:.2} {:.2} | {:.2} | {} {} | {:.3} {:.3} | {} of {}, {} | {:.2}",
        rows.iter().filter(|r| r.right).count(),
        rows.iter().filter(|r| r.right && r.near).count(),
        rows.len(),
        at(&h, 0.5),
        at(&h, 0.95),
        at(&h, 1.0),
        at(&m, 0.5),
        at(&v, 0.5),
        at(&v, 1.0),
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
