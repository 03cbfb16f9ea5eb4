//! Change against exact truth: spheres and solids known by construction, published reference values, a peer's own values, and
//! contours of one tumour on three grids.
//!
//! Real scans are looked for in `../shared/data` beside the workspace (or `MEDIAL_DATA`); tests that need them say so when they are
//! not there. `MEDIAL_SLOW=1` runs the full sweeps. Tables are printed: `cargo test --release --test change -- --nocapture`.

use glam::{DMat3, DVec3};
use medial_scaffold::change::error_model::{Uncertain, volume_change, volume_error};
use medial_scaffold::change::morphology::{Measures, measure};
use medial_scaffold::change::region::regions;
use medial_scaffold::change::{
    Category, Change, ChangeError, ChangeSettings, Pairing, PartKind, Status, change, compare,
};
use medial_scaffold::geometry::{Neighbours, TriangleMesh};
use medial_scaffold::input::shape::{Geometry, LabelMap, PointCloud, Provenance, Shape, SourceFormat};
use medial_scaffold::input::{ReadSettings, read_shape};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::f64::consts::PI;
use std::path::PathBuf;

fn slow() -> bool {
    std::env::var_os("MEDIAL_SLOW").is_some_and(|v| v == "1")
}

fn data(path: &str) -> Option<PathBuf> {
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

fn read(path: &str) -> Option<Shape> {
    let file = data(path)?;
    Some(read_shape(&file, &ReadSettings::default()).unwrap_or_else(|e| panic!("{e}")))
}

fn shape(name: &str, geometry: Geometry) -> Shape {
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
struct Grid {
    dims: [usize; 3],
    spacing: DVec3,
    origin: DVec3,
}

impl Grid {
    fn about(half: f64, spacing: DVec3, rng: &mut impl Rng) -> Self {
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

    fn labels(&self, label: impl Fn(DVec3) -> i32) -> Shape {
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

    fn mask(&self, inside: impl Fn(DVec3) -> bool) -> Shape {
        self.labels(|p| i32::from(inside(p)))
    }
}

fn ball_volume(r: f64) -> f64 {
    4.0 / 3.0 * PI * r * r * r
}

fn only(shape: &Shape, settings: &ChangeSettings) -> (Measures, f64) {
    let found = regions(shape, settings).expect("a solid");
    assert_eq!(found.len(), 1);
    let m = measure(&found[0]);
    let sd = volume_error(&found[0], &m, settings).sd_mm3;
    (m, sd)
}

// --- one date ---------------------------------------------------------------------------------------------------------

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

// --- two dates --------------------------------------------------------------------------------------------------------

#[test]
fn the_interval_covers_the_truth_in_95_of_100_cases() {
    // Ellipsoids on random grids, each date's boundary displaced by a normal amount, as the error model says. Lengths mm.
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let settings = ChangeSettings::default();
    let cases = if slow() { 2000 } else { 400 };
    let mut covered = 0;
    let mut false_alarms = (0, 0);
    for case in 0..cases {
        let spacing = if case % 2 == 0 {
            DVec3::ONE
        } else {
            DVec3::new(0.9, 0.9, 2.5)
        };
        let sd = (spacing.x * spacing.y * spacing.z).cbrt() / 12f64.sqrt();
        let normal = Normal::new(0.0, sd).expect("a positive spread");
        let axes = DVec3::new(
            rng.random_range(6.0..9.0),
            rng.random_range(8.0..12.0),
            rng.random_range(9.0..14.0),
        );
        let growth = if case % 4 == 3 {
            0.0
        } else {
            rng.random_range(-1.5..2.5)
        };
        let volume = |a: DVec3| 4.0 / 3.0 * PI * a.x * a.y * a.z;
        let truth = 100.0 * (volume(axes + growth) / volume(axes) - 1.0);
        let seen = |axes: DVec3, rng: &mut ChaCha8Rng| {
            let drawn = axes + normal.sample(rng);
            let s = Grid::about(drawn.max_element(), spacing, rng).mask(|p| (p / drawn).length() <= 1.0);
            let (m, sd) = only(&s, &settings);
            Uncertain {
                volume: m.volume_best,
                sd,
            }
        };
        let (b, f) = (seen(axes, &mut rng), seen(axes + growth, &mut rng));
        let c = volume_change(b, f);
        covered += usize::from(c.ci95_percent[0] <= truth && truth <= c.ci95_percent[1]);
        if growth == 0.0 {
            false_alarms.0 += usize::from(c.significant);
            false_alarms.1 += 1;
        }
    }
    let share = 100.0 * covered as f64 / f64::from(cases);
    println!(
        "covered {share:.1} % of {cases}; called significant without change: {} of {}",
        false_alarms.0, false_alarms.1
    );
    assert!((93.0..=97.0).contains(&share), "{share} %");
}

#[test]
fn digitisation_alone_has_the_spread_that_the_model_says() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let settings = ChangeSettings {
        boundary_sd_mm: Some(0.0),
        ..Default::default()
    };
    for spacing in [DVec3::ONE, DVec3::new(1.0, 1.0, 3.0)] {
        let n = 300;
        let (mut sum, mut squares, mut model) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            // Radii vary so that no lattice resonance of one radius rules.
            let r: f64 = rng.random_range(7.0..9.0);
            let s = Grid::about(r, spacing, &mut rng).mask(|p| p.length() <= r);
            let (m, sd) = only(&s, &settings);
            let error = m.volume_best - ball_volume(r);
            sum += error;
            squares += error * error;
            model += sd * sd;
        }
        let ratio = (squares / model).sqrt();
        let bias = sum / f64::from(n);
        println!("{spacing}: observed / modelled spread {ratio:.2}, bias {bias:.2} mm3");
        assert!((0.8..1.25).contains(&ratio), "{ratio}");
        assert!(bias.abs() < 3.0 * (squares / f64::from(n * n)).sqrt(), "{bias}");
    }
}

#[test]
fn growth_maps_are_right_within_half_a_voxel_and_add_up() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let spacing = DVec3::new(0.8, 0.8, 1.6);
    let grids: [Grid; 2] = std::array::from_fn(|_| Grid::about(20.0, spacing, &mut rng));
    let base = |p: DVec3| (p / DVec3::new(9.0, 11.0, 13.0)).length() <= 1.0;
    let voxel = 1.6;

    // Uniform growth of a ball.
    let c = run(
        grids[0].mask(|p| p.length() <= 10.0),
        grids[1].mask(|p| p.length() <= 12.0),
    );
    let l = &c.lesions[0];
    let mut errors: Vec<f64> = l
        .growth_map
        .displacement_mm
        .iter()
        .map(|h| (h - 2.0).abs())
        .collect();
    errors.sort_by(f64::total_cmp);
    let (off, most) = (errors[errors.len() * 95 / 100], errors[errors.len() - 1]);
    let g = l.growth.expect("a growth map");
    println!(
        "uniform: 95 % within {off:.2} mm, all within {most:.2} mm (voxel {spacing}), residual {:+.2} %",
        g.identity_residual_percent.expect("a change")
    );
    // A flat cap is known to a slice only, at both dates: no more than that is in the masks.
    assert!(off < 0.5 * voxel && most < voxel, "{off} {most}");
    // A surface spread by a fifth has coarser triangles than the one it is compared with; chords cost about a percent.
    assert!(g.identity_residual_percent.expect("a change").abs() < 2.0);
    assert_eq!(l.parts[0].name, "grew all round");
    assert!((l.change.percent - 72.8).abs() < 1.5, "{}", l.change.percent);
    assert!(l.change.significant);

    // One-sided: the ball's left half drawn out into half an ellipsoid.
    let drawn = |p: DVec3| (p / DVec3::new(if p.x > 0.0 { 13.0 } else { 10.0 }, 10.0, 10.0)).length() <= 1.0;
    let c = run(grids[0].mask(|p| p.length() <= 10.0), grids[1].mask(drawn));
    let l = &c.lesions[0];
    println!(
        "one-sided: {:?}",
        l.parts
            .iter()
            .map(|p| (&p.name, p.share_percent))
            .collect::<Vec<_>>()
    );
    assert_eq!(l.parts[0].name, "grew left");
    assert!((l.change.percent - 15.0).abs() < 1.0, "{}", l.change.percent);
    for (p, h) in l.growth_map.mesh.points.iter().zip(&l.growth_map.displacement_mm) {
        if p.x < -1.0 {
            assert!(h.abs() < 0.5 * voxel, "{p}: {h}");
        }
    }

    // A new lobe: named by where it sits.
    let lobe = DVec3::new(0.0, -11.0, 0.0);
    let c = run(
        grids[0].mask(base),
        grids[1].mask(|p| base(p) || p.distance(lobe) <= 5.0),
    );
    let l = &c.lesions[0];
    println!(
        "lobe: {:?}",
        l.parts
            .iter()
            .map(|p| (&p.name, p.share_percent))
            .collect::<Vec<_>>()
    );
    assert_eq!(l.parts[0].name, "grew anterior");
    assert_eq!(l.parts.iter().filter(|p| p.kind == PartKind::Patch).count(), 1);

    // Shrinking.
    let c = run(
        grids[0].mask(|p| p.length() <= 12.0),
        grids[1].mask(|p| p.length() <= 10.0),
    );
    let l = &c.lesions[0];
    assert_eq!(l.parts[0].name, "shrank all round");
    assert!(l.growth.expect("a growth map").max_outward == 0.0);
    assert_eq!(l.response.recist.category, Category::SD);
    assert!(l.agreement.dice.expect("masks") > 0.7);
}

fn run(a: Shape, b: Shape) -> Change {
    change(&a, &b, &ChangeSettings::default()).expect("two solids")
}

#[test]
fn a_mask_against_itself_has_not_changed() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let s = Grid::about(9.0, DVec3::new(0.7, 0.7, 1.5), &mut rng).mask(|p| p.length() < 8.0);
    let c = change(&s, &s, &ChangeSettings::default()).expect("a solid");
    let l = &c.lesions[0];
    assert_eq!((l.change.percent, l.change.significant), (0.0, false));
    assert_eq!(l.agreement.dice, Some(1.0));
    for a in [
        l.agreement.mesh.expect("surfaces"),
        l.agreement.voxel.expect("voxels"),
    ] {
        assert!(
            a.hausdorff < 1e-9 && a.assd < 1e-9 && a.surface_dice == 1.0,
            "{a:?}"
        );
    }
    assert!(l.parts.is_empty());
    // The file has the fields that it promises.
    let json = serde_json::to_value(&c).expect("JSON");
    for path in [
        "/lesions/0/label",
        "/lesions/0/baseline/volume_mesh",
        "/lesions/0/baseline/volume_voxel",
        "/lesions/0/baseline/area",
        "/lesions/0/baseline/sphericity",
        "/lesions/0/baseline/diameter_3d",
        "/lesions/0/baseline/diameter_axial",
        "/lesions/0/baseline/diameter_perpendicular",
        "/lesions/0/followup/volume_mesh",
        "/lesions/0/change/volume_mm3",
        "/lesions/0/change/percent",
        "/lesions/0/change/ci95_percent/1",
        "/lesions/0/change/significant",
        "/lesions/0/response/recist/category",
        "/lesions/0/response/rano/category",
        "/lesions/0/response/volumetric/category",
        "/lesions/0/growth/max_outward",
        "/lesions/0/growth/max_inward",
        "/new",
        "/vanished",
        "/totals/percent",
    ] {
        assert!(json.pointer(path).is_some(), "{path}");
    }
}

