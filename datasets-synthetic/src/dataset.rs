//! Whole data sets: files and the truth about them.
//!
//! [`generate`] makes a [`Dataset`] in memory for any [`ShapeKind`]; [`Dataset::write`] puts it into a directory: PLY for meshes and clouds, NIfTI for masks,
//! and `truth.json`. Everything in `truth.json` is exact or marked by how it was obtained (`mesh_volume_mm3` is the volume of the very polyhedron in the file).
//!
//! Motions are named by frames: `T_target_source` takes the coordinates of the file it stands with (the source) to those of its base (the target).

use crate::bones::{Bone, bone};
use crate::cloud::Cloud;
use crate::deform::crop::{crop_half_space, crop_half_spaces, random_direction, remove_ball, visible_from};
use crate::deform::growth::{Growth, GrowthKind, grow, random_lesion};
use crate::deform::{Kept, RigidMotion, Warp, rigid};
use crate::masks::{LabelMask, VoxelGrid, sphere_mask};
use crate::mesh::{MeshTopology, TriangleMesh};
use crate::population::{self, Mode, Population};
use crate::registry::ShapeKind;
use crate::sampling::{add_noise, add_outliers, mean_spacing};
use crate::shapes::{Shape, star_blob};
use crate::truth::Truth;
use crate::{nifti, ply};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, BufWriter, Write};
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

fn mesh_item(file: String, mesh: TriangleMesh, truth: ItemTruth) -> Item {
    let topology = mesh.topology();
    let mesh_volume_mm3 = topology.is_closed_oriented_manifold().then(|| mesh.volume());
    let truth = ItemTruth {
        topology: Some(topology),
        mesh_volume_mm3,
        ..truth
    };
    Item {
        file,
        content: Content::Mesh(mesh),
        truth,
    }
}

fn cloud_of(shape: &Shape, s: &DatasetSettings, seed: u64) -> Cloud {
    if s.poisson {
        shape.sample_poisson(s.points, seed)
    } else {
        shape.sample_uniform(s.points, seed)
    }
}

/// A mesh and a cloud of one shape.
fn shape_items(shape: &Shape, s: &DatasetSettings) -> Vec<Item> {
    let truth = ItemTruth {
        shape: shape.name.clone(),
        truth: Some(shape.truth.clone()),
        ..Default::default()
    };
    let mesh = shape.mesh(s.triangles);
    let area = shape.truth.area_mm2.unwrap_or_else(|| mesh.area());
    let clean = cloud_of(shape, s, s.seed);
    let noise_mm = s.noise_spacings * mean_spacing(area, clean.len());
    let noisy = add_noise(&clean.points, noise_mm, s.seed);
    let points = add_outliers(&noisy, s.outliers, 0.1, s.seed);
    let cloud_truth = ItemTruth {
        noise_mm: Some(noise_mm),
        outliers: Some(points.len() - noisy.len()),
        truth: None,
        ..truth.clone()
    };
    let cloud = Content::Cloud(Cloud::from_points(points));
    vec![
        mesh_item(format!("{}.ply", shape.name), mesh, truth),
        Item {
            file: format!("{}_cloud.ply", shape.name),
            content: cloud,
            truth: cloud_truth,
        },
    ]
}

/// The reference and its individuals as meshes of one connectivity.
fn family_items(family: &Population, s: &DatasetSettings) -> Vec<Item> {
    let reference = &family.reference;
    let name = &reference.name;
    let base = format!("{name}_reference.ply");
    let mesh = reference.mesh(s.triangles);
    let truth = ItemTruth {
        shape: name.clone(),
        truth: Some(reference.truth.clone()),
        modes: family.modes.clone(),
        ..Default::default()
    };
    let mut items = vec![mesh_item(base.clone(), mesh.clone(), truth)];
    for (i, individual) in family.individuals.iter().enumerate() {
        let truth = ItemTruth {
            shape: name.clone(),
            base: Some(base.clone()),
            same_indices: true,
            weights: Some(individual.weights.clone()),
            warp: Some(individual.warp.clone()),
            ..Default::default()
        };
        let moved = mesh.mapped(|p| individual.warp.apply(p));
        items.push(mesh_item(format!("{name}_{i:03}.ply"), moved, truth));
    }
    items
}

