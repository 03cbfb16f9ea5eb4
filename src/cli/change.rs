//! `medial change`: how much lesions grew between two dates, where, and whether that is more than the measurement's error.

use super::common::Common;
use super::output::{make_dir, print_json, print_text};
use super::progress::Progress;
use super::run_record::RunRecord;
use super::scaffold::json;
use super::{Failure, Verdict, warn_all};
use clap::{Args, ValueEnum};
use medial_scaffold::change::{Change, ChangeSettings, Comparison, Pairing, compare};
use medial_scaffold::fine_scaffold::Side;
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::input::{Geometry, Provenance, Shape};
use medial_scaffold::pipeline::{
    Aligned, ChangeRunSettings, align_on, change_of, move_shape, structure_surface,
};
use medial_scaffold::registration::RegistrationSettings;
use medial_scaffold::reports::change_report::title;
use medial_scaffold::reports::{
    change_report, change_scene, glb_bytes, write_bytes, write_growth, write_json, write_tables, write_tfm,
};
use std::path::{Path, PathBuf};

/// Arguments of `medial change`.
#[derive(Debug, Args)]
pub struct ChangeArgs {
    /// Mask or closed mesh of the first date; may be left out when only segmentations are compared.
    #[arg(required_unless_present = "segmentation", requires = "followup")]
    baseline: Option<PathBuf>,

    /// Mask or closed mesh of the second date.
    followup: Option<PathBuf>,

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

    /// Another segmentation of the baseline's date; may be repeated. They are compared with each other (and with BASELINE), and
    /// their spread is the error of the interval unless --repeat-cv says it.
    #[arg(long, value_name = "NAME=FILE", value_parser = named_file)]
    segmentation: Vec<NamedFile>,

    /// The segmentation that is the truth: the others are compared with it, and it takes no part in their spread.
    #[arg(long, value_name = "NAME", requires = "segmentation")]
    truth: Option<String>,

    /// Tolerance of the surface Dice coefficient, mm.
    #[arg(long, value_name = "MM", default_value_t = ChangeSettings::default().surface_dice_tolerance_mm)]
    dice_tolerance: f64,

    /// Move the follow-up first, by a structure that does not grow: its label numbers in the masks (`5` or `5,6`; they are then no
    /// lesions), or two files (meshes or masks) of it, baseline first.
    #[arg(long, num_args = 1..=2, value_names = ["LABELS | BASELINE", "FOLLOWUP"])]
    align_on: Option<Vec<String>>,

    /// Move the follow-up onto the baseline first, by the lesions themselves; hides growth that looks like motion.
    #[arg(long, conflicts_with = "align_on")]
    align: bool,
}

/// A file and the name it goes by.
#[derive(Clone, Debug)]
struct NamedFile {
    name: String,
    path: PathBuf,
}

