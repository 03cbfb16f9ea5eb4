//! Whole data sets: files and the truth about them.
//!
//! [`generate`] makes a [`Dataset`] in memory for any [`ShapeKind`]; [`Dataset::write`] puts it into a directory: PLY for meshes and clouds, NIfTI for masks,
//! and `truth.json`. Everything in `truth.json` is exact or marked by how it was obtained (`mesh_volume_mm3` is the volume of the very polyhedron in the file).
//!
//! `shapes` makes the items of single shapes and populations, `deformations` those of one shape deformed, `masks` those on voxel grids; `write` puts
//! them into files.
//!
//! Motions are named by frames: `T_target_source` takes the coordinates of the file it stands with (the source) to those of its base (the target).

mod deformations;
mod masks;
mod shapes;
mod write;

use crate::bones::{Bone, bone};
use crate::cloud::Cloud;
use crate::deform::Warp;
use crate::deform::growth::Growth;
use crate::masks::LabelMask;
use crate::mesh::{MeshTopology, TriangleMesh};
use crate::population::{self, Mode};
use crate::registry::ShapeKind;
use crate::truth::Truth;
use deformations::deformation_items;
use glam::DVec3;
use masks::{growth_items, mask_items};
use serde::{Deserialize, Serialize};
use shapes::{family_items, shape_items};
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Settings of [`generate`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DatasetSettings {
    /// Seed of everything random; for bones 0 is the reference individual.
    pub seed: u64,
    /// Triangles of a mesh, about.
    pub triangles: usize,
    /// Points of a cloud.
    pub points: usize,
    /// Blue-noise instead of independent points.
    pub poisson: bool,
    /// Standard deviation of the noise on clouds, a coordinate, in units of the spacing.
    pub noise_spacings: f64,
    /// Outliers on clouds, as a share of the points.
    pub outliers: f64,
    /// Individuals of each shape in a population or family.
    pub individuals: usize,
    /// Voxel size of masks, mm.
    pub voxel_mm: DVec3,
}

impl Default for DatasetSettings {
    /// Sizes at which every stage takes about a second.
    fn default() -> Self {
        DatasetSettings {
            seed: 0,
            triangles: 10_000,
            points: 5_000,
            poisson: true,
            noise_spacings: 0.0,
            outliers: 0.0,
            individuals: 5,
            voxel_mm: DVec3::new(0.5, 0.5, 0.5),
        }
    }
}

/// Why a data set was not made or written.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// A file could not be written.
    #[error("{path}: cannot be written: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A setting is out of range.
    #[error("{name} is {value}, but must be {wanted}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        wanted: &'static str,
    },
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// A mesh, written as PLY.
    Mesh(TriangleMesh),
    /// A cloud, written as PLY without normals.
    Cloud(Cloud),
    /// A mask, written as compressed NIfTI.
    Mask(LabelMask),
}

/// A file of a data set with its truth.
#[derive(Clone, Debug)]
pub struct Item {
    /// File name.
    pub file: String,
    /// What is in it.
    pub content: Content,
    /// What is true of it.
    pub truth: ItemTruth,
}

/// What is true of one file.
#[allow(non_snake_case)]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ItemTruth {
    /// The shape it shows.
    pub shape: String,
    /// Exact facts about that shape.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<Truth>,
    /// Topology of the mesh in the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topology: Option<MeshTopology>,
    /// Volume of the polyhedron in the file, mm^3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh_volume_mm3: Option<f64>,
    /// File that this one was made from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    /// Takes the coordinates of this file to those of its base: 4 x 4, rows, column vectors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub T_target_source: Option<[[f64; 4]; 4]>,
    /// The motion is a mirror image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirrored: Option<bool>,
    /// Smooth map from the base to this file, before the motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warp: Option<Warp>,
    /// Point `i` of this file is the image of point `correspondence[i]` of the base (`None`: not point by point; mesh vertices correspond by index when `same_indices`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correspondence: Option<Vec<u32>>,
    /// Points of this file and of the base correspond by index.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub same_indices: bool,
    /// Share of the base's points that is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share_left: Option<f64>,
    /// Standard deviation of the noise a coordinate, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_mm: Option<f64>,
    /// Number of outliers, the last points of the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outliers: Option<usize>,
    /// Weights of the population's modes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<Vec<f64>>,
    /// Modes in the order of the weights.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<Mode>,
    /// Change between two dates, on the follow-up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub growth: Option<Growth>,
    /// True volume of every label of a mask, mm^3.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub label_volumes: Vec<LabelVolume>,
}

/// True and counted volume of a label.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelVolume {
    /// The label.
    pub label: u16,
    /// Volume of the solid, mm^3.
    pub true_mm3: f64,
    /// Voxels that carry it times their volume, mm^3.
    pub voxels_mm3: f64,
}

/// A data set in memory.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// What it is.
    pub kind: ShapeKind,
    /// How it was made.
    pub settings: DatasetSettings,
    /// Its files.
    pub items: Vec<Item>,
}