/// One shape, its blue-noise cloud, and both under known deformations, each in its own random pose.
fn deformation_items(shape: &Shape, s: &DatasetSettings) -> Vec<Item> {
    let maker = DeformationMaker::new(shape, s);
    let mut items = maker.base_items();
    items.extend(maker.meshes());
    items.extend(maker.clouds());
    items
}

struct DeformationMaker<'a> {
    shape: &'a Shape,
    settings: &'a DatasetSettings,
    mesh: TriangleMesh,
    cloud: Cloud,
    mesh_file: String,
    cloud_file: String,
}

impl<'a> DeformationMaker<'a> {
    fn new(shape: &'a Shape, settings: &'a DatasetSettings) -> Self {
        DeformationMaker {
            shape,
            settings,
            mesh: shape.mesh(settings.triangles),
            cloud: shape.sample_poisson(settings.points, settings.seed),
            mesh_file: format!("{}_base.ply", shape.name),
            cloud_file: format!("{}_base_cloud.ply", shape.name),
        }
    }

    fn base_items(&self) -> Vec<Item> {
        let truth = ItemTruth {
            shape: self.shape.name.clone(),
            truth: Some(self.shape.truth.clone()),
            ..Default::default()
        };
        let cloud_truth = ItemTruth {
            truth: None,
            ..truth.clone()
        };
        vec![
            mesh_item(self.mesh_file.clone(), self.mesh.clone(), truth),
            Item {
                file: self.cloud_file.clone(),
                content: Content::Cloud(self.cloud.clone()),
                truth: cloud_truth,
            },
        ]
    }

    fn pose(&self, key: u64) -> RigidMotion {
        rigid::random(self.settings.seed.wrapping_mul(1_000).wrapping_add(key))
    }

    fn truth(&self, base: &str, motion: &RigidMotion) -> ItemTruth {
        ItemTruth {
            shape: self.shape.name.clone(),
            base: Some(base.to_string()),
            T_target_source: Some(motion.inverse().to_rows()),
            mirrored: Some(motion.is_mirror()),
            ..Default::default()
        }
    }

    /// Whole bones: posed, mirrored, re-meshed, warped, bent, grown.
    fn meshes(&self) -> Vec<Item> {
        let bounds = self.shape.bounds();
        let diagonal = bounds.diagonal();
        let tip = bounds.centre() + 0.3 * bounds.size().x * DVec3::X;
        let seed = self.settings.seed;
        let smooth = |share: f64, key: u64| Warp::random_smooth(&bounds, share * diagonal, seed + key);
        let warps = [
            ("rigid", Warp::identity()),
            ("warp_1_percent", smooth(0.01, 1)),
            ("warp_3_percent", smooth(0.03, 2)),
            ("bend", Warp::bend_x(0.35 / bounds.size().x)),
            (
                "twist",
                Warp::Twist {
                    rate: 0.5 / bounds.size().x,
                },
            ),
            ("growth", Warp::swelling(tip, 0.2 * diagonal, 0.25)),
            ("shrinkage", Warp::swelling(tip, 0.2 * diagonal, -0.2)),
        ];
        let mut items = Vec::new();
        for (key, (name, warp)) in warps.into_iter().enumerate() {
            let motion = self.pose(key as u64);
            let mesh = self.mesh.mapped(|p| motion.apply(warp.apply(p)));
            let truth = ItemTruth {
                same_indices: true,
                warp: Some(warp),
                ..self.truth(&self.mesh_file, &motion)
            };
            items.push(mesh_item(format!("{}_{name}.ply", self.shape.name), mesh, truth));
        }
        let mirror = self.pose(20).after(&RigidMotion::mirror(DVec3::ZERO, DVec3::X));
        let mesh = self.mesh.mapped(|p| mirror.apply(p)).flipped();
        let truth = ItemTruth {
            same_indices: true,
            ..self.truth(&self.mesh_file, &mirror)
        };
        items.push(mesh_item(
            format!("{}_mirrored.ply", self.shape.name),
            mesh,
            truth,
        ));
        let motion = self.pose(21);
        let coarse = self
            .shape
            .mesh(self.settings.triangles / 3)
            .mapped(|p| motion.apply(p));
        let file = format!("{}_remeshed.ply", self.shape.name);
        items.push(mesh_item(file, coarse, self.truth(&self.mesh_file, &motion)));
        items
    }

