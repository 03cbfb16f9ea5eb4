//! Items of single shapes and of families of them: a mesh, a cloud, and the individuals of a population.

use super::{Content, DatasetSettings, Item, ItemTruth};
use crate::cloud::Cloud;
use crate::mesh::TriangleMesh;
use crate::population::Population;
use crate::sampling::{add_noise, add_outliers, mean_spacing};
use crate::shapes::Shape;

pub(super) fn mesh_item(file: String, mesh: TriangleMesh, truth: ItemTruth) -> Item {
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
pub(super) fn shape_items(shape: &Shape, s: &DatasetSettings) -> Vec<Item> {
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
pub(super) fn family_items(family: &Population, s: &DatasetSettings) -> Vec<Item> {
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
