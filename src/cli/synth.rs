//! `medial synth`: synthetic shapes, populations and deformations with everything exact in truth.json.

use super::common::Common;
use super::output::print_text;
use super::progress::Progress;
use super::{Failure, Verdict};
use clap::Args;
use datasets_synthetic::dataset::{DatasetSettings, generate};
use datasets_synthetic::registry::ShapeKind;
use glam::DVec3;
use std::path::PathBuf;

/// Arguments of `medial synth`.
#[derive(Debug, Args)]
pub struct SynthArgs {
    /// What to make; `list` names every kind.
    kind: String,

    /// Output directory.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,

    /// Triangles of a mesh, about.
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    triangles: usize,

    /// Points of a cloud.
    #[arg(long, value_name = "N", default_value_t = 5_000)]
    points: usize,

    /// Independent random points instead of blue noise.
    #[arg(long)]
    random: bool,

    /// Noise on clouds, in units of their spacing.
    #[arg(long, value_name = "SPACINGS", default_value_t = 0.0)]
    noise: f64,

    /// Outliers on clouds, as a share of the points.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    outliers: f64,

    /// Individuals of a population.
    #[arg(long, value_name = "N", default_value_t = 5)]
    individuals: usize,

    /// Voxel size of masks, mm: one number, or three for x, y, z.
    #[arg(long, value_name = "MM", num_args = 1..=3, default_values_t = [0.5])]
    voxel: Vec<f64>,
}

/// Runs the command.
pub fn run(args: &SynthArgs, common: &Common) -> Result<Verdict, Failure> {
    if args.kind == "list" {
        let lines = ShapeKind::list()
            .into_iter()
            .map(|kind| format!("{kind:<24} {}\n", kind.description()));
        print_text(&lines.collect::<String>())?;
        return Ok(Verdict::Fine);
    }
    let kind: ShapeKind = args.kind.parse()?;
    let Some(dir) = &args.output else {
        return Err(Failure::usage(
            "nowhere to put the shapes; give an output directory with -o DIR",
        ));
    };
    let voxel_mm = match args.voxel.as_slice() {
        [x, y, z] => DVec3::new(*x, *y, *z),
        [one] => DVec3::splat(*one),
        _ => return Err(Failure::usage("--voxel takes one number or three")),
    };
    let settings = DatasetSettings {
        seed: common.seed,
        triangles: args.triangles,
        points: args.points,
        poisson: !args.random,
        noise_spacings: args.noise,
        outliers: args.outliers,
        individuals: args.individuals,
        voxel_mm,
    };
    let progress = Progress::new(common.quiet);
    progress.stage(&args.kind);
    let made = generate(kind, &settings)?;
    let files = made.write(dir)?;
    progress.finish();
    if common.json {
        print_text(&made.truth_json())?;
    } else if !common.quiet {
        print_text(&format!("{} files in {}\n", files.len(), dir.display()))?;
    }
    Ok(Verdict::Fine)
}
