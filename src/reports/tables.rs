//! The tables of a page as CSV files, with all digits.
//!
//! In: a [`Report`]. Out: `tables/NAME.csv` beside it, one a table, named by its section and caption; settings and provenance are left
//! to `run.json`. Columns carry their units in the header: `volume [mm^3]` as `volume [mm\u{b3}]`, RFC 4180, UTF-8.

use super::atomic::WriteError;
use super::medial_files::write_csv;
use super::page::Report;
use std::path::{Path, PathBuf};

/// Writes every table of results into `folder/tables`; gives the files.
///
/// # Errors
/// When a file cannot be written.
pub fn write_tables(folder: &Path, report: &Report) -> Result<Vec<PathBuf>, WriteError> {
    let folder = folder.join("tables");
    let mut files: Vec<PathBuf> = Vec::new();
    for section in report.sections.iter().filter(|s| !s.record) {
        for table in &section.tables {
            let mut name = slug(&section.title);
            if section.tables.len() > 1 && !table.caption.is_empty() {
                name = format!("{name}-{}", slug(&table.caption));
            }
            let mut file = folder.join(format!("{name}.csv"));
            let mut n = 2;
            while files.contains(&file) {
                file = folder.join(format!("{name}-{n}.csv"));
                n += 1;
            }
            let rows: Vec<Vec<String>> = table
                .rows
                .iter()
                .map(|r| r.iter().map(|c| c.exact.clone()).collect())
                .collect();
            if files.is_empty() {
                std::fs::create_dir_all(&folder).map_err(|source| WriteError {
                    path: folder.clone(),
                    source,
                })?;
            }
            write_csv(&file, &table.header(), &rows)?;
            files.push(file);
        }
    }
    Ok(files)
}

/// Lower case, words joined by hyphens, at most 60 characters.
fn slug(text: &str) -> String {
    let lower = text.to_lowercase();
    let words = lower
        .split(|c: char| !c.is_alphanumeric())
        .filter(|w| !w.is_empty());
    let mut out = String::new();
    for word in words {
        if out.len() + word.len() >= 60 {
            break;
        }
        if !out.is_empty() {
            out.push('-');
        }
        out += word;
    }
    out
}
