//! A page again from the files of a run, without computing anything: `medial report DIR`.
//!
//! In: a folder with `scaffold.json`, `match.json` or `change.json`, with `run.json` and `scene.glb` when they are there. Out: the
//! [`Report`]. Without `scene.glb` the page has no picture and says so.

use super::glb::{GlbError, scene_from_glb};
use super::page::{NoteLevel, Report, ReportError};
use super::scene::Scene;
use super::{change_report, match_report, scaffold_report};
use serde_json::Value;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A folder whose page cannot be rebuilt.
#[derive(Debug, Error)]
pub enum RebuildError {
    /// None of the results is there.
    #[error("{}: holds no scaffold.json, match.json or change.json; give the folder that a command wrote with -o", folder.display())]
    NoResult {
        /// The folder.
        folder: PathBuf,
    },
    /// A file that cannot be read.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file that is not JSON.
    #[error("{}: not JSON: {source}; run the command again", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: serde_json::Error,
    },
    /// A scene that cannot be read.
    #[error("{}: {source}", path.display())]
    Scene {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: GlbError,
    },
    /// A result that lacks something.
    #[error(transparent)]
    Report(#[from] ReportError),
}

fn read(path: &Path) -> Result<Option<Vec<u8>>, RebuildError> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(RebuildError::Read {
            path: path.to_owned(),
            source,
        }),
    }
}

fn read_json(path: &Path) -> Result<Option<Value>, RebuildError> {
    let parse = |bytes: Vec<u8>| {
        serde_json::from_slice(&bytes).map_err(|source| RebuildError::Json {
            path: path.to_owned(),
            source,
        })
    };
    read(path)?.map(parse).transpose()
}

/// The report of the results in `folder`.
///
/// # Errors
/// See [`RebuildError`].
pub fn rebuild(folder: &Path) -> Result<Report, RebuildError> {
    type Page = fn(&str, &Value, &Value, Scene) -> Result<Report, ReportError>;
    let pages: [(&str, Page); 3] = [
        ("scaffold.json", scaffold_report),
        ("match.json", match_report),
        ("change.json", change_report),
    ];
    let run = read_json(&folder.join("run.json"))?.unwrap_or(Value::Null);
    let scene_path = folder.join("scene.glb");
    let scene = read(&scene_path)?
        .map(|bytes| {
            scene_from_glb(&bytes).map_err(|source| RebuildError::Scene {
                path: scene_path.clone(),
                source,
            })
        })
        .transpose()?;
    for (file, page) in pages {
        if let Some(result) = read_json(&folder.join(file))? {
            let title = title(&result, folder);
            let missing = scene.is_none();
            let mut report = page(&title, &result, &run, scene.unwrap_or_default())?;
            if missing {
                report.note(
                    NoteLevel::Warning,
                    "There is no scene.glb beside the result, so the page has no 3D picture.",
                );
            }
            return Ok(report);
        }
    }
    Err(RebuildError::NoResult {
        folder: folder.to_owned(),
    })
}

/// The heading that the command gave the page; without names in the result, that of the folder.
fn title(result: &Value, folder: &Path) -> String {
    let text = |field: &str| result.get(field).and_then(Value::as_str);
    match (text("name"), text("source"), text("target")) {
        (Some(name), _, _) => format!("Medial scaffold of {name}"),
        (None, Some(source), Some(target)) => format!("{source} on {target}"),
        _ if result.get("lesions").is_some() => super::change_report::title(result),
        _ => folder
            .file_name()
            .map_or_else(|| "result".to_owned(), |n| n.to_string_lossy().into_owned()),
    }
}
