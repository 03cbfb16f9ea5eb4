//! What a file holds, once it is in LPS millimetres.

use crate::geometry::TriangleMesh;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, path::PathBuf};

/// A shape as read: geometry in LPS mm and where it came from.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Short name for reports, the file stem by default.
    pub name: String,
    /// The geometry.
    pub geometry: Geometry,
    /// The file, its frame and units, its hash.
    pub provenance: Provenance,
    /// What a user should know about the file, in plain words.
    pub warnings: Vec<String>,
    /// What was done that is no reason to worry.
    pub notes: Vec<String>,
}

impl Shape {
    /// A shape made in memory, in LPS mm.
    pub fn generated(name: &str, geometry: Geometry) -> Self {
        Self {
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
}

/// The three kinds of input.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Unorganised points.
    Cloud(PointCloud),
    /// A surface mesh, as given: not welded, not oriented, not repaired.
    Mesh(TriangleMesh),
    /// A segmentation mask with one or many labels.
    Labels(LabelMap),
}

/// Points of a surface, with normals when the file has them (the method needs none).
#[derive(Clone, Debug, Default)]
pub struct PointCloud {
    /// Positions, mm.
    pub points: Vec<DVec3>,
    /// Unit normals, one a point, or empty.
    pub normals: Vec<DVec3>,
}

/// A label and how many voxels have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LabelCount {
    /// The label.
    pub label: i32,
    /// Its voxels.
    pub voxels: u64,
}

/// A label map on a regular, possibly anisotropic and oblique grid.
///
/// Voxel `(i, j, k)` is `values[i + dims[0] * (j + dims[1] * k)]`; its centre in LPS mm is
/// `origin + direction * (spacing_mm * (i, j, k))`.
#[derive(Clone, Debug)]
pub struct LabelMap {
    /// Voxels along i, j, k.
    pub dims: [usize; 3],
    /// Labels; 0 is background.
    pub values: Vec<i32>,
    /// Voxel size along i, j, k, mm.
    pub spacing_mm: DVec3,
    /// Centre of voxel (0, 0, 0), LPS mm.
    pub origin: DVec3,
    /// Unit directions of i, j, k as columns.
    pub direction: DMat3,
}

impl LabelMap {
    /// LPS mm position of (fractional) voxel indices.
    pub fn position(&self, index_vox: DVec3) -> DVec3 {
        self.origin + self.direction * (self.spacing_mm * index_vox)
    }

    /// The labels in use with their voxel counts, by label; background is left out.
    pub fn label_counts(&self) -> Vec<LabelCount> {
        let mut counts: BTreeMap<i32, u64> = BTreeMap::new();
        // Runs of equal voxels are long; counting them first spares most look-ups.
        for run in self.values.chunk_by(|a, b| a == b) {
            if run[0] != 0 {
                *counts.entry(run[0]).or_default() += run.len() as u64;
            }
        }
        counts
            .into_iter()
            .map(|(label, voxels)| LabelCount { label, voxels })
            .collect()
    }

    /// Volume of one voxel, mm^3.
    pub fn voxel_volume_mm3(&self) -> f64 {
        (self.spacing_mm.x * self.spacing_mm.y * self.spacing_mm.z * self.direction.determinant()).abs()
    }
}

/// The file formats read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum SourceFormat {
    Ply,
    Stl,
    Obj,
    Off,
    Xyz,
    Csv,
    VtkLegacy,
    Vtp,
    Medit,
    Gifti,
    Nifti,
    Nrrd,
    MetaImage,
    DicomSeg,
    /// Made in memory, not read.
    Generated,
}

/// Where a shape came from.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Provenance {
    /// Path as given on the command line.
    pub path: PathBuf,
    /// Format it was read as.
    pub format: SourceFormat,
    /// SHA-256 of the file's bytes, lower-case hex; empty for generated shapes.
    pub sha256: String,
    /// Frame of the file ("lps" or "ras") before conversion, and who said so.
    pub frame: String,
    /// Unit of the file before conversion.
    pub units: String,
}

/// Generators ready for the Delaunay stage.
#[derive(Clone, Debug, Default)]
pub struct Generators {
    /// Distinct points in lexicographic coordinate order, mm.
    pub points: Vec<DVec3>,
    /// For each point its index in the array it came from (cloud points, or samples of the known surface).
    pub source: Vec<u32>,
    /// The input's own surface, closed or not, when it has one (meshes and masks).
    pub known_surface: Option<TriangleMesh>,
    /// Mean spacing `sqrt(area / n)`, mm: of the known surface, or estimated from the cloud.
    pub spacing_mm: f64,
}
