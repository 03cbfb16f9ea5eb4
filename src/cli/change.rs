//! `medial change`: how much lesions grew between two dates, where, and whether that is more than the measurement's error.

use super::common::Common;
use super::output::{make_dir, print_json, print_text};
use super::progress::Progress;
use super::run_record::RunRecord;
use super::scaffold::json;
use super::{Failure, Verdict, warn_all};
use clap::{Args, ValueEnum};
use medial_scaffold::change::{Change, ChangeSettings, Pairing};
use medial_scaffold::fine_scaffold::Side;
use medial_scaffold::input::{Geometry, Shape};
use medial_scaffold::pipeline::{ChangeRunSettings, change_of};
use medial_scaffold::registration::{RegistrationSettings, RegistrationShape, register};
use medial_scaffold::reports::{
    change_report, change_scene, glb_bytes, write_bytes, write_growth, write_json, write_tfm,
};
use std::path::{Path, PathBuf};

/// Arguments of `medial change`.
#[derive(Debug, Args)]
pub struct ChangeArgs {
    /// Mask or closed mesh of the first date.
    baseline: PathBuf,

    /// Mask or closed mesh of the second date.
    followup: PathBuf,

    /// Output directory.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,

    /// How lesions of the two dates are paired.
    #[arg(long, value_enum, default_value = "label")]
    pair: PairOption,

    /// Standard deviation of the boundary's position, mm; by default a voxel over the square root of 12.
    #[arg(long, value_name = "MM")]
    boundary_sd: Option<f64>,

    /// Coefficient of variation of the volume under repeated segmentation, 0.05 for 5 %.
    #[arg(long, value_name = "CV")]
    repeat_cv: Option<f64>,

    /// Move the follow-up first, by registering these two closed meshes of a structure that does not grow.
    #[arg(long, num_args = 2, value_names = ["BASELINE", "FOLLOWUP"])]
    align_on: Option<Vec<PathBuf>>,

    /// Move the follow-up mesh onto the baseline first, by the shapes themselves; hides growth that looks like motion.
    #[arg(long, conflicts_with = "align_on")]
    align: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PairOption {
    Label,
    Overlap,
}

/// Runs the command.
pub fn run(args: &ChangeArgs, common: &Common) -> Result<Verdict, Failure> {
    if args.output.is_none() && !common.json {
        return Err(Failure::usage(
            "nowhere to put the result; give an output directory with -o DIR, or --json",
        ));
    }
    let baseline = common.read(&args.baseline)?;
    let mut followup = common.read(&args.followup)?;
    let settings = ChangeRunSettings {
        change: ChangeSettings {
            pairing: match args.pair {
                PairOption::Label => Pairing::Label,
                PairOption::Overlap => Pairing::Overlap,
            },
            label: common.label,
            boundary_sd_mm: args.boundary_sd,
            repeat_cv: args.repeat_cv,
            ..ChangeSettings::default()
        },
        scaffold: common.scaffold_settings(Side::Interior),
        ..ChangeRunSettings::default()
    };
    let progress = Progress::new(common.quiet);
    let mut warnings = Vec::new();
    let moved = align(args, common, &baseline, &mut followup, &progress, &mut warnings)?;
    let mut done = change_of(&baseline, &followup, &settings, &|stage| progress.stage(stage))?;
    warnings.append(&mut done.warnings);
    if let Some(dir) = &args.output {
        progress.stage("files");
        let mut record = RunRecord::new(common, &settings)?;
        record.inputs = vec![baseline.provenance.clone(), followup.provenance.clone()];
        record.stages = done.stages.clone();
        record.warnings = warnings.clone();
        write_files(dir, &done.change, &mut record, common)?;
        if let Some(motion) = moved {
            write_tfm(&dir.join("T_baseline_followup.tfm"), &motion)?;
        }
    }
    progress.finish();
    warn_all(common, &warnings);
    if common.json {
        print_json(&done.change)?;
    } else if !common.quiet {
        print_text(&summary(&done.change))?;
    }
    Ok(Verdict::Fine)
}

/// Moves the follow-up as the user asked; gives the motion.
fn align(
    args: &ChangeArgs,
    common: &Common,
    baseline: &Shape,
    followup: &mut Shape,
    progress: &Progress,
    warnings: &mut Vec<String>,
) -> Result<Option<medial_scaffold::geometry::Rigid>, Failure> {
    let settings = RegistrationSettings {
        seed: common.seed,
        ..RegistrationSettings::default()
    };
    let structure;
    let (target, source) = match &args.align_on {
        Some(paths) => {
            structure = [common.read(&paths[0])?, common.read(&paths[1])?];
            (&structure[0], &structure[1])
        }
        None if args.align => {
            warnings.push(
                "the follow-up was aligned on the lesion itself: growth that looks like motion is hidden; align on a \
                 structure that does not grow with --align-on"
                    .to_owned(),
            );
            (baseline, &*followup)
        }
        None => return Ok(None),
    };
    let (Geometry::Mesh(target), Geometry::Mesh(source)) = (&target.geometry, &source.geometry) else {
        return Err(Failure::usage(
            "alignment needs surface meshes; make them with `medial scaffold` (surface.ply)",
        ));
    };
    progress.stage("alignment");
    let found = register(
        &RegistrationShape::mesh(target),
        &RegistrationShape::mesh(source),
        &settings,
    )?;
    warnings.extend(
        found
            .ambiguity
            .iter()
            .map(|why| format!("the alignment is ambiguous: {why}")),
    );
    let motion = found.T_target_source;
    match &mut followup.geometry {
        Geometry::Mesh(mesh) => {
            for p in &mut mesh.points {
                *p = motion.apply(*p);
            }
        }
        Geometry::Labels(map) => {
            map.origin = motion.apply(map.origin);
            map.direction = motion.linear * map.direction;
        }
        Geometry::Cloud(_) => {} // refused by the change stage
    }
    Ok(Some(motion))
}

fn write_files(dir: &Path, change: &Change, record: &mut RunRecord, common: &Common) -> Result<(), Failure> {
    make_dir(dir)?;
    write_json(&dir.join("change.json"), change)?;
    for lesion in &change.lesions {
        write_growth(&dir.join(format!("growth_{}.ply", lesion.label)), lesion)?;
    }
    let scene = change_scene(change);
    write_bytes(&dir.join("scene.glb"), glb_bytes(&scene))?;
    record.write(dir)?;
    if !common.no_report {
        let report = change_report("Change over time", &json(change)?, &json(record)?, scene)?;
        write_bytes(&dir.join("report.html"), report.html()?)?;
    }
    Ok(())
}

/// A line a lesion for a terminal.
fn summary(change: &Change) -> String {
    let mut text = String::new();
    for l in &change.lesions {
        let c = &l.change;
        text += &format!(
            "label {}: {:.1} -> {:.1} mm^3, {:+.1} % (95 % interval {:+.1} to {:+.1}), {}\n",
            l.label,
            l.baseline.volume_best,
            l.followup.volume_best,
            c.percent,
            c.ci95_percent[0],
            c.ci95_percent[1],
            if c.significant {
                "more than the measurement's error"
            } else {
                "within the measurement's error"
            },
        );
    }
    for (what, list) in [("new", &change.new), ("vanished", &change.vanished)] {
        for l in list {
            text += &format!("label {}: {what}\n", l.label);
        }
    }
    text
}
