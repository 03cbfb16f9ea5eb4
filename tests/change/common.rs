//! What the tests of change share: real scans when they are there, masks drawn on grids at random places.

use glam::{DMat3, DVec3};
use medial_scaffold::change::error_model::volume_error;
use medial_scaffold::change::morphology::{Measures, measure};
use medial_scaffold::change::region::regions;
use medial_scaffold::change::{Change, ChangeSettings, change};
use medial_scaffold::input::shape::{Geometry, LabelMap, Provenance, Shape, SourceFormat};
use medial_scaffold::input::{ReadSettings, read_shape};
use rand::{Rng, RngExt};
use std::f64::consts::PI;
use std::path::PathBuf;

pub fn slow() -> bool {
    std::env::var_os("MEDIAL_SLOW").is_some_and(|v| v == "1")
}

pub fn data(path: &str) -> Option<PathBuf> {
    let root = std::env::var_os("MEDIAL_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    let file = root.join(path);
    if file.exists() {
        return Some(file);
    }
    println!("SKIPPED: no {path} (set MEDIAL_DATA to the folder of real shapes)");
    None
}

pub fn read(path: &str) -> Option<Shape> {
    let file = data(path)?;
    Some(read_shape(&file, &ReadSettings::default()).unwrap_or_else(|e| panic!("{e}")))
}

pub fn shape(name: &str, geometry: Geometry) -> Shape {
    Shape {
        name: name.to_owned(),
        geometry,
        provenance: Provenance {
            path: PathBuf::from(name),
            format: SourceFormat::Generated,
            sha256: String::new(),
            frame: "lps".to_owned(),
            units: "mm".to_owned(),
        },
        warnings: Vec::new(),
        notes: Vec::new(),
    }
}

/// A grid that covers a box about the origin, its voxels at a random place.
#[derive(Clone, Copy)]
pub struct Grid {
    pub dims: [usize; 3],
    pub spacing: DVec3,
    pub origin: DVec3,
}

impl Grid {
    pub fn about(half: f64, spacing: DVec3, rng: &mut impl Rng) -> Self {
        let shift = DVec3::new(rng.random::<f64>(), rng.random::<f64>(), rng.random::<f64>()) * spacing;
        let dims = (DVec3::splat(2.0 * half) / spacing)
            .to_array()
            .map(|n| n.ceil() as usize + 4);
        Self {
            dims,
            spacing,
            origin: -DVec3::splat(half) - spacing - shift,
        }
    }

    pub fn labels(&self, label: impl Fn(DVec3) -> i32) -> Shape {
        let [nx, ny, nz] = self.dims;
        let mut values = Vec::with_capacity(nx * ny * nz);
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    let v = DVec3::new(i as f64, j as f64, k as f64);
                    values.push(label(self.origin + self.spacing * v));
                }
            }
        }
        shape(
            "made",
            Geometry::Labels(LabelMap {
                dims: self.dims,
                values,
                spacing_mm: self.spacing,
                origin: self.origin,
                direction: DMat3::IDENTITY,
            }),
        )
    }

    pub fn mask(&self, inside: impl Fn(DVec3) -> bool) -> Shape {
        self.labels(|p| i32::from(inside(p)))
    }
}

pub fn ball_volume(r: f64) -> f64 {
    4.0 / 3.0 * PI * r * r * r
}

pub fn only(shape: &Shape, settings: &ChangeSettings) -> (Measures, f64) {
    let found = regions(shape, settings).expect("a solid");
    assert_eq!(found.len(), 1);
    let m = measure(&found[0]);
    let sd = volume_error(&found[0], &m, settings).sd_mm3;
    (m, sd)
}

/// The change between two solids.
pub fn run(a: Shape, b: Shape) -> Change {
    change(&a, &b, &ChangeSettings::default()).expect("two solids")
}