#[test]
fn shifted_slabs_have_the_distances_worked_by_hand() {
    // Two cubes of 10 voxels, one shifted by 2: borders 2 apart on two faces.
    let grid = Grid {
        dims: [20; 3],
        spacing: DVec3::ONE,
        origin: DVec3::ZERO,
    };
    let cube = |x0: f64| {
        grid.mask(|p| p.x >= x0 && p.x < x0 + 10.0 && p.y >= 4.0 && p.y < 14.0 && p.z >= 4.0 && p.z < 14.0)
    };
    let c = run(cube(3.0), cube(5.0));
    let a = c.lesions[0].agreement;
    assert!((a.dice.expect("masks") - 0.8).abs() < 1e-12);
    assert_eq!(a.voxel.expect("voxels").hausdorff, 2.0);
    assert!((a.mesh.expect("surfaces").hausdorff - 2.0).abs() < 0.2);
    assert!(a.voxel.expect("voxels").surface_dice > 0.6);
}

#[test]
fn lesions_are_paired_by_overlap_whatever_their_grids() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let centre = |x: f64| DVec3::new(x, 0.0, 0.0);
    let near = |p: DVec3, x: f64, r: f64| p.distance(centre(x)) <= r;
    // Baseline: A (-30), B (-10), C1 and C2 (8 and 16), V (30). Follow-up: A; B split into two; C merged; N (40) new.
    let a = Grid::about(50.0, DVec3::ONE, &mut rng).mask(|p| {
        near(p, -30.0, 4.0)
            || near(p, -10.0, 6.0)
            || near(p, 8.0, 3.0)
            || near(p, 16.0, 3.0)
            || near(p, 30.0, 3.0)
    });
    let b = Grid::about(50.0, DVec3::new(0.8, 0.8, 1.3), &mut rng).mask(|p| {
        near(p, -30.0, 5.0)
            || near(p, -14.0, 2.5)
            || near(p, -6.0, 2.5)
            || near(p, 12.0, 8.0)
            || near(p, 42.0, 3.0)
    });
    let settings = ChangeSettings {
        pairing: Pairing::Overlap,
        ..Default::default()
    };
    let c = change(&a, &b, &settings).expect("solids");
    let mut lesions: Vec<_> = c.lesions.iter().collect();
    lesions.sort_by(|a, b| a.baseline.centroid.x.total_cmp(&b.baseline.centroid.x));
    let status: Vec<Status> = lesions.iter().map(|l| l.status).collect();
    assert_eq!(status, [Status::Paired, Status::Split, Status::Merged]);
    assert_eq!(
        (c.new.len(), c.vanished.len(), c.split.len(), c.merged.len()),
        (1, 1, 1, 1)
    );
    assert_eq!(c.split[0].followup.len(), 2);
    assert_eq!(c.merged[0].baseline.len(), 2);
    let split = lesions[1];
    assert!((split.followup.volume_best / (2.0 * ball_volume(2.5)) - 1.0).abs() < 0.1);
    let total: f64 =
        c.lesions.iter().map(|l| l.followup.volume_best).sum::<f64>() + c.new[0].measures.volume_best;
    assert!((c.totals.followup_mm3 - total).abs() < 1e-9);

    // By label: the same label is the same lesion, wherever it lies.
    let a = Grid::about(30.0, DVec3::ONE, &mut rng).labels(|p| {
        if near(p, -10.0, 4.0) {
            1
        } else {
            2 * i32::from(near(p, 10.0, 4.0))
        }
    });
    let b = Grid::about(30.0, DVec3::ONE, &mut rng).labels(|p| {
        if near(p, 10.0, 5.0) {
            2
        } else {
            7 * i32::from(near(p, -20.0, 4.0))
        }
    });
    let c = run(a, b);
    assert_eq!(c.lesions.iter().map(|l| l.label).collect::<Vec<_>>(), [2]);
    assert_eq!((c.vanished[0].label, c.new[0].label), (1, 7));
}