fn named_file(text: &str) -> Result<NamedFile, String> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && !path.is_empty() => Ok(NamedFile {
            name: name.to_owned(),
            path: path.into(),
        }),
        _ => Err("give a name and a file, joined by `=`: reader2=reader2.nii.gz".to_owned()),
    }
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
    let dates = match (&args.baseline, &args.followup) {
        (Some(b), Some(f)) => Some((common.read(b)?, common.read(f)?)),
        _ => None,
    };
    let mut settings = settings(args, common);
    let progress = Progress::new(common.quiet);
    let mut inputs: Vec<Provenance> = dates
        .iter()
        .flat_map(|(b, f)| [b.provenance.clone(), f.provenance.clone()])
        .collect();
    let segmentations = compared(
        args,
        common,
        dates.as_ref().map(|d| &d.0),
        &settings.change,
        &mut inputs,
    )?;
    if let Some(spread) = segmentations.as_ref().and_then(|s| s.pooled)
        && args.repeat_cv.is_none()
    {
        settings.change.repeat_cv = Some(spread.cv);
        settings.change.repeat_degrees_of_freedom = Some(spread.degrees_of_freedom);
    }
    let mut warnings = Vec::new();
    let mut moved = None;
    let mut stages = Vec::new();
    let change = match dates {
        Some((baseline, mut followup)) => {
            let aligned = align(args, common, &baseline, &mut followup, &progress, &mut inputs)?;
            if let Some(aligned) = &aligned {
                warnings.extend(aligned.warnings.iter().cloned());
            }
            let mut done = change_of(&baseline, &followup, &settings, &|stage| progress.stage(stage))?;
            done.change.alignment = aligned.as_ref().map(|a| a.alignment.clone());
            done.change.segmentations = segmentations;
            moved = aligned.map(|a| a.T_baseline_followup);
            warnings.append(&mut done.warnings);
            stages = done.stages;
            done.change
        }
        None => Change::of_segmentations(segmentations.unwrap_or_default(), &settings.change),
    };
    if let Some(dir) = &args.output {
        progress.stage("files");
        let mut record = RunRecord::new(common, &settings)?;
        record.inputs = inputs;
        record.stages = stages;
        record.warnings = warnings.clone();
        write_files(dir, &change, &mut record, common)?;
        if let Some(motion) = moved {
            write_tfm(&dir.join("T_baseline_followup.tfm"), &motion)?;
        }
    }
    progress.finish();
    warn_all(common, &warnings);
    if common.json {
        print_json(&change)?;
    } else if !common.quiet {
        print_text(&summary(&change))?;
    }
    Ok(Verdict::Fine)
}

fn settings(args: &ChangeArgs, common: &Common) -> ChangeRunSettings {
    ChangeRunSettings {
        change: ChangeSettings {
            pairing: match args.pair {
                PairOption::Label => Pairing::Label,
                PairOption::Overlap => Pairing::Overlap,
            },
            label: common.label,
            boundary_sd_mm: args.boundary_sd,
            repeat_cv: args.repeat_cv,
            ignored_labels: aligned_labels(args).unwrap_or_default(),
            surface_dice_tolerance_mm: args.dice_tolerance,
            ..ChangeSettings::default()
        },
        scaffold: common.scaffold_settings(Side::Interior),
        ..ChangeRunSettings::default()
    }
}

/// The segmentations of the baseline's date against each other; the baseline is one of them unless its file is listed.
fn compared(
    args: &ChangeArgs,
    common: &Common,
    baseline: Option<&Shape>,
    settings: &ChangeSettings,
    inputs: &mut Vec<Provenance>,
) -> Result<Option<Comparison>, Failure> {
    if args.segmentation.is_empty() {
        return Ok(None);
    }
    let mut shapes: Vec<Shape> = Vec::new();
    for file in &args.segmentation {
        if shapes.iter().any(|s| s.name == file.name) {
            return Err(Failure::usage(format!(
                "two segmentations are called `{}`; give each its own name",
                file.name
            )));
        }
        let mut shape = common.read(&file.path)?;
        shape.name.clone_from(&file.name);
        inputs.push(shape.provenance.clone());
        shapes.push(shape);
    }
    if let Some(baseline) = baseline
        && shapes
            .iter()
            .all(|s| s.provenance.sha256 != baseline.provenance.sha256)
    {
        let mut own = baseline.clone();
        own.name = "baseline".to_owned();
        shapes.insert(0, own);
    }
    let truth = match &args.truth {
        None => None,
        Some(name) => match shapes.iter().position(|s| s.name == *name) {
            Some(at) => Some(shapes.remove(at)),
            None => {
                let names: Vec<&str> = shapes.iter().map(|s| s.name.as_str()).collect();
                return Err(Failure::usage(format!(
                    "--truth {name}: no segmentation has this name; there are {}",
                    names.join(", ")
                )));
            }
        },
    };
    Ok(Some(compare(&shapes, truth.as_ref(), settings)?))
}

