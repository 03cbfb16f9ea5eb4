//! `medial report`: makes the page and the tables of a result folder again from its JSON and its scene.

use super::common::Common;
use super::output::print_text;
use super::{Failure, Verdict};
use clap::Args;
use medial_scaffold::reports::{rebuild, write_bytes, write_tables};
use std::path::PathBuf;

/// Arguments of `medial report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Folder with run.json, scene.glb and scaffold.json, match.json or change.json.
    folder: PathBuf,
}

/// Runs the command.
pub fn run(args: &ReportArgs, common: &Common) -> Result<Verdict, Failure> {
    let report = rebuild(&args.folder)?;
    write_tables(&args.folder, &report)?;
    let page = args.folder.join("report.html");
    write_bytes(&page, report.html()?)?;
    if !common.quiet {
        print_text(&format!("{}\n", page.display()))?;
    }
    Ok(Verdict::Fine)
}
