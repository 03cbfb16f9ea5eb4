//! A data set as text and as files.
//!
//! In: a [`Dataset`]. Out: `truth.json` and one file an item, each written under a temporary name and renamed, so that a directory never holds half a file.

use super::{Content, Dataset, DatasetError, DatasetSettings, ItemTruth};
use crate::{nifti, ply};
use serde::Serialize;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct TruthFile<'a> {
    schema: &'static str,
    kind: String,
    description: &'static str,
    units: &'static str,
    frame: &'static str,
    settings: &'a DatasetSettings,
    items: Vec<TruthEntry<'a>>,
}

#[derive(Serialize)]
struct TruthEntry<'a> {
    file: &'a str,
    content: &'static str,
    #[serde(flatten)]
    truth: &'a ItemTruth,
}

impl Dataset {
    /// `truth.json` as text.
    pub fn truth_json(&self) -> String {
        let items = self
            .items
            .iter()
            .map(|item| TruthEntry {
                file: &item.file,
                content: match item.content {
                    Content::Mesh(_) => "mesh",
                    Content::Cloud(_) => "cloud",
                    Content::Mask(_) => "mask",
                },
                truth: &item.truth,
            })
            .collect();
        let file = TruthFile {
            schema: "synthetic-truth/1",
            kind: self.kind.to_string(),
            description: self.kind.description(),
            units: "mm",
            frame: "LPS",
            settings: &self.settings,
            items,
        };
        serde_json::to_string_pretty(&file).expect("truth holds only finite numbers, strings and lists")
    }

    /// Writes every file and `truth.json` into `directory`, which is made when missing. Each file is written under a temporary name and renamed.
    ///
    /// Returns the paths written.
    ///
    /// # Errors
    /// [`DatasetError::Write`] with the file that failed.
    pub fn write(&self, directory: &Path) -> Result<Vec<PathBuf>, DatasetError> {
        let failed = |path: &Path| {
            let path = path.to_path_buf();
            move |source| DatasetError::Write { path, source }
        };
        std::fs::create_dir_all(directory).map_err(failed(directory))?;
        let mut written = Vec::new();
        for item in &self.items {
            let path = directory.join(&item.file);
            // The extension stays last, because it decides on compression.
            let partial = directory.join(format!("partial-{}", item.file));
            save(&partial, &item.content).map_err(failed(&path))?;
            std::fs::rename(&partial, &path).map_err(failed(&path))?;
            written.push(path);
        }
        let path = directory.join("truth.json");
        let partial = directory.join("partial-truth.json");
        std::fs::write(&partial, self.truth_json()).map_err(failed(&path))?;
        std::fs::rename(&partial, &path).map_err(failed(&path))?;
        written.push(path);
        Ok(written)
    }
}

fn save(path: &Path, content: &Content) -> io::Result<()> {
    let ply_file = |write: &dyn Fn(&mut BufWriter<File>) -> io::Result<()>| -> io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        write(&mut file)?;
        file.flush()
    };
    match content {
        Content::Mesh(mesh) => ply_file(&|out| ply::write_mesh(out, mesh)),
        Content::Cloud(cloud) => ply_file(&|out| ply::write_cloud(out, cloud, false)),
        Content::Mask(mask) => nifti::save(path, mask),
    }
}
