//! Items of one shape under known deformations.

use super::shapes::mesh_item;
use super::{Content, DatasetSettings, Item, ItemTruth};
use crate::cloud::Cloud;
use crate::deform::crop::{crop_half_space, crop_half_spaces, random_direction, remove_ball, visible_from};
use crate::deform::{Kept, RigidMotion, Warp, rigid};
use crate::mesh::TriangleMesh;
use crate::sampling::{add_noise, add_outliers, mean_spacing};
use crate::shapes::Shape;
use glam::DVec3;

/// One shape, its blue-noise cloud, and both under known deformations, each in its own random pose.
pub(super) fn deformation_items(shape: &Shape, s: &DatasetSettings) -> Vec<Item> {
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
