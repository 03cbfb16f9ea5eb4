//! Any bytes as a file: every reader gives a shape that later stages can take, or an error that names a place.
//!
//! The first two bytes choose a valid file of every flavour of every format, or none; the next one says how the rest is read: as
//! edits of that file (place, kind, byte), behind a part of it, or as the whole file under its name. What is read is checked and,
//! when it is a mesh, repaired. Run with `RUSTC_BOOTSTRAP=1 cargo fuzz run readers -- -max_len=400 -max_total_time=900`.
#![no_main]

#[path = "../../tests/input_files/mod.rs"]
#[allow(dead_code)]
mod input_files;

use input_files::File;
use libfuzzer_sys::fuzz_target;
use medial_scaffold::input::{Geometry, ReadSettings, RepairSettings, check, read_bytes, repair};
use std::path::Path;
use std::sync::OnceLock;

/// Names for files that are nothing but the given bytes.
const NAMES: [&str; 16] = [
    "a.ply", "a.stl", "a.obj", "a.off", "a.xyz", "a.csv", "a.vtk", "a.vtp", "a.mesh", "a.gii", "a.nii",
    "a.nrrd", "a.mha", "a.dcm", "a.ply.gz", "a",
];

fuzz_target!(|data: &[u8]| {
    static FILES: OnceLock<Vec<File>> = OnceLock::new();
    let files = FILES.get_or_init(input_files::all);
    let [which, how, label, rest @ ..] = data else {
        return;
    };
    let file = &files[usize::from(*which) % files.len()];
    let (name, bytes) = match how % 8 {
        0 => (NAMES[usize::from(*which) % NAMES.len()], rest.to_vec()),
        1 => {
            let kept = file.bytes.len() * usize::from(how / 8) / 32;
            (file.name, [&file.bytes[..kept], rest].concat())
        }
        _ => (file.name, edited(&file.bytes, rest)),
    };
    let settings = ReadSettings {
        label: (label & 1 == 1).then_some(i32::from(label / 2)),
        max_voxels: 1 << 16,
        ..ReadSettings::default()
    };
    let Ok(shape) = read_bytes(Path::new(name), &bytes, &settings) else {
        return;
    };
    check(&shape);
    let (points, mesh) = match &shape.geometry {
        Geometry::Cloud(cloud) => (&cloud.points, None),
        Geometry::Mesh(mesh) => (&mesh.points, Some(mesh)),
        Geometry::Labels(map) => {
            assert_eq!(map.dims.iter().product::<usize>(), map.values.len());
            assert!(map.spacing_mm.is_finite() && map.spacing_mm.min_element() > 0.0);
            return;
        }
    };
    assert!(points.iter().all(|p| p.is_finite()), "{name}");
    let Some(mesh) = mesh else {
        return;
    };
    let within = |mesh: &medial_scaffold::geometry::TriangleMesh| {
        let n = mesh.points.len();
        mesh.triangles.as_flattened().iter().all(|&v| (v as usize) < n)
    };
    assert!(within(mesh), "{name}");
    assert!(within(&repair(mesh, &RepairSettings::default()).mesh), "{name}");
});

/// A file with a few edits, four bytes each: two for the place, what to do, and a byte.
fn edited(file: &[u8], edits: &[u8]) -> Vec<u8> {
    let mut out = file.to_vec();
    for edit in edits.chunks_exact(4) {
        if out.is_empty() {
            break;
        }
        let at = usize::from(u16::from_le_bytes([edit[0], edit[1]])) % out.len();
        let byte = edit[3];
        match edit[2] % 6 {
            0 => out[at] = byte,
            1 => out.insert(at, byte),
            2 => {
                out.remove(at);
            }
            3 => out[at] ^= 1 << (byte % 8),
            4 => out.truncate(at),
            // Digits are where text formats keep their counts and indices.
            _ => out[at] = b"0123456789-+.eE nan"[usize::from(byte) % 19],
        }
    }
    out
}
