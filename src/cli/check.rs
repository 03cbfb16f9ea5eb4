//! `medial check`: what is in each file and what it can be used for; exit 1 if one is fit for nothing (or not for what is asked).

use super::common::Common;
use super::output::{print_json, print_text};
use super::{Failure, Verdict};
use clap::{Args, ValueEnum};
use medial_scaffold::input::check::{CheckContent, CheckReport, Purpose, Severity, check};
use medial_scaffold::reports::plot::pretty;
use std::path::PathBuf;

/// Arguments of `medial check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Files to look at.
    #[arg(required = true)]
    shapes: Vec<PathBuf>,

    /// Say no (exit 1) unless every file is fit for this; without it, unless it is fit for anything.
    #[arg(long = "for", value_enum, value_name = "USE")]
    purpose: Option<PurposeOption>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PurposeOption {
    Scaffold,
    Match,
    Change,
}

impl CheckArgs {
    /// Whether a file is fit for what it is wanted for.
    fn fit(&self, report: &CheckReport) -> bool {
        let wanted = match self.purpose {
            None => return report.usable,
            Some(PurposeOption::Scaffold) => Purpose::Scaffold,
            Some(PurposeOption::Match) => Purpose::Match,
            Some(PurposeOption::Change) => Purpose::Change,
        };
        report.uses.iter().any(|u| u.purpose == wanted && u.fit)
    }
}

/// Runs the command: every file is looked at, even after one that cannot be read.
pub fn run(args: &CheckArgs, common: &Common) -> Result<Verdict, Failure> {
    let mut reports = Vec::new();
    let mut unreadable = None;
    for path in &args.shapes {
        match common.read(path) {
            Ok(shape) => {
                let report = check(&shape);
                if !common.json {
                    print_text(&text(&report))?;
                }
                reports.push(report);
            }
            Err(failure) if args.shapes.len() > 1 => {
                eprintln!("error: {}", failure.message);
                unreadable = Some(failure);
            }
            Err(failure) => return Err(failure),
        }
    }
    if common.json {
        match reports.as_slice() {
            [one] if args.shapes.len() == 1 => print_json(one)?,
            many => print_json(many)?,
        }
    }
    match unreadable {
        Some(_) => Err(Failure::usage("not every file could be read, see above")),
        None if reports.iter().all(|r| args.fit(r)) => Ok(Verdict::Fine),
        None => Ok(Verdict::SaidNo),
    }
}

fn text(report: &CheckReport) -> String {
    let p = &report.provenance;
    let [lo, hi] = report.bounds_mm;
    let mut out = format!(
        "{}: {}\n  frame {}, units {}; box {} x {} x {} mm\n",
        p.path.display(),
        match (report.usable, report.uses.iter().all(|u| u.fit)) {
            (true, true) => "usable",
            (true, false) => "usable, but not for everything",
            (false, _) => "NOT usable as it is",
        },
        p.frame,
        p.units,
        pretty(hi[0] - lo[0]),
        pretty(hi[1] - lo[1]),
        pretty(hi[2] - lo[2]),
    );
    out += &match &report.content {
        CheckContent::Cloud(c) => format!(
            "  cloud: {} points ({} duplicates), normals: {}, spacing about {} mm\n",
            c.points,
            c.duplicates,
            if c.normals { "yes" } else { "no" },
            pretty(c.spacing_mm)
        ),
        CheckContent::Mesh(m) => format!(
            "  mesh: {} points, {} triangles, {} components, Euler number {}, {} open and {} non-manifold edges\n  area {} mm^2, volume {}\n",
            m.points,
            m.topology.triangles,
            m.topology.components,
            m.topology.euler,
            m.topology.boundary_edges,
            m.topology.nonmanifold_edges,
            pretty(m.area_mm2),
            m.volume_mm3
                .map_or(String::from("none (not closed and oriented)"), |v| format!(
                    "{} mm^3",
                    pretty(v)
                )),
        ),
        CheckContent::Labels(l) => {
            let mut text = format!(
                "  label map: {} x {} x {} voxels of {} x {} x {} mm\n",
                l.dims[0], l.dims[1], l.dims[2], l.spacing_mm[0], l.spacing_mm[1], l.spacing_mm[2]
            );
            for label in &l.labels {
                text += &format!(
                    "  label {}: {} voxels, {} mm^3\n",
                    label.label,
                    label.voxels,
                    pretty(label.volume_mm3)
                );
            }
            text
        }
    };
    for u in &report.uses {
        let word = match u.purpose {
            Purpose::Scaffold => "scaffold",
            Purpose::Match => "match",
            Purpose::Change => "change",
        };
        out += &format!("  {word}: {}, {}\n", if u.fit { "yes" } else { "NO" }, u.why);
    }
    for problem in &report.problems {
        let word = match problem.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        out += &format!("  {word}: {}", problem.found);
        if !problem.remedy.is_empty() {
            out += &format!("; {}", problem.remedy);
        }
        out.push('\n');
    }
    out
}