#[test]
fn what_is_no_solid_gives_an_error_and_not_a_number() {
    let settings = ChangeSettings::default();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let grid = Grid::about(8.0, DVec3::ONE, &mut rng);
    let ball = grid.mask(|p| p.length() < 6.0);
    let error =
        |other: &Shape, settings: &ChangeSettings| change(&ball, other, settings).expect_err("no solid");

    let tetrahedron = TriangleMesh {
        points: vec![DVec3::ZERO, 6.0 * DVec3::X, 6.0 * DVec3::Y, 6.0 * DVec3::Z],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3]],
    };
    let open = shape("open.ply", Geometry::Mesh(tetrahedron.clone()));
    let e = error(&open, &settings);
    assert!(
        matches!(
            e,
            ChangeError::OpenMesh {
                boundary_edges: 3,
                ..
            }
        ),
        "{e}"
    );
    assert!(
        e.to_string().contains("open.ply") && e.to_string().contains("3 open edges"),
        "{e}"
    );

    let mut turned = tetrahedron;
    turned.triangles.push([0, 2, 3]);
    let e = error(&shape("turned.ply", Geometry::Mesh(turned.clone())), &settings);
    assert!(e.to_string().contains("turned both ways"), "{e}");
    // Closed but inside out: turned silently, because nothing else can be meant.
    turned.triangles[3] = [0, 3, 2];
    turned.flip();
    assert!(change(&ball, &shape("inward.ply", Geometry::Mesh(turned)), &settings).is_ok());

    assert!(matches!(
        error(&grid.mask(|_| false), &settings),
        ChangeError::Empty { .. }
    ));
    let wanted = ChangeSettings {
        label: Some(3),
        ..Default::default()
    };
    assert!(error(&ball, &wanted).to_string().contains("no label 3"));
    let cloud = shape(
        "cloud.xyz",
        Geometry::Cloud(PointCloud {
            points: vec![DVec3::ZERO],
            normals: vec![],
        }),
    );
    assert!(matches!(error(&cloud, &settings), ChangeError::NotSolid { .. }));

    let mut away = ball.clone();
    if let Geometry::Labels(map) = &mut away.geometry {
        map.origin += DVec3::new(0.0, 0.0, 400.0);
    }
    let e = error(&away, &settings);
    assert!(
        matches!(e, ChangeError::Apart { .. }) && e.to_string().contains("--align"),
        "{e}"
    );
}

