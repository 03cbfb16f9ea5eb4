//! `medial match --names`: which shape of one folder is which of another.

use super::common::Common;
use super::match_command::MatchArgs;
use super::output::{make_dir, print_json, print_text};
use super::progress::Progress;
use super::run_record::RunRecord;
use super::{Failure, Verdict, warn_all};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::input::{Geometry, Shape};
use medial_scaffold::pipeline::structure_surface;
use medial_scaffold::registration::{Naming, NamingSettings, RegistrationShape, Surface, name_shapes};
use medial_scaffold::reports::{write_bytes, write_json};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What `names.json` holds.
#[derive(Debug, Serialize)]
struct NamesDocument {
    /// Name of this schema.
    schema: &'static str,
    /// Version of the program that wrote it.
    version: &'static str,
    /// All sources were mirrored.
    mirrored: bool,
    /// Size of the sources over that of the targets, as the pairs agree on it.
    size_ratio: f64,
    pairs: Vec<PairDocument>,
    unnamed_targets: Vec<String>,
    unnamed_sources: Vec<String>,
    /// File names of the rows of `differences`.
    targets: Vec<String>,
    /// File names of its columns.
    sources: Vec<String>,
    /// Distance of the surfaces at equal size, as a share of the size, of every target and source.
    differences: Vec<Vec<f64>>,
}

#[derive(Debug, Serialize)]
struct PairDocument {
    target: String,
    source: String,
    difference: f64,
    size_ratio: f64,
    lead: f64,
    ambiguous: bool,
}

/// Runs the command.
pub fn run(args: &MatchArgs, common: &Common) -> Result<Verdict, Failure> {
    let progress = Progress::new(common.quiet);
    progress.stage("reading");
    let targets = read_folder(&args.target, common)?;
    let sources = read_folder(&args.source, common)?;
    let settings = NamingSettings {
        mirror: args.options.settings(common).registration.mirror,
        seed: common.seed,
        ..NamingSettings::default()
    };
    let (target_surfaces, source_surfaces) = (surfaces(&targets)?, surfaces(&sources)?);
    progress.stage("naming");
    let found = name_shapes(
        &to_register(&targets, &target_surfaces),
        &to_register(&sources, &source_surfaces),
        &settings,
    )?;
    let document = document(&found, &targets, &sources);
    let mut record = RunRecord::new(common, &settings)?;
    let all = targets.iter().chain(&sources);
    record.inputs = all.clone().map(|s| s.provenance.clone()).collect();
    record.warnings = all.flat_map(|s| s.warnings.clone()).collect();
    if let Some(dir) = &args.output {
        progress.stage("files");
        make_dir(dir)?;
        write_json(&dir.join("names.json"), &document)?;
        write_bytes(&dir.join("names.csv"), csv(&document).into_bytes())?;
        record.write(dir)?;
    }
    progress.finish();
    warn_all(common, &record.warnings);
    if common.json {
        print_json(&document)?;
    } else if !common.quiet {
        print_text(&summary(&document))?;
    }
    let sure = document.pairs.iter().all(|p| !p.ambiguous);
    Ok(if sure { Verdict::Fine } else { Verdict::SaidNo })
}

/// The shapes of a folder in the order of their names; files that are no shapes are passed over with a warning.
fn read_folder(folder: &Path, common: &Common) -> Result<Vec<Shape>, Failure> {
    let entries = std::fs::read_dir(folder).map_err(|e| {
        Failure::usage(format!(
            "{}: cannot be read as a folder: {e}; --names wants two folders of shapes",
            folder.display()
        ))
    })?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    files.retain(|p| p.is_file());
    files.sort();
    let mut shapes = Vec::new();
    let mut passed = Vec::new();
    for file in &files {
        match common.read(file) {
            Ok(shape) => shapes.push(shape),
            Err(failure) => passed.push(failure.message),
        }
    }
    if shapes.is_empty() {
        let why = passed.first().map_or(String::new(), |m| format!(" ({m})"));
        return Err(Failure::usage(format!(
            "{}: no shape in this folder could be read{why}; --names wants two folders of meshes, clouds or masks",
            folder.display()
        )));
    }
    if let Some(first) = shapes.first_mut() {
        first
            .warnings
            .extend(passed.iter().map(|m| format!("passed over: {m}")));
    }
    Ok(shapes)
}