    /// Clouds: noise, density, outliers, crops, visibility, missing parts.
    fn clouds(&self) -> Vec<Item> {
        let n = self.settings.points;
        let seed = self.settings.seed;
        let spacing = mean_spacing(self.mesh.area(), n);
        let diagonal = self.shape.bounds().diagonal();
        let mut items = Vec::new();
        for (k, level) in [0.25, 0.5, 1.0].into_iter().enumerate() {
            let sigma = level * spacing;
            let noisy = add_noise(&self.cloud.points, sigma, seed + k as u64);
            let truth = ItemTruth {
                noise_mm: Some(sigma),
                same_indices: true,
                ..Default::default()
            };
            items.push(self.posed(&format!("noise_{level}_spacing"), noisy, truth, 40 + k as u64));
        }
        let again = self.shape.sample_poisson(n / 2, seed + 77).points;
        items.push(self.posed("resampled", again, ItemTruth::default(), 45));
        let dense = self.shape.sample_density_gradient(n, 20.0, seed + 78).points;
        items.push(self.posed("density_1_to_20", dense, ItemTruth::default(), 46));
        let dirty = add_outliers(&self.cloud.points, 0.05, 0.1, seed);
        let truth = ItemTruth {
            outliers: Some(dirty.len() - n),
            same_indices: true,
            ..Default::default()
        };
        items.push(self.posed("outliers_5_percent", dirty, truth, 47));
        let direction = random_direction(seed);
        let cut = |share: f64| crop_half_space(&self.cloud, direction, share);
        let crops: Vec<(String, Kept)> = vec![
            ("half_space_66_a".into(), cut(2.0 / 3.0)),
            (
                "half_space_66_b".into(),
                crop_half_space(&self.cloud, -direction, 2.0 / 3.0),
            ),
            ("half_space_55".into(), cut(0.55)),
            ("half_space_35".into(), cut(0.35)),
            ("half_space_25".into(), cut(0.25)),
            (
                "three_cuts_50".into(),
                crop_half_spaces(&self.cloud, 3, 0.5, seed),
            ),
            (
                "one_sided".into(),
                visible_from(&self.cloud, &self.mesh, random_direction(seed + 1), 85.0),
            ),
            (
                "missing_part".into(),
                remove_ball(&self.cloud, self.cloud.points[0], 0.25 * diagonal),
            ),
        ];
        for (k, (name, kept)) in crops.into_iter().enumerate() {
            let truth = ItemTruth {
                correspondence: Some(kept.indices),
                share_left: Some(kept.share),
                ..Default::default()
            };
            items.push(self.posed(&name, kept.cloud.points, truth, 60 + k as u64));
        }
        items
    }

    fn posed(&self, name: &str, points: Vec<DVec3>, truth: ItemTruth, key: u64) -> Item {
        let motion = self.pose(key);
        let pose = self.truth(&self.cloud_file, &motion);
        let truth = ItemTruth {
            shape: pose.shape,
            base: pose.base,
            T_target_source: pose.T_target_source,
            mirrored: pose.mirrored,
            ..truth
        };
        let points = points.into_iter().map(|p| motion.apply(p)).collect();
        Item {
            file: format!("{}_{name}.ply", self.shape.name),
            content: Content::Cloud(Cloud::from_points(points)),
            truth,
        }
    }
}

