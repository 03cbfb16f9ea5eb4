//! `medial demo`: two carpal-like bones are made, one is put in another pose, and the whole way is run. No input needed.

use super::common::Common;
use super::match_command::{MatchOptions, summary, write_files};
use super::output::{make_dir, print_json, print_text};
use super::progress::Progress;
use super::run_record::RunRecord;
use super::{Failure, Verdict, warn_all};
use clap::Args;
use datasets_synthetic::{bones, population, rigid};
use medial_scaffold::geometry::{Rigid, TriangleMesh};
use medial_scaffold::input::{Geometry, Shape};
use medial_scaffold::pipeline::match_shapes;
use medial_scaffold::reports::{PlyEncoding, write_ply};
use std::path::PathBuf;

/// Triangles of each bone, about.
const TRIANGLES: usize = 10_000;

/// Share of the population's variation between the two bones: left and right of one person differ about so much.
const LIKENESS: f64 = 0.4;

/// Arguments of `medial demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Output directory.
    #[arg(short, long, value_name = "DIR", default_value = "demo")]
    output: PathBuf,
}

/// Runs the command. It says no when the pose found is further than 5 degrees from the one the bone was given.
pub fn run(args: &DemoArgs, common: &Common) -> Result<Verdict, Failure> {
    make_dir(&args.output)?;
    let progress = Progress::new(common.quiet);
    progress.stage("two bones");
    let reference = bones::hamate_like(0);
    let target = mesh(&reference.mesh(TRIANGLES));
    let mut source = mesh(&relative(&reference, common.seed + 1).mesh(TRIANGLES));
    let given = rigid::random(common.seed);
    for p in &mut source.points {
        *p = given.apply(*p);
    }
    write_ply(
        &args.output.join("target.ply"),
        &target,
        &[],
        PlyEncoding::default(),
    )?;
    write_ply(
        &args.output.join("source.ply"),
        &source,
        &[],
        PlyEncoding::default(),
    )?;

    let target = Shape::generated("a hamate-like bone", Geometry::Mesh(target));
    let source = Shape::generated("another individual", Geometry::Mesh(source));
    let settings = MatchOptions::default().settings(common);
    let done = match_shapes(&target, &source, &settings, &|stage| progress.stage(stage))?;
    let mut record = RunRecord::new(common, &settings)?;
    record.stages = done.stages.clone();
    record.warnings = done.warnings.clone();
    progress.stage("files");
    write_files(&args.output, &done, &mut record, common)?;
    progress.finish();
    warn_all(common, &done.warnings);

    let truth = Rigid {
        linear: given.rotation,
        translation: given.translation,
    }
    .inverse();
    let off = done.registration.T_target_source.rotation_angle_deg(&truth);
    if common.json {
        print_json(&done.document())?;
    } else if !common.quiet {
        print_text(&summary(&done))?;
        print_text(&format!(
            "the second bone differs in size, bend and taper and was turned at random: the pose found is {off:.2} degrees from the turn\n\
             open {}\n",
            args.output
                .join(if common.no_report {
                    "match.json"
                } else {
                    "report.html"
                })
                .display()
        ))?;
    }
    Ok(if off < 5.0 { Verdict::Fine } else { Verdict::SaidNo })
}

/// Another individual, at [`LIKENESS`] of the differences of its population.
fn relative(reference: &datasets_synthetic::Shape, seed: u64) -> datasets_synthetic::Shape {
    let modes = population::modes(&reference.bounds());
    let weights: Vec<f64> = population::individual(reference, seed)
        .weights
        .iter()
        .map(|w| LIKENESS * w)
        .collect();
    reference.warped(&population::warp_of(&modes, &weights))
}

fn mesh(made: &datasets_synthetic::TriangleMesh) -> TriangleMesh {
    TriangleMesh {
        points: made.points.clone(),
        triangles: made.triangles.clone(),
    }
}