/// The surface of every shape that is not a cloud.
fn surfaces(shapes: &[Shape]) -> Result<Vec<Option<TriangleMesh>>, Failure> {
    let surface = |shape: &Shape| match shape.geometry {
        Geometry::Cloud(_) => Ok(None),
        _ => structure_surface(shape, &[]).map(Some).map_err(Failure::from),
    };
    shapes.iter().map(surface).collect()
}

fn to_register<'a>(shapes: &'a [Shape], surfaces: &'a [Option<TriangleMesh>]) -> Vec<RegistrationShape<'a>> {
    let one = |(shape, surface): (&'a Shape, &'a Option<TriangleMesh>)| match (&shape.geometry, surface) {
        (Geometry::Cloud(cloud), _) => RegistrationShape {
            surface: Surface::Cloud {
                points: &cloud.points,
                normals: (cloud.normals.len() == cloud.points.len()).then_some(&cloud.normals[..]),
            },
            scaffold: None,
        },
        (_, Some(mesh)) => RegistrationShape::mesh(mesh),
        (_, None) => RegistrationShape::cloud(&[]),
    };
    shapes.iter().zip(surfaces).map(one).collect()
}

fn document(found: &Naming, targets: &[Shape], sources: &[Shape]) -> NamesDocument {
    let name = |shape: &Shape| {
        let path = &shape.provenance.path;
        path.file_name()
            .map_or_else(|| shape.name.clone(), |n| n.to_string_lossy().into_owned())
    };
    let (targets, sources): (Vec<String>, Vec<String>) = (
        targets.iter().map(name).collect(),
        sources.iter().map(name).collect(),
    );
    let pair = |p: &medial_scaffold::registration::NamedPair| PairDocument {
        target: targets[p.target].clone(),
        source: sources[p.source].clone(),
        difference: p.difference,
        size_ratio: p.size_ratio,
        lead: p.lead,
        ambiguous: p.ambiguous,
    };
    NamesDocument {
        schema: "medial-scaffold/names",
        version: env!("CARGO_PKG_VERSION"),
        mirrored: found.mirrored,
        size_ratio: found.size_ratio,
        pairs: found.pairs.iter().map(pair).collect(),
        unnamed_targets: found
            .unnamed_targets
            .iter()
            .map(|&i| targets[i].clone())
            .collect(),
        unnamed_sources: found
            .unnamed_sources
            .iter()
            .map(|&j| sources[j].clone())
            .collect(),
        differences: found.differences.clone(),
        targets,
        sources,
    }
}

fn summary(d: &NamesDocument) -> String {
    let mut text = format!(
        "{} of {} named, {} times the size{}\n",
        d.pairs.len(),
        d.sources.len(),
        (d.size_ratio * 100.0).round() / 100.0,
        if d.mirrored { ", mirrored" } else { "" },
    );
    for p in &d.pairs {
        text += &format!(
            "  {} is {} (difference {:.1} % of the size, {:.2} times as large){}\n",
            p.source,
            p.target,
            100.0 * p.difference,
            p.size_ratio,
            if p.ambiguous { ", IN DOUBT" } else { "" },
        );
    }
    for name in &d.unnamed_sources {
        text += &format!("  {name} is none of the targets\n");
    }
    for name in &d.unnamed_targets {
        text += &format!("  {name} has no source\n");
    }
    text
}

fn csv(d: &NamesDocument) -> String {
    let quoted = |s: &str| format!("\"{}\"", s.replace('"', "\"\""));
    let mut text = "source,target,difference,size_ratio,lead,ambiguous\n".to_owned();
    for p in &d.pairs {
        let (source, target) = (quoted(&p.source), quoted(&p.target));
        text += &format!(
            "{source},{target},{},{},{},{}\n",
            p.difference, p.size_ratio, p.lead, p.ambiguous
        );
    }
    text
}