/// The labels of `--align-on 5,6`; `None` when it names files.
fn aligned_labels(args: &ChangeArgs) -> Option<Vec<i32>> {
    match args.align_on.as_deref() {
        Some([one]) => one.split(',').map(|n| n.trim().parse().ok()).collect(),
        _ => None,
    }
}

/// Moves the follow-up as the user asked.
fn align(
    args: &ChangeArgs,
    common: &Common,
    baseline: &Shape,
    followup: &mut Shape,
    progress: &Progress,
    inputs: &mut Vec<Provenance>,
) -> Result<Option<Aligned>, Failure> {
    // Structures are read whole, whatever label the lesion has.
    let whole = Common {
        label: None,
        ..common.clone()
    };
    let labels = aligned_labels(args);
    let (on, surfaces) = match (&labels, args.align_on.as_deref()) {
        (Some(labels), _) => {
            let both = [baseline, &*followup].map(|date| whole.read(&date.provenance.path));
            let [b, f] = both;
            let (b, f) = (b?, f?);
            for shape in [&b, &f] {
                if !matches!(shape.geometry, Geometry::Labels(_)) {
                    return Err(Failure::usage(format!(
                        "{}: --align-on with label numbers needs masks; for meshes give two files of the structure",
                        shape.provenance.path.display()
                    )));
                }
            }
            let words: Vec<String> = labels.iter().map(i32::to_string).collect();
            (format!("label {}", words.join(", ")), structures(&b, &f, labels)?)
        }
        (None, Some([b, f])) => {
            let (b, f) = (whole.read(Path::new(b))?, whole.read(Path::new(f))?);
            inputs.extend([b.provenance.clone(), f.provenance.clone()]);
            (format!("{} and {}", b.name, f.name), structures(&b, &f, &[])?)
        }
        (None, Some(_)) => {
            return Err(Failure::usage(
                "--align-on takes label numbers (5 or 5,6), or two files: the structure at baseline and at follow-up",
            ));
        }
        (None, None) if args.align => {
            let wanted: Vec<i32> = common.label.into_iter().collect();
            (
                "the lesions themselves".to_owned(),
                structures(baseline, followup, &wanted)?,
            )
        }
        (None, None) => return Ok(None),
    };
    progress.stage("alignment");
    let registration = RegistrationSettings {
        seed: common.seed,
        ..RegistrationSettings::default()
    };
    let mut aligned = align_on(&surfaces[0], &surfaces[1], &on, &registration)?;
    if args.align {
        aligned.warnings.push(
            "the follow-up was aligned on the lesions themselves: growth that looks like motion is hidden; align on a \
             structure that does not grow with --align-on"
                .to_owned(),
        );
    }
    move_shape(followup, &aligned.T_baseline_followup);
    Ok(Some(aligned))
}

fn structures(baseline: &Shape, followup: &Shape, labels: &[i32]) -> Result<[TriangleMesh; 2], Failure> {
    let surface = |shape: &Shape| {
        structure_surface(shape, labels).map_err(|e| e.of(&shape.provenance.path.display().to_string()))
    };
    Ok([surface(baseline)?, surface(followup)?])
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
    let document = json(change)?;
    let report = change_report(&title(&document), &document, &json(record)?, scene)?;
    write_tables(dir, &report)?;
    if !common.no_report {
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
    if let Some(s) = &change.segmentations {
        for p in &s.pairs {
            let a = &p.agreement;
            text += &format!(
                "label {}: {} against {}: volume {:+.1} %",
                p.label, p.second, p.first, p.volume_difference_percent
            );
            if let Some(dice) = a.dice {
                text += &format!(", Dice {dice:.3}");
            }
            if let Some(m) = &a.mesh {
                text += &format!(", HD95 {:.2} mm, mean distance {:.2} mm", m.hd95, m.assd);
            }
            text.push('\n');
        }
        if let Some(spread) = s.pooled {
            text += &format!(
                "repeated segmentation: coefficient of variation {:.2} %, {} degrees of freedom\n",
                100.0 * spread.cv,
                spread.degrees_of_freedom
            );
        }
    }
    text
}