#[test]
fn one_contour_on_three_grids_has_not_changed() {
    println!("| case | CT mm3 | MR % | interval | PET % | interval |\n|---|---|---|---|---|---|");
    let cases: Vec<usize> = if slow() { (1..=12).collect() } else { vec![1, 4, 9] };
    for case in cases {
        let folder = format!("tumour_sts_ibsi_ccby3/STS_{case:03}");
        let (Some(ct), Some(mr), Some(pet)) = (
            read(&format!("{folder}/CT_mask.nii.gz")),
            read(&format!("{folder}/MR_T1_mask.nii.gz")),
            read(&format!("{folder}/PET_mask.nii.gz")),
        ) else {
            return;
        };
        let settings = ChangeSettings::default();
        let of = |s: &Shape| {
            let (m, sd) = only(s, &settings);
            Uncertain {
                volume: m.volume_best,
                sd,
            }
        };
        let (ct, mr, pet) = (of(&ct), of(&mr), of(&pet));
        let (to_mr, to_pet) = (volume_change(ct, mr), volume_change(ct, pet));
        println!(
            "| {case} | {:.0} | {:+.2} | {:+.1} to {:+.1} | {:+.2} | {:+.1} to {:+.1} |",
            ct.volume,
            to_mr.percent,
            to_mr.ci95_percent[0],
            to_mr.ci95_percent[1],
            to_pet.percent,
            to_pet.ci95_percent[0],
            to_pet.ci95_percent[1]
        );
        assert!(
            to_mr.percent.abs() < 1.0 && !to_mr.significant,
            "case {case}: {to_mr:?}"
        );
        assert!(!to_pet.significant, "case {case}: {to_pet:?}");
    }
}

