//! Input: every real file is read, every format gives the same shape, every damaged file a clear error.

use medial_scaffold::input::{Geometry, ReadSettings, read_shape};
use std::path::{Path, PathBuf};

/// The folder of real shapes, or `None` with a word on the terminal.
fn data() -> Option<PathBuf> {
    let root = std::env::var_os("MEDIAL_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    if root.is_dir() {
        Some(root)
    } else {
        eprintln!("SKIPPED: the real shapes are not at {}", root.display());
        None
    }
}

fn walk(folder: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("a readable folder")
        .map(|e| e.expect("an entry").path())
        .collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            walk(&path, out);
        } else {
            out.push(path);
        }
    }
}

#[test]
fn every_real_file_is_read() {
    let Some(root) = data() else { return };
    let mut files = Vec::new();
    walk(&root, &mut files);
    let mut read = 0;
    for path in &files {
        let name = path.to_string_lossy().to_ascii_lowercase();
        let other = [".csv", ".md", ".txt", ".json", ".swc", "license"]
            .iter()
            .any(|e| name.ends_with(e));
        if other {
            continue;
        }
        let shape = read_shape(path, &ReadSettings::default()).unwrap_or_else(|e| panic!("{e}"));
        read += 1;
        let what = match &shape.geometry {
            Geometry::Cloud(c) => format!("cloud {} points {} normals", c.points.len(), c.normals.len()),
            Geometry::Mesh(m) => format!("mesh {} points {} triangles", m.points.len(), m.triangles.len()),
            Geometry::Labels(l) => format!(
                "labels {:?} {:?} det {}",
                l.dims,
                l.label_counts(),
                l.direction.determinant()
            ),
        };
        println!(
            "{}: {what}; {} {} {:?}",
            path.strip_prefix(&root).unwrap_or(path).display(),
            shape.provenance.frame,
            shape.provenance.units,
            shape.warnings
        );
    }
    println!("{read} files read");
    assert_eq!(read, 147);
}
