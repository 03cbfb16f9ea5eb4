//! Items that are masks: lesions at two dates, spheres of many sizes, two bones on grids of several kinds.

use super::shapes::mesh_item;
use super::{Content, DatasetSettings, Item, ItemTruth, LabelVolume};
use crate::bones::{Bone, bone};
use crate::deform::growth::{GrowthKind, grow, random_lesion};
use crate::deform::{RigidMotion, rigid};
use crate::masks::{LabelMask, VoxelGrid, sphere_mask};
use crate::shapes::{Shape, star_blob};
use glam::DVec3;

/// Lesions before and after, as meshes and as masks on one grid and on an anisotropic one for the follow-up.
pub(super) fn growth_items(s: &DatasetSettings) -> Vec<Item> {
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

pub(super) fn mask_items(s: &DatasetSettings) -> Vec<Item> {
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
