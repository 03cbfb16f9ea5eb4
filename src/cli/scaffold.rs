//! `medial scaffold`: the scaffold of one shape, as files, a report, or JSON on stdout.

use super::common::Common;
use super::output::{make_dir, print_json, print_text};
use super::progress::Progress;
use super::run_record::RunRecord;
use super::{Failure, Verdict, warn_all};
use clap::Args;
use medial_scaffold::coarse_scaffold::Host;
use medial_scaffold::geometry::Rigid;
use medial_scaffold::measures::thickness;
use medial_scaffold::pipeline::{ScaffoldRun, scaffold};
use medial_scaffold::regularise::Cost;
use medial_scaffold::reports::plot::pretty;
use medial_scaffold::reports::{
    MedialMesh, PlyEncoding, Quantity, Scene, VertexField, colour, curves_polydata, glb_bytes,
    scaffold_report, sheets_polydata, write_bytes, write_json, write_ma, write_ply, write_tables, write_vtp,
};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Arguments of `medial scaffold`.
#[derive(Debug, Args)]
pub struct ScaffoldArgs {
    /// Point cloud, surface mesh or segmentation mask.
    shape: PathBuf,

    /// Output directory.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,

    /// What simplification goes by: lengths, or numbers of samples as in the first papers (they depend on the sampling).
    #[arg(long, value_enum, default_value_t = CostArg::Length)]
    cost: CostArg,
}

/// The choices of `--cost`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum CostArg {
    Length,
    Count,
}

impl From<CostArg> for Cost {
    fn from(cost: CostArg) -> Self {
        match cost {
            CostArg::Length => Self::Length,
            CostArg::Count => Self::Count,
        }
    }
}

/// Runs the command.
pub fn run(args: &ScaffoldArgs, common: &Common) -> Result<Verdict, Failure> {
    if args.output.is_none() && !common.json {
        return Err(Failure::usage(
            "nowhere to put the result; give an output directory with -o DIR, or --json",
        ));
    }
    let shape = common.read(&args.shape)?;
    let progress = Progress::new(common.quiet);
    let mut last = Verdict::Fine;
    for &side in common.side.sides() {
        let mut settings = common.scaffold_settings(side);
        settings.regularise.cost = args.cost.into();
        let done = scaffold(&shape, &settings, &|stage| progress.stage(stage))?;
        let mut record = RunRecord::new(common, &settings)?;
        record.inputs.push(shape.provenance.clone());
        record.stages = done.stages.clone();
        record.warnings = done.warnings.clone();
        if let Some(dir) = &args.output {
            let dir = if common.side.sides().len() > 1 {
                dir.join(side_name(done.side))
            } else {
                dir.clone()
            };
            progress.stage("files");
            write_files(&dir, &done, &mut record, common)?;
        }
        progress.finish();
        warn_all(common, &done.warnings);
        if common.json {
            print_json(&done.document())?;
        } else if !common.quiet {
            print_text(&summary(&done))?;
        }
        if !done.topology.agree {
            last = Verdict::SaidNo;
        }
        // The scaffold of an open surface is that of both sides already.
        if done.side == medial_scaffold::fine_scaffold::Side::Joined {
            break;
        }
    }
    Ok(last)
}

fn side_name(side: medial_scaffold::fine_scaffold::Side) -> &'static str {
    match side {
        medial_scaffold::fine_scaffold::Side::Interior => "interior",
        medial_scaffold::fine_scaffold::Side::Exterior => "exterior",
        medial_scaffold::fine_scaffold::Side::Joined => "joined",
    }
}

/// A few lines for a terminal.
fn summary(done: &ScaffoldRun) -> String {
    let document = done.document();
    let (c, s, t) = (document.counts, document.surface, document.topology);
    format!(
        "{}: {} sheets, {} axial curves, {} ribs, {} wires, {} nodes at tolerance {} mm\n\
         surface: {} vertices, {} triangles, Euler number {}, {}{} mm^2\n\
         Betti numbers: solid {:?}, scaffold {:?} ({}); Morse number {}\n\
         fidelity: at most {} mm ({:.2} % of the diagonal)\n",
        document.name,
        c.sheets,
        c.axial_curves,
        c.rib_curves,
        c.wires,
        c.nodes,
        pretty(document.tolerance_mm),
        s.vertices,
        s.triangles,
        s.euler,
        s.volume
            .map_or(String::from("no volume (open or not manifold), "), |v| format!(
                "closed, {} mm^3, ",
                pretty(v)
            )),
        pretty(s.area),
        <[i64; 3]>::from(t.solid_betti),
        <[i64; 3]>::from(t.scaffold_betti),
        match (t.agree, t.surface_as_given) {
            (false, _) => "DISAGREE",
            (true, Some(false)) => "agree, but the surface given has others",
            (true, _) => "agree",
        },
        document.full.morse,
        pretty(document.fidelity.hausdorff),
        document.fidelity.hausdorff_percent_diag,
    )
}

/// Writes everything the contract names into `dir`.
pub fn write_files(
    dir: &Path,
    done: &ScaffoldRun,
    record: &mut RunRecord,
    common: &Common,
) -> Result<(), Failure> {
    make_dir(dir)?;
    let document = done.document();
    write_json(&dir.join("scaffold.json"), &document)?;
    let thickness = thickness(&done.fine, &done.regularised);
    let hosts = done.coarse.fine.generator_host.iter().map(|h| match h {
        Host::Sheet(sheet) => sheet.0 as i32,
        _ => -1,
    });
    let fields = [
        VertexField::real("thickness", thickness.clone()),
        VertexField::integer("sheet", hosts.collect()),
    ];
    write_ply(
        &dir.join("surface.ply"),
        &done.surface,
        &fields,
        PlyEncoding::default(),
    )?;
    write_ma(&dir.join("fine.ma"), &MedialMesh::from_scaffold(&done.coarse))?;
    write_vtp(&dir.join("sheets.vtp"), &sheets_polydata(&done.coarse))?;
    write_vtp(&dir.join("curves.vtp"), &curves_polydata(&done.coarse))?;
    let scene = scene(done, &thickness);
    write_bytes(&dir.join("scene.glb"), glb_bytes(&scene))?;
    record.write(dir)?;
    let title = format!("Medial scaffold of {}", done.name);
    let report = scaffold_report(&title, &json(&document)?, &json(record)?, scene)?;
    write_tables(dir, &report)?;
    if !common.no_report {
        write_bytes(&dir.join("report.html"), report.html()?)?;
    }
    Ok(())
}

/// The 3D scene: the translucent surface coloured by thickness, and the scaffold in it.
fn scene(done: &ScaffoldRun, thickness: &[f64]) -> Scene {
    let mut scene = Scene::default();
    let values = thickness.iter().map(|&t| t as f32).collect();
    scene.add_surface(
        "",
        &done.surface,
        colour::BONE,
        Some(Quantity::positive("thickness", "mm", values)),
    );
    scene.add_scaffold("", &done.coarse, &Rigid::IDENTITY);
    scene
}

/// A document as a JSON value, for the report.
pub fn json<T: serde::Serialize>(value: &T) -> Result<Value, Failure> {
    Ok(serde_json::to_value(value)?)
}
