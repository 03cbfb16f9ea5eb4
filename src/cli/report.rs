//! `medial report`: makes the page of a result folder again from its JSON and its scene.

use super::common::Common;
use super::output::print_text;
use super::{Failure, Verdict};
use clap::Args;
use medial_scaffold::reports::{change_report, match_report, scaffold_report, scene_from_glb, write_bytes};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Arguments of `medial report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Folder with run.json, scene.glb and scaffold.json, match.json or change.json.
    folder: PathBuf,
}

/// Runs the command.
pub fn run(args: &ReportArgs, common: &Common) -> Result<Verdict, Failure> {
    let dir = &args.folder;
    let run = read_json(&dir.join("run.json"))?;
    let glb = dir.join("scene.glb");
    let bytes = std::fs::read(&glb).map_err(|e| Failure::usage(format!("{}: {e}", glb.display())))?;
    let scene = scene_from_glb(&bytes).map_err(|e| Failure::usage(format!("{}: {e}", glb.display())))?;
    let kind = ["scaffold", "match", "change"]
        .into_iter()
        .find(|k| dir.join(format!("{k}.json")).is_file());
    let Some(kind) = kind else {
        return Err(Failure::usage(format!(
            "{}: holds none of scaffold.json, match.json, change.json; give the folder that -o named",
            dir.display()
        )));
    };
    let json = read_json(&dir.join(format!("{kind}.json")))?;
    let text = |field: &str| {
        json.get(field)
            .and_then(Value::as_str)
            .unwrap_or("a shape")
            .to_owned()
    };
    let report = match kind {
        "scaffold" => scaffold_report(
            &format!("Medial scaffold of {}", text("name")),
            &json,
            &run,
            scene,
        )?,
        "match" => match_report(
            &format!("{} on {}", text("source"), text("target")),
            &json,
            &run,
            scene,
        )?,
        _ => change_report("Change over time", &json, &run, scene)?,
    };
    let page = dir.join("report.html");
    write_bytes(&page, report.html()?)?;
    if !common.quiet {
        print_text(&format!("{}\n", page.display()))?;
    }
    Ok(Verdict::Fine)
}

fn read_json(path: &Path) -> Result<Value, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| Failure::usage(format!("{}: {e}; give the folder that -o named", path.display())))?;
    serde_json::from_str(&text).map_err(|e| Failure::usage(format!("{}: {e}", path.display())))
}
