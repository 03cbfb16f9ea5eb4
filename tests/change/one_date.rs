//! Measures of one date against exact solids, published reference values and a peer's own values.

use crate::common::{Grid, ball_volume, data, only, read, slow};
use glam::DVec3;
use medial_scaffold::change::ChangeSettings;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

#[test]
fn sphere_masks_have_their_volume_area_and_diameter() {
    println!("| voxels across | grid | voxel count | marching cubes | area, smooth surface | diameter 3D |");
    println!("|---|---|---|---|---|---|");
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let sizes: &[f64] = if slow() {
        &[4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0]
    } else {
        &[4.0, 8.0, 16.0, 32.0]
    };
    for (grid_name, spacing) in [("1:1:1", DVec3::ONE), ("1:1:5", DVec3::new(1.0, 1.0, 5.0))] {
        for &across in sizes {
            let r = 0.5 * across * spacing.z.max(1.0);
            // A mask of a 1:1:5 sphere is five times as wide in voxels in its slices.
            let places = if across > 20.0 { 6 } else { 24 };
            let mut mean = [0.0; 4];
            let mut worst = 0f64;
            for _ in 0..places {
                let s = Grid::about(r, spacing, &mut rng).mask(|p| p.length() <= r);
                let m = only(&s, &ChangeSettings::default()).0;
                let percent = |v: f64, truth: f64| 100.0 * (v / truth - 1.0);
                let row = [
                    percent(m.volume_voxel.expect("a mask"), ball_volume(r)),
                    percent(m.volume_mesh, ball_volume(r)),
                    percent(m.area_smooth, 4.0 * PI * r * r),
                    m.diameter_3d - 2.0 * r,
                ];
                worst = worst.max(row[0].abs());
                for k in 0..4 {
                    mean[k] += row[k] / places as f64;
                }
            }
            println!(
                "| {across} | {grid_name} | {:+.2} % (worst {worst:.2}) | {:+.2} % | {:+.2} % | {:+.2} mm |",
                mean[0], mean[1], mean[2], mean[3]
            );
            if across >= 16.0 {
                assert!(
                    mean[0].abs() < 0.5,
                    "volume of {across} voxels, {grid_name}: {} %",
                    mean[0]
                );
                // Slices five times as thick as their voxels leave steps that smoothing by a voxel cannot take away.
                let most = if spacing.z > 1.0 { 6.0 } else { 2.0 };
                assert!(
                    mean[1].abs() < 0.5,
                    "mesh volume of {across} voxels, {grid_name}: {} %",
                    mean[1]
                );
                assert!(
                    mean[2].abs() < most,
                    "area of {across} voxels, {grid_name}: {} %",
                    mean[2]
                );
            }
        }
    }
}

#[test]
fn the_digital_phantom_has_its_published_morphology() {
    let (Some(mask), Some(table)) = (
        read("ibsi_digital_phantom_ccby4/mask.nii.gz"),
        data("ibsi_digital_phantom_ccby4/reference_morphology.csv"),
    ) else {
        return;
    };
    let (m, _) = only(&mask, &ChangeSettings::default());
    let mut reader = csv::Reader::from_path(table).expect("a table");
    println!("| feature | reference | ours |\n|---|---|---|");
    let mut checked = 0;
    for row in reader.records() {
        let row = row.expect("a row");
        let ours = match &row[0] {
            "Volume (mesh)" => m.volume_mesh,
            "Volume (voxel counting)" => m.volume_voxel.expect("a mask"),
            "Surface area (mesh)" => m.area,
            "Surface to volume ratio" => m.surface_to_volume,
            "Sphericity" => m.sphericity,
            "Maximum 3D diameter" => m.diameter_3d,
            "Major axis length" => m.axis_major,
            "Minor axis length" => m.axis_minor,
            "Least axis length" => m.axis_least,
            "Elongation" => m.elongation,
            "Flatness" => m.flatness,
            _ => continue,
        };
        let (value, tolerance): (f64, f64) = (
            row[2].parse().expect("a value"),
            row[3].parse().expect("a tolerance"),
        );
        println!("| {} | {value} ± {tolerance} | {ours:.4} |", &row[0]);
        assert!(
            (ours - value).abs() <= tolerance,
            "{}: {ours} for {value} ± {tolerance}",
            &row[0]
        );
        checked += 1;
    }
    assert_eq!(checked, 11);
}

#[test]
fn a_peers_own_values_come_out() {
    let Some(table) = data("tumour_pyradiomics_bsd3/baseline_shape.csv") else {
        return;
    };
    let mut reader = csv::Reader::from_path(table).expect("a table");
    let header = reader.headers().expect("a header").clone();
    let rows: Vec<csv::StringRecord> = reader.records().map(|r| r.expect("a row")).collect();
    println!("| case | feature | peer | ours | difference |\n|---|---|---|---|---|");
    for case in ["brain1", "breast1", "lung1"] {
        let Some(mask) = read(&format!("tumour_pyradiomics_bsd3/{case}_label.nrrd")) else {
            return;
        };
        let (m, _) = only(
            &mask,
            &ChangeSettings {
                label: Some(1),
                ..Default::default()
            },
        );
        let column = header.iter().position(|h| h == case).expect("the case");
        let mut checked = 0;
        for row in &rows {
            let ours = match row[0].trim_start_matches("original_shape_") {
                "MeshVolume" => m.volume_mesh,
                "VoxelVolume" => m.volume_voxel.expect("a mask"),
                "SurfaceArea" => m.area,
                "SurfaceVolumeRatio" => m.surface_to_volume,
                "Sphericity" => m.sphericity,
                "Maximum3DDiameter" => m.diameter_3d,
                "Maximum2DDiameterSlice" => m.diameter_slice_vertices.expect("a mask"),
                "MajorAxisLength" => m.axis_major,
                "MinorAxisLength" => m.axis_minor,
                "LeastAxisLength" => m.axis_least,
                "Elongation" => m.elongation,
                "Flatness" => m.flatness,
                _ => continue,
            };
            let peer: f64 = row[column].parse().expect("a number");
            let percent = 100.0 * (ours / peer - 1.0);
            println!(
                "| {case} | {} | {peer:.5} | {ours:.5} | {percent:+.4} % |",
                &row[0]
            );
            // The peer's own tests allow 3 %.
            assert!(percent.abs() < 3.0, "{case} {}: {ours} for {peer}", &row[0]);
            checked += 1;
        }
        assert_eq!(checked, 12);
    }
}
