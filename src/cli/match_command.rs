//! `medial match`: who corresponds to whom, the rigid transform, and how two shapes differ.

use super::common::Common;
use super::output::{make_dir, print_json, print_text};
use super::progress::Progress;
use super::run_record::RunRecord;
use super::scaffold::json;
use super::{Failure, Verdict, warn_all};
use clap::{Args, ValueEnum};
use medial_scaffold::fine_scaffold::Side;
use medial_scaffold::geometry::{Rigid, TriangleMesh};
use medial_scaffold::pipeline::{MatchRun, MatchSettings, match_shapes};
use medial_scaffold::registration::{Extent, Mirror};
use medial_scaffold::reports::plot::pretty;
use medial_scaffold::reports::{
    CorrespondenceLine, PlyEncoding, Quantity, Report, Scene, VertexField, colour, glb_bytes, match_report,
    write_bytes, write_json, write_ply, write_tables, write_tfm,
};
use std::path::{Path, PathBuf};

/// Arguments of `medial match`.
#[derive(Debug, Args)]
pub struct MatchArgs {
    /// The shape that stays; with --names a folder of shapes.
    pub(super) target: PathBuf,

    /// The shape that is moved; with --names a folder of shapes.
    pub(super) source: PathBuf,

    /// Output directory.
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: Option<PathBuf>,

    /// TARGET and SOURCE are folders: say which shape of one is which of the other, one to one, whatever their names, poses and sizes
    /// (the bones of two wrists). Writes names.json and names.csv.
    #[arg(long, conflicts_with_all = ["scale", "extent"])]
    names: bool,

    #[command(flatten)]
    pub(super) options: MatchOptions,
}

/// How shapes are matched.
#[derive(Clone, Debug, Default, Args, serde::Serialize)]
pub struct MatchOptions {
    /// Whether the source is a mirror image (a left bone on a right one).
    #[arg(long, value_enum, default_value = "no")]
    mirror: MirrorOption,

    /// Whether the shapes are whole or parts of something.
    #[arg(long, value_enum, default_value = "auto")]
    extent: ExtentOption,