/// Lesions before and after, as meshes and as masks on one grid and on an anisotropic one for the follow-up.
fn growth_items(s: &DatasetSettings) -> Vec<Item> {
    let mut items = Vec::new();
    for i in 0..s.individuals as u64 {
        let kind = GrowthKind::ALL[(i as usize + 1) % GrowthKind::ALL.len()];
        let percent = [10.0, 25.0, 40.0, 70.0][i as usize % 4];
        let lesion = random_lesion(8.0 + 2.0 * (i % 5) as f64, s.seed + i);
        let growth = grow(&lesion, kind, percent, s.seed + i);
        let name = format!("lesion_{i:03}_{}", kind.name());
        let before = star_blob(&name, growth.baseline.clone());
        let after = star_blob(&name, growth.followup.clone());
        let base_mesh = format!("{name}_baseline.ply");
        let base_mask = format!("{name}_baseline.nii.gz");
        let truth = |shape: &Shape| ItemTruth {
            shape: name.clone(),
            truth: Some(shape.truth.clone()),
            ..Default::default()
        };
        let change = |base: &str| ItemTruth {
            base: Some(base.to_string()),
            growth: Some(growth.clone()),
            ..truth(&after)
        };
        items.push(mesh_item(
            base_mesh.clone(),
            before.mesh(s.triangles),
            truth(&before),
        ));
        let follow = ItemTruth {
            same_indices: true,
            ..change(&base_mesh)
        };
        items.push(mesh_item(
            format!("{name}_followup.ply"),
            after.mesh(s.triangles),
            follow,
        ));
        let bounds = before.bounds().union(&after.bounds());
        let grid = VoxelGrid::around(&bounds, s.voxel_mm, 3);
        let thick = VoxelGrid::around(&bounds, s.voxel_mm * DVec3::new(1.0, 1.0, 4.0), 3);
        items.push(mask_item(base_mask.clone(), grid, &[&before], truth(&before)));
        items.push(mask_item(
            format!("{name}_followup.nii.gz"),
            grid,
            &[&after],
            change(&base_mask),
        ));
        items.push(mask_item(
            format!("{name}_followup_thick.nii.gz"),
            thick,
            &[&after],
            change(&base_mask),
        ));
    }
    items
}

/// A mask with the labels 1, 2, ... for some shapes; later ones win.
fn mask_item(file: String, grid: VoxelGrid, shapes: &[&Shape], truth: ItemTruth) -> Item {
    let mut mask = LabelMask::empty(grid);
    for (label, shape) in (1u16..).zip(shapes) {
        mask.fill(shape.field().expect("masks are made of solids"), label);
    }
    let label_volumes = (1u16..)
        .zip(shapes)
        .map(|(label, shape)| LabelVolume {
            label,
            true_mm3: shape.volume_mm3().expect("masks are made of solids"),
            voxels_mm3: mask.volume_mm3(label),
        })
        .collect();
    Item {
        file,
        content: Content::Mask(mask),
        truth: ItemTruth {
            label_volumes,
            ..truth
        },
    }
}

fn mask_items(s: &DatasetSettings) -> Vec<Item> {
    let mut items = Vec::new();
    for diameter in [4, 6, 8, 12, 16, 24, 32, 48, 64] {
        for (name, spacing) in [("isotropic", DVec3::ONE), ("1_1_5", DVec3::new(1.0, 1.0, 5.0))] {
            let mask = sphere_mask(diameter as f64, spacing);
            let true_mm3 = std::f64::consts::PI / 6.0 * (diameter as f64).powi(3);
            let volume = LabelVolume {
                label: 1,
                true_mm3,
                voxels_mm3: mask.volume_mm3(1),
            };
            let truth = ItemTruth {
                shape: "sphere".into(),
                truth: Some(crate::shapes::sphere(0.5 * diameter as f64).truth),
                label_volumes: vec![volume],
                ..Default::default()
            };
            let file = format!("sphere_{diameter:02}_{name}.nii.gz");
            items.push(Item {
                file,
                content: Content::Mask(mask),
                truth,
            });
        }
    }
    let shape = bone(Bone::Scaphoid, s.seed);
    let other = bone(Bone::Lunate, s.seed).moved(&RigidMotion {
        translation: DVec3::new(0.0, -22.0, 3.0),
        ..RigidMotion::default()
    });
    let bounds = shape.bounds().union(&other.bounds());
    let grid = VoxelGrid::around(&bounds, s.voxel_mm, 3);
    let thick = VoxelGrid::around(&bounds, s.voxel_mm * DVec3::new(1.0, 1.0, 3.0), 3);
    let oblique = grid.turned(rigid::random_of_angle(s.seed + 5, 20.0).rotation);
    for (name, grid) in [("isotropic", grid), ("thick", thick), ("oblique", oblique)] {
        let truth = ItemTruth {
            shape: "scaphoid and lunate".into(),
            ..Default::default()
        };
        items.push(mask_item(
            format!("two_bones_{name}.nii.gz"),
            grid,
            &[&shape, &other],
            truth,
        ));
    }
    items
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