#[test]
fn repeated_segmentations_give_the_error_of_the_interval() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let radii = [9.5, 10.0, 10.5];
    let mut drawn: Vec<Shape> = radii
        .iter()
        .map(|r| Grid::about(12.0, DVec3::ONE, &mut rng).mask(|p| p.length() <= *r))
        .collect();
    for (i, s) in drawn.iter_mut().enumerate() {
        s.name = format!("reader {i}");
    }
    let settings = ChangeSettings::default();
    let all = compare(&drawn, None, &settings).expect("solids");
    assert_eq!(
        (all.lesions.len(), all.pairs.len(), all.repeatability.len()),
        (3, 3, 1)
    );
    let volumes: Vec<f64> = radii.iter().map(|r| ball_volume(*r)).collect();
    let mean = volumes.iter().sum::<f64>() / 3.0;
    let truth = (volumes.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 2.0).sqrt() / mean;
    let cv = all.repeatability[0].cv.expect("three");
    assert!((cv - truth).abs() < 0.01, "{cv} {truth}");
    let against = compare(&drawn[1..], Some(&drawn[0]), &settings).expect("solids");
    assert_eq!(
        against.pairs.iter().map(|p| p.first.as_str()).collect::<Vec<_>>(),
        ["reader 0", "reader 0"]
    );
    assert!(against.pairs[1].agreement.dice < against.pairs[0].agreement.dice);
    assert_eq!(against.repeatability[0].segmentations, 2);

    let settings = ChangeSettings {
        repeat_cv: Some(cv),
        ..settings
    };
    let (m, sd) = only(&drawn[1], &settings);
    assert!(
        (sd / m.volume_best / cv - 1.0).abs() < 0.01,
        "digitisation adds little"
    );
}

// --- growth of real tumours, known by construction ----------------------------------------------------------------------

/// A solid as a sampled distance, trilinear between grid points: its volume is known as well as one cares to sample it.
struct Solid {
    map: LabelMap,
    /// Distance to the surface, mm, negative inside; one value a grid point.
    distance: Vec<f32>,
    centre: DVec3,
    reach: f64,
}

