//! What several integration tests share: running the command, small shapes, and where real shapes are.
#![allow(dead_code)] // Each test binary uses its own part.

use medial_scaffold::geometry::TriangleMesh;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs `medial` with these arguments.
pub fn medial(args: &[&str]) -> Output {
    Command::new(assert_cmd::cargo::cargo_bin!("medial"))
        .args(args)
        .output()
        .expect("the binary was built with the tests")
}

/// What it wrote to stderr.
pub fn stderr(out: &Output) -> String {
    String::from_utf8_lossy(&out.stderr).into_owned()
}

/// A capitate-like bone, closed, in mm.
pub fn bone() -> TriangleMesh {
    let mesh = datasets_synthetic::bones::capitate_like(0).mesh(6_000);
    TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    }
}

/// Folder of real shapes: `MEDIAL_DATA`, or `../shared/data` beside the workspace; says so when there is none.
pub fn real_data() -> Option<PathBuf> {
    let dir = std::env::var_os("MEDIAL_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    if dir.is_dir() {
        return Some(dir);
    }
    eprintln!("SKIPPED: no real shapes at {}; set MEDIAL_DATA", dir.display());
    None
}

/// Writes an ASCII PLY.
pub fn write_ply(path: &Path, mesh: &TriangleMesh) {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.points.len(),
        mesh.triangles.len()
    );
    for p in &mesh.points {
        text += &format!("{} {} {}\n", p.x, p.y, p.z);
    }
    for t in &mesh.triangles {
        text += &format!("3 {} {} {}\n", t[0], t[1], t[2]);
    }
    std::fs::File::create(path)
        .and_then(|mut f| f.write_all(text.as_bytes()))
        .expect("writable");
}

/// Whether the long sweeps were asked for.
pub fn slow() -> bool {
    std::env::var_os("MEDIAL_SLOW").is_some_and(|v| v == "1")
}