    /// Estimate one scale factor besides the motion; of cut shapes factors from 0.8 to 1.25 are looked for.
    #[arg(long)]
    scale: bool,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
enum MirrorOption {
    Auto,
    Yes,
    #[default]
    No,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
enum ExtentOption {
    #[default]
    Auto,
    Whole,
    Partial,
}

impl MatchOptions {
    /// Settings of every stage, as the options say.
    pub fn settings(&self, common: &Common) -> MatchSettings {
        let mut settings = MatchSettings {
            scaffold: common.scaffold_settings(Side::Interior),
            ..MatchSettings::default()
        };
        settings.registration.mirror = match self.mirror {
            MirrorOption::Auto => Mirror::Auto,
            MirrorOption::Yes => Mirror::Yes,
            MirrorOption::No => Mirror::No,
        };
        settings.registration.extent = match self.extent {
            ExtentOption::Auto => Extent::Auto,
            ExtentOption::Whole => Extent::Whole,
            ExtentOption::Partial => Extent::Partial,
        };
        settings.registration.scale = self.scale;
        settings.registration.seed = common.seed;
        settings.matching.seed = common.seed;
        settings
    }
}

/// Runs the command.
pub fn run(args: &MatchArgs, common: &Common) -> Result<Verdict, Failure> {
    if args.output.is_none() && !common.json {
        return Err(Failure::usage(
            "nowhere to put the result; give an output directory with -o DIR, or --json",
        ));
    }
    if args.names {
        return super::names::run(args, common);
    }
    if args.target.is_dir() && args.source.is_dir() {
        return Err(Failure::usage(
            "TARGET and SOURCE are folders; --names says which shape of one is which of the other, else give a file of each",
        ));
    }
    let target = common.read(&args.target)?;
    let source = common.read(&args.source)?;
    let settings = args.options.settings(common);
    let progress = Progress::new(common.quiet);
    let done = match_shapes(&target, &source, &settings, &|stage| progress.stage(stage))?;
    let mut record = RunRecord::new(common, &settings)?;
    record.inputs = vec![target.provenance.clone(), source.provenance.clone()];
    record.stages = done.stages.clone();
    record.warnings = done.warnings.clone();
    if let Some(dir) = &args.output {
        progress.stage("files");
        write_files(dir, &done, &mut record, common)?;
    }
    progress.finish();
    warn_all(common, &done.warnings);
    if common.json {
        print_json(&done.document())?;
    } else if !common.quiet {
        print_text(&summary(&done))?;
    }
    Ok(if done.registration.converged && !done.registration.ambiguous {
        Verdict::Fine
    } else {
        Verdict::SaidNo
    })
}

/// A few lines for a terminal.
pub fn summary(done: &MatchRun) -> String {
    let r = &done.registration;
    let mut text = format!(
        "{} on {}: rms {:.4} mm, 95 % below {:.4} mm, largest {:.4} mm, overlap {:.0} %{}{}{}\n",
        done.source.name,
        done.target.name,
        r.rms,
        r.p95,
        r.max,
        100.0 * r.overlap,
        if r.mirrored { ", mirrored" } else { "" },
        if r.ambiguous { ", AMBIGUOUS" } else { "" },
        if r.uncertain { ", UNCERTAIN" } else { "" },
    );
    text += "T_target_source:\n";
    for row in r.T_target_source.to_rows() {
        text += &format!(
            "  {:12.6} {:12.6} {:12.6} {:12.6}\n",
            row[0], row[1], row[2], row[3]
        );
    }
    if let Some(m) = &done.matching {
        let c = &m.correspondences;
        text += &format!(
            "correspondences: {} sheets, {} curves, {} nodes; shape distance {:.4} mm\n",
            c.sheets.len(),
            c.curves.len(),
            c.nodes.len(),
            m.shape_distance.with_size_mm,
        );
    }
    if let Some(d) = &done.difference
        && let (Some(target), Some(source)) = (d.volume_target, d.volume_source)
    {
        text += &format!(
            "volume: target {} mm^3, source {} mm^3\n",
            pretty(target),
            pretty(source)
        );
    }
    text
}

/// Writes everything the contract names into `dir`.
pub fn write_files(
    dir: &Path,
    done: &MatchRun,
    record: &mut RunRecord,
    common: &Common,
) -> Result<(), Failure> {
    make_dir(dir)?;
    let document = done.document();
    write_json(&dir.join("match.json"), &document)?;
    write_tfm(
        &dir.join("T_target_source.tfm"),
        &done.registration.T_target_source,
    )?;
    record.write(dir)?;
    let title = format!("{} on {}", done.source.name, done.target.name);
    let report = match_report(&title, &json(&document)?, &json(record)?, scene(done))?;
    // The page draws its picture while the surfaces are written.
    let (surfaces, page) = rayon::join(
        || write_surfaces(dir, done, &report.scene),
        || write_page(dir, &report, common),
    );
    surfaces.and(page)
}

fn write_surfaces(dir: &Path, done: &MatchRun, scene: &Scene) -> Result<(), Failure> {
    if let Some(moved) = moved_source(done) {
        write_ply(&dir.join("moved.ply"), &moved, &[], PlyEncoding::default())?;
    }
    if let (Some(surface), Some(difference)) = (&done.target.surface, &done.difference) {
        let field = VertexField::real("signed_distance", difference.at_target.clone());
        write_ply(
            &dir.join("difference.ply"),
            surface,
            &[field],
            PlyEncoding::default(),
        )?;
    }
    write_bytes(&dir.join("scene.glb"), glb_bytes(scene))?;
    Ok(())
}

fn write_page(dir: &Path, report: &Report, common: &Common) -> Result<(), Failure> {
    write_tables(dir, report)?;
    if !common.no_report {
        write_bytes(&dir.join("report.html"), report.html()?)?;
    }
    Ok(())
}

/// The source's surface in the target's frame, outward as the source was.
fn moved_source(done: &MatchRun) -> Option<TriangleMesh> {
    let motion = &done.registration.T_target_source;
    let mut mesh = done.source.surface.clone()?;
    for p in &mut mesh.points {
        *p = motion.apply(*p);
    }
    if motion.is_mirrored() {
        mesh.flip();
    }
    Some(mesh)
}

/// Both shapes aligned, the target coloured by its distance to the source, both scaffolds, and lines between what corresponds.
fn scene(done: &MatchRun) -> Scene {
    let mut scene = Scene::default();
    if let Some(surface) = &done.target.surface {
        let distance = done.difference.as_ref().map(|d| {
            let values = d.at_target.iter().map(|&x| x as f32).collect();
            Quantity::signed("signed distance", "mm", values)
        });
        scene.add_surface("target", surface, colour::BONE, distance);
    }
    if let Some(moved) = moved_source(done) {
        scene.add_surface("source", &moved, colour::SECOND, None);
    }
    let motion = &done.registration.T_target_source;
    if let Some(run) = &done.target.scaffold {
        scene.add_scaffold("target", &run.coarse, &Rigid::IDENTITY);
    }
    if let Some(run) = &done.source.scaffold {
        scene.add_scaffold("source", &run.coarse, motion);
    }
    scene.add_correspondences(&correspondence_lines(done));
    scene
}

fn correspondence_lines(done: &MatchRun) -> Vec<CorrespondenceLine> {
    let (Some(matching), Some(target), Some(source)) =
        (&done.matching, &done.target.scaffold, &done.source.scaffold)
    else {
        return Vec::new();
    };
    let motion = &done.registration.T_target_source;
    let (t, s) = (&target.coarse, &source.coarse);
    let line = |kind: &str, ids: [u32; 2], ends: [glam::DVec3; 2], weight: f64| CorrespondenceLine {
        target: ends[0],
        source_moved: motion.apply(ends[1]),
        weight,
        label: format!("{kind} {} - {}", ids[0], ids[1]),
    };
    let c = &matching.correspondences;
    let nodes = c.nodes.iter().map(|p| {
        let ends = [
            t.nodes[p.target.index()].position,
            s.nodes[p.source.index()].position,
        ];
        line("node", [p.target.0, p.source.0], ends, p.weight)
    });
    let sheets = c.sheets.iter().map(|p| {
        let ends = [
            t.sheets[p.target.index()].moments.centroid,
            s.sheets[p.source.index()].moments.centroid,
        ];
        line("sheet", [p.target.0, p.source.0], ends, p.weight)
    });
    let middle = |curve: &medial_scaffold::coarse_scaffold::Curve| {
        curve
            .polyline
            .get(curve.polyline.len() / 2)
            .map_or(glam::DVec3::ZERO, |p| p.position)
    };
    let curves = c.curves.iter().map(|p| {
        let ends = [
            middle(&t.curves[p.target.index()]),
            middle(&s.curves[p.source.index()]),
        ];
        line("curve", [p.target.0, p.source.0], ends, p.weight)
    });
    nodes.chain(curves).chain(sheets).collect()
}