/// How the follow-up differs from the baseline: how far the surface moves out at a point, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Growth {
    Uniform(f64),
    OneSided(DVec3, f64),
    Lobe(DVec3, f64),
}

impl Solid {
    /// The smooth surface of a mask, widened by `margin_mm` of empty grid.
    fn of(mask: &Shape, margin_mm: f64) -> Solid {
        let region = &regions(mask, &ChangeSettings::default()).expect("a solid")[0];
        let lesion = region.mask.as_ref().expect("a mask");
        let pad = (DVec3::splat(margin_mm) / lesion.spacing_mm).ceil() + 2.0;
        let dims: [usize; 3] = std::array::from_fn(|a| lesion.dims[a] + 2 * pad[a] as usize);
        let map = LabelMap {
            dims,
            values: Vec::new(),
            spacing_mm: lesion.spacing_mm,
            origin: lesion.position(-pad),
            direction: lesion.direction,
        };
        let surface = &region.surface;
        let (tree, normals) = (Neighbours::new(&surface.points), surface.vertex_normals());
        let points: Vec<DVec3> = (0..dims.iter().product::<usize>())
            .map(|v| {
                map.position(DVec3::new(
                    (v % dims[0]) as f64,
                    (v / dims[0] % dims[1]) as f64,
                    (v / dims[0] / dims[1]) as f64,
                ))
            })
            .collect();
        let distance = tree
            .nearest_many(&points)
            .iter()
            .zip(&points)
            .map(|(hit, p)| {
                let away = *p - surface.points[hit.index as usize];
                let side = if away.dot(normals[hit.index as usize]) < 0.0 {
                    -1.0
                } else {
                    1.0
                };
                (side * away.length()) as f32
            })
            .collect();
        let centre = surface.points.iter().sum::<DVec3>() / surface.points.len() as f64;
        let reach =
            surface.points.iter().map(|p| p.distance(centre)).sum::<f64>() / surface.points.len() as f64;
        Solid {
            map,
            distance,
            centre,
            reach,
        }
    }

    fn at(&self, index: DVec3) -> f64 {
        let [nx, ny, nz] = self.map.dims;
        let limit = DVec3::new(nx as f64 - 1.001, ny as f64 - 1.001, nz as f64 - 1.001);
        let x = index.clamp(DVec3::ZERO, limit);
        let (i, f) = (x.floor(), x - x.floor());
        let base = i.x as usize + nx * (i.y as usize + ny * i.z as usize);
        let v = |n: usize| f64::from(self.distance[base + n]);
        let mix = |a: f64, b: f64, t: f64| a + t * (b - a);
        let row = |n: usize| mix(v(n), v(n + 1), f.x);
        mix(
            mix(row(0), row(nx), f.y),
            mix(row(nx * ny), row(nx * ny + nx), f.y),
            f.z,
        )
    }

    /// Negative inside the grown solid.
    fn grown(&self, index: DVec3, growth: Growth) -> f64 {
        let d = self.at(index);
        match growth {
            Growth::Uniform(by) => d - by,
            Growth::OneSided(way, by) => {
                let out = (self.map.position(index) - self.centre).dot(way) / self.reach;
                d - by * out.clamp(0.0, 1.0)
            }
            Growth::Lobe(centre, radius) => d.min(self.map.position(index).distance(centre) - radius),
        }
    }

    /// Volume by `n^3` samples a voxel; voxels that the surface cannot reach are counted whole.
    fn volume(&self, growth: Growth, n: usize) -> f64 {
        let [nx, ny, nz] = self.map.dims;
        let far = self.map.spacing_mm.length();
        let mut inside = 0usize;
        for v in 0..nx * ny * nz {
            let p = DVec3::new((v % nx) as f64, (v / nx % ny) as f64, (v / nx / ny) as f64);
            let d = self.grown(p, growth);
            if d < -2.0 * far {
                inside += n * n * n;
            } else if d < 2.0 * far {
                for s in 0..n * n * n {
                    let o = DVec3::new((s % n) as f64, (s / n % n) as f64, (s / n / n) as f64);
                    inside += usize::from(self.grown(p + (o + 0.5) / n as f64 - 0.5, growth) < 0.0);
                }
            }
        }
        inside as f64 / (n * n * n) as f64 * self.map.voxel_volume_mm3()
    }

