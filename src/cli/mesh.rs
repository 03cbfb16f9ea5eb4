//! `medial mesh`: a surface mesh of a cloud by segregation, or a mesh repaired (`--repair`).

use super::common::Common;
use super::output::{print_json, print_text};
use super::progress::Progress;
use super::{Failure, Verdict, warn_all};
use clap::{Args, ValueEnum};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::input::Geometry;
use medial_scaffold::pipeline::documents::SurfaceDocument;
use medial_scaffold::reports::write_mesh;
use medial_scaffold::segregation::{
    ClosedOrOpen, CloudReport, CostRule, Denoise, SegregationSettings, mend, segregate_cloud,
};
use std::path::PathBuf;

/// Arguments of `medial mesh`.
#[derive(Debug, Args)]
#[command(after_help = "Exit code 1: the mesh was made but is doubted; the warnings say why and where.")]
pub struct MeshArgs {
    /// Point cloud; of a mesh the points are taken, with --repair its triangles too.
    cloud: PathBuf,

    /// Surface mesh to write: .ply, .stl, .obj, .off or .vtp.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,

    /// The object is closed: close every hole.
    #[arg(long, conflicts_with = "open")]
    closed: bool,

    /// The surface is open: close nothing.
    #[arg(long)]
    open: bool,

    /// Whether noise may be removed.
    #[arg(long, value_enum, default_value = "auto")]
    denoise: DenoiseOption,

    /// Lengths the cost of a gap transform is measured against.
    #[arg(long, value_enum, default_value = "local")]
    cost: CostOption,

    /// Only the component of this rank, 0 the one with most points.
    #[arg(long, value_name = "RANK")]
    component: Option<usize>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum DenoiseOption {
    Auto,
    Off,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum CostOption {
    Local,
    Authors,
}

/// Runs the command.
pub fn run(args: &MeshArgs, common: &Common) -> Result<Verdict, Failure> {
    if args.output.is_none() && !common.json {
        return Err(Failure::usage(
            "nowhere to put the result; give a mesh file with -o FILE, or --json",
        ));
    }
    let shape = common.read_faces(&args.cloud)?;
    let points = match &shape.geometry {
        Geometry::Cloud(cloud) => &cloud.points,
        Geometry::Mesh(mesh) => &mesh.points,
        Geometry::Labels(_) => {
            return Err(Failure::usage(format!(
                "{}: holds a label map, not points; `medial scaffold` makes the surface of a mask",
                args.cloud.display()
            )));
        }
    };
    let settings = SegregationSettings {
        denoise: match args.denoise {
            DenoiseOption::Auto => Denoise::Auto,
            DenoiseOption::Off => Denoise::Off,
        },
        closed: match (args.closed, args.open) {
            (true, _) => ClosedOrOpen::Closed,
            (_, true) => ClosedOrOpen::Open,
            _ => ClosedOrOpen::Auto,
        },
        cost: match args.cost {
            CostOption::Local => CostRule::Local,
            CostOption::Authors => CostRule::Authors,
        },
        component: args.component,
        seed: common.seed,
        ..SegregationSettings::default()
    };
    let progress = Progress::new(common.quiet);
    progress.stage("segregation");
    if common.repair && matches!(shape.geometry, Geometry::Cloud(_)) {
        warn_all(
            common,
            &[format!(
                "{}: holds points only, so --repair has nothing to keep",
                args.cloud.display()
            )],
        );
    }
    if let (true, Geometry::Mesh(mesh)) = (common.repair, &shape.geometry) {
        let mended = mend(mesh, &settings)?;
        progress.finish();
        warn_all(common, &shape.warnings);
        warn_all(common, &mended.warnings());
        return deliver(
            args,
            common,
            &shape.name,
            points.len(),
            &mended.mesh,
            &mended.segregation,
        );
    }
    let found = segregate_cloud(points, &settings)?;
    let whole = found.segregation.surface(&found.triangulation);
    let all: Vec<u32> = (0..whole.triangles.len() as u32).collect();
    let mesh: TriangleMesh = whole.submesh(&all);
    progress.finish();
    warn_all(common, &shape.warnings);
    warn_all(common, &found.segregation.warnings);
    deliver(args, common, &shape.name, points.len(), &mesh, &found.report)
}

/// Writes the mesh and says what it is.
fn deliver(
    args: &MeshArgs,
    common: &Common,
    name: &str,
    points: usize,
    mesh: &TriangleMesh,
    report: &CloudReport,
) -> Result<Verdict, Failure> {
    if let Some(path) = &args.output {
        write_mesh(path, mesh, &[])?;
    }
    let document = SurfaceDocument::new(points, mesh, report);
    if common.json {
        print_json(&document)?;
    } else if !common.quiet {
        print_text(&format!(
            "{name}: {} vertices, {} triangles, {}, Euler number {}, {} open edges; {}{}\n",
            document.vertices,
            document.triangles,
            if document.components == 1 {
                "1 component".to_owned()
            } else {
                format!("{} components", document.components)
            },
            document.euler,
            document.boundary_edges,
            report.decision.reason,
            match (report.decision.closed, report.decision.by_user) {
                (false, false) => "; --closed closes it all the same",
                (true, false) if !report.filled_holes.is_empty() => "; --open leaves holes open",
                _ => "",
            },
        ))?;
    }
    Ok(if report.doubtful() {
        Verdict::SaidNo
    } else {
        Verdict::Fine
    })
}