/// Makes a data set.
///
/// # Errors
/// [`DatasetError::Setting`] for settings out of range.
///
/// # Example
/// ```
/// use datasets_synthetic::dataset::{DatasetSettings, generate};
/// let settings = DatasetSettings { triangles: 1_000, points: 500, ..Default::default() };
/// let data = generate("torus".parse()?, &settings)?;
/// assert_eq!(data.items.len(), 2); // mesh and cloud
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn generate(kind: ShapeKind, settings: &DatasetSettings) -> Result<Dataset, DatasetError> {
    check(settings)?;
    let s = settings;
    let items = match kind {
        ShapeKind::Bones => Bone::ALL
            .iter()
            .flat_map(|&b| shape_items(&bone(b, s.seed), s))
            .collect(),
        ShapeKind::Population => Bone::ALL
            .iter()
            .flat_map(|&b| family_items(&population::population(&bone(b, 0), s.individuals, s.seed + 1), s))
            .collect(),
        ShapeKind::OneModeFamily => family_items(&population::one_mode_ellipsoids(s.individuals), s),
        ShapeKind::TwoModeFamily => family_items(&population::two_mode_ellipsoids(s.individuals), s),
        ShapeKind::Deformations => deformation_items(&bone(Bone::Capitate, s.seed), s),
        ShapeKind::Growth => growth_items(s),
        ShapeKind::Masks => mask_items(s),
        single => {
            let shape = single
                .shape(s.seed)
                .expect("kinds that are not families are one shape");
            shape_items(&shape, s)
        }
    };
    Ok(Dataset {
        kind,
        settings: settings.clone(),
        items,
    })
}

/// Makes a data set and writes it; see [`generate`] and [`Dataset::write`].
///
/// # Errors
/// Those of both.
pub fn write_dataset(
    kind: ShapeKind,
    settings: &DatasetSettings,
    directory: &Path,
) -> Result<Vec<PathBuf>, DatasetError> {
    generate(kind, settings)?.write(directory)
}

fn check(s: &DatasetSettings) -> Result<(), DatasetError> {
    let bad = |name, value: String, wanted| Err(DatasetError::Setting { name, value, wanted });
    if !(20..=10_000_000).contains(&s.triangles) {
        return bad("triangles", s.triangles.to_string(), "from 20 to 10 million");
    }
    if !(1..=50_000_000).contains(&s.points) {
        return bad("points", s.points.to_string(), "from 1 to 50 million");
    }
    if !(s.noise_spacings >= 0.0 && s.noise_spacings.is_finite()) {
        return bad(
            "noise_spacings",
            s.noise_spacings.to_string(),
            "zero or a positive number",
        );
    }
    if !(0.0..=10.0).contains(&s.outliers) {
        return bad("outliers", s.outliers.to_string(), "a share from 0 to 10");
    }
    if s.individuals == 0 || s.individuals > 100_000 {
        return bad("individuals", s.individuals.to_string(), "from 1 to 100 000");
    }
    if !(s.voxel_mm.min_element() >= 0.05 && s.voxel_mm.max_element() <= 100.0) {
        return bad(
            "voxel_mm",
            s.voxel_mm.to_string(),
            "from 0.05 to 100 mm along every axis",
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> DatasetSettings {
        DatasetSettings {
            triangles: 400,
            points: 300,
            individuals: 2,
            voxel_mm: DVec3::splat(1.0),
            ..Default::default()
        }
    }

    #[test]
    fn every_family_can_be_made_and_files_are_unique() {
        use ShapeKind::*;
        let kinds = [
            Box,
            MoebiusBand,
            Bones,
            Population,
            OneModeFamily,
            TwoModeFamily,
            Deformations,
            Growth,
            Masks,
        ];
        for kind in kinds {
            let data = generate(kind, &small()).expect("settings are in range");
            let mut files: Vec<&str> = data.items.iter().map(|i| i.file.as_str()).collect();
            let count = files.len();
            files.sort_unstable();
            files.dedup();
            assert!(
                count > 0 && files.len() == count,
                "{kind}: {count} files, {} names",
                files.len()
            );
            let json: serde_json::Value = serde_json::from_str(&data.truth_json()).expect("valid JSON");
            assert_eq!(json["items"].as_array().map(Vec::len), Some(count), "{kind}");
        }
    }

    /// Each posed cloud goes back onto its base by the matrix in the truth.
    #[test]
    fn deformations_go_back_by_their_truth() {
        let data = generate(ShapeKind::Deformations, &small()).expect("settings are in range");
        let base_of = |name: &str| {
            data.items
                .iter()
                .find(|i| i.file == name)
                .expect("the base is in the set")
        };
        let mut checked = 0;
        for item in &data.items {
            let (Content::Cloud(cloud), Some(rows), Some(base)) =
                (&item.content, item.truth.T_target_source, &item.truth.base)
            else {
                continue;
            };
            let Some(pairs) = &item.truth.correspondence else {
                continue;
            };
            let Content::Cloud(target) = &base_of(base).content else {
                panic!("clouds come from clouds")
            };
            for (p, &i) in cloud.points.iter().zip(pairs) {
                let q: [f64; 3] = std::array::from_fn(|r| {
                    rows[r][0] * p.x + rows[r][1] * p.y + rows[r][2] * p.z + rows[r][3]
                });
                assert!(
                    DVec3::from_array(q).distance(target.points[i as usize]) < 1e-9,
                    "{}",
                    item.file
                );
            }
            checked += 1;
        }
        assert_eq!(checked, 8);
    }

    #[test]
    fn settings_are_checked() {
        let bad = DatasetSettings {
            outliers: f64::NAN,
            ..small()
        };
        let error = generate(ShapeKind::Sphere, &bad).expect_err("NaN is no share");
        assert!(error.to_string().contains("outliers"), "{error}");
    }

    #[test]
    fn files_are_written_whole_and_the_same_twice() {
        let directory = std::env::temp_dir().join(format!("datasets-synthetic-{}", std::process::id()));
        let mut before: Option<Vec<Vec<u8>>> = None;
        for _ in 0..2 {
            let files =
                write_dataset(ShapeKind::Growth, &small(), &directory).expect("the directory is writable");
            assert_eq!(files.len(), 11);
            let bytes: Vec<Vec<u8>> = files
                .iter()
                .map(|f| std::fs::read(f).expect("just written"))
                .collect();
            if let Some(before) = &before {
                assert!(*before == bytes);
            }
            before = Some(bytes);
        }
        std::fs::remove_dir_all(&directory).expect("made by this test");
    }
}