    /// The mask that a reader would draw whose boundary lies `bias_mm` out, on the same kind of grid at a random place.
    fn drawn(&self, growth: Growth, bias_mm: f64, rng: &mut impl Rng) -> Shape {
        let shift = DVec3::new(rng.random::<f64>(), rng.random::<f64>(), rng.random::<f64>());
        let [nx, ny, nz] = self.map.dims.map(|n| n - 1);
        let mut values = Vec::with_capacity(nx * ny * nz);
        for v in 0..nx * ny * nz {
            let p = DVec3::new((v % nx) as f64, (v / nx % ny) as f64, (v / nx / ny) as f64) + shift;
            values.push(i32::from(self.grown(p, growth) < bias_mm));
        }
        let map = LabelMap {
            dims: [nx, ny, nz],
            values,
            origin: self.map.position(shift),
            ..self.map.clone()
        };
        shape("drawn", Geometry::Labels(map))
    }
}

#[test]
fn growth_of_sarcomas_is_measured_covered_and_placed() {
    let cases: Vec<usize> = if slow() { (1..=12).collect() } else { vec![5] };
    let repeats = if slow() { 4 } else { 1 };
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let settings = ChangeSettings::default();
    let (mut covered, mut total, mut worst, mut named) = (0, 0, 0f64, 0);
    for case in cases {
        let Some(mask) = read(&format!("tumour_sts_ibsi_ccby3/STS_{case:03}/CT_mask.nii.gz")) else {
            return;
        };
        let solid = Solid::of(&mask, 8.0);
        let still = Growth::Uniform(0.0);
        let samples = if slow() { 3 } else { 2 };
        let before = solid.volume(still, samples);
        // The lobe sits on the rightmost point of the surface.
        let surface = &regions(&mask, &settings).expect("a solid")[0].surface;
        let right = surface
            .points
            .iter()
            .min_by(|a, b| a.x.total_cmp(&b.x))
            .expect("points");
        for (growth, name) in [
            (Growth::Uniform(2.0), "grew all round"),
            (Growth::Uniform(-2.0), "shrank all round"),
            (Growth::OneSided(DVec3::X, 5.0), "left"),
            (Growth::Lobe(*right, 7.0), "right"),
        ] {
            let truth = 100.0 * (solid.volume(growth, samples) / before - 1.0);
            for _ in 0..repeats {
                // Measured without a reader's bias: within half a point. Covered with it.
                let spread =
                    Normal::new(0.0, solid.map.voxel_volume_mm3().cbrt() / 12f64.sqrt()).expect("positive");
                let mut seen = |growth: Growth, bias: f64| {
                    let (m, sd) = only(&solid.drawn(growth, bias, &mut rng), &settings);
                    Uncertain {
                        volume: m.volume_best,
                        sd,
                    }
                };
                let exact = volume_change(seen(still, 0.0), seen(growth, 0.0));
                worst = worst.max((exact.percent - truth).abs());
                let (one, two) = (
                    spread.sample(&mut ChaCha8Rng::seed_from_u64(total)),
                    spread.sample(&mut ChaCha8Rng::seed_from_u64(1000 + total)),
                );
                let c = volume_change(seen(still, one), seen(growth, two));
                covered += usize::from(c.ci95_percent[0] <= truth && truth <= c.ci95_percent[1]);
                total += 1;
            }
            let c = run(
                solid.drawn(still, 0.0, &mut rng),
                solid.drawn(growth, 0.0, &mut rng),
            );
            let l = &c.lesions[0];
            let part = l.parts.first().map_or("nothing", |p| p.name.as_str());
            named += usize::from(part.contains(name));
            println!(
                "STS_{case:03} {name}: truth {truth:+.2} %, measured {:+.2} %, {part}, residual {:+.2} %",
                l.change.percent,
                l.growth
                    .and_then(|g| g.identity_residual_percent)
                    .unwrap_or(f64::NAN)
            );
        }
    }
    println!(
        "{total} cases: covered {:.1} %, worst error {worst:.2} points, {named} parts named right",
        100.0 * covered as f64 / total as f64
    );
    assert!(worst < 0.5, "{worst}");
    if slow() {
        assert!((0.92..=0.98).contains(&(covered as f64 / total as f64)));
    }
}
