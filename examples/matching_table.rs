//! Prints what the scaffolds alone say of real bones: how often they give the pose, and whose bone is nearest to whose.
//!
//! `cargo run --release --example matching_table -- [BONES] [pose] [identity]` with the bones of `../shared/data` (or of the folder
//! in `MEDIAL_DATA`). `pose`: every bone against itself, sampled again (other seed, four times the points, noise of half the
//! spacing), in a random pose. `identity`: right bones of one person against the mirrored left ones.

use glam::{DMat3, DQuat, DVec3};
use medial_scaffold::coarse_scaffold::{CoarseScaffold, CoarseScaffoldSettings, coarse_scaffold};
use medial_scaffold::fine_scaffold::{FineScaffoldSettings, fine_scaffold};
use medial_scaffold::geometry::{Length, Rigid, TriangleMesh};
use medial_scaffold::input::sampling::{SamplingSettings, sample};
use medial_scaffold::input::{Geometry, ReadSettings, Shape, Units, read_shape};
use medial_scaffold::matching::{MatchingSettings, match_scaffolds, match_scaffolds_at};
use medial_scaffold::registration::{RegistrationSettings, RegistrationShape, register};
use medial_scaffold::regularise::{RegulariseSettings, regularise};
use medial_scaffold::segregation::{KnownSurfaceSettings, segregate_known_refined};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Tolerance of the scaffolds, percent of the diagonal.
const TOLERANCE_PERCENT: f64 = 1.5;

struct Bone {
    name: String,
    mesh: TriangleMesh,
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let most = args.iter().find_map(|a| a.parse().ok()).unwrap_or(usize::MAX);
    let chosen =
        |name: &str| args.iter().all(|a| a.parse::<usize>().is_ok()) || args.iter().any(|a| a == name);
    let data = std::env::var_os("MEDIAL_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    let carpals = bones(&data.join("carpal_myosim_apache2/frameA"), Units::M);
    let right = bones(&data.join("tarsal_visiblehuman_ccby4/VHF_Right"), Units::Mm);
    let left = bones(&data.join("tarsal_visiblehuman_ccby4/VHF_Left"), Units::Mm);
    if right.is_empty() || carpals.is_empty() {
        println!("skipped: no bones in {} (set MEDIAL_DATA)", data.display());
        return;
    }
    if chosen("pose") {
        let all: Vec<&Bone> = right.iter().chain(&carpals).take(most).collect();
        poses(&all);
    }
    if chosen("identity") {
        identity(&right, &left, most);
    }
}

fn poses(bones: &[&Bone]) {
    println!(
        "| variant | bones | within 5 deg, scaffold alone | median deg | ambiguous | after the surfaces | median deg | curves of p > 1.5 tau named | scaffold match s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let base: Vec<Option<CoarseScaffold>> = bones.iter().map(|b| scaffold(&b.mesh, 10_000, 1, 0.0)).collect();
    for (variant, count, noise) in [
        ("other seed", 10_000, 0.0),
        ("four times the points", 40_000, 0.0),
    ] {
        let (mut errors, mut verified, mut seconds) = (Vec::new(), Vec::new(), Vec::new());
        let (mut ambiguous, mut named, mut wanted) = (0, 0, 0);
        for (k, bone) in bones.iter().enumerate() {
            let Some(target) = &base[k] else { continue };
            let motion = random_motion(k as u64, bone.mesh.diagonal_mm());
            let turned = moved(&bone.mesh, &motion);
            let Some(source) = scaffold(&turned, count, 2, noise) else {
                continue;
            };
            let clock = Instant::now();
            let found = match_scaffolds(target, &source, &MatchingSettings::default());
            seconds.push(clock.elapsed().as_secs_f64());
            let error = found.T_target_source.rotation_angle_deg(&motion.inverse());
            ambiguous += usize::from(found.ambiguous);
            if error > 5.0 {
                println!(
                    "<!-- {variant}, {}: {error:.1} degrees, ambiguous {} {:?} -->",
                    bone.name,
                    found.ambiguous,
                    found.hypotheses.iter().map(|h| h.residual_mm).collect::<Vec<_>>()
                );
            }
            errors.push(error);
            let surface = register(
                &RegistrationShape::mesh(&bone.mesh).with_scaffold(target),
                &RegistrationShape::mesh(&turned).with_scaffold(&source),
                &RegistrationSettings::default(),
            )
            .expect("the meshes are sound");
            verified.push(surface.T_target_source.rotation_angle_deg(&motion.inverse()));
            let at = match_scaffolds_at(
                target,
                &source,
                &surface.T_target_source,
                &MatchingSettings::default(),
            );
            for c in target
                .curves
                .iter()
                .filter(|c| c.persistence > 1.5 * target.tolerance_mm && format!("{:?}", c.kind) == "Axial")
            {
                wanted += 1;
                named += usize::from(at.correspondences.curves.iter().any(|p| p.target == c.id));
            }
        }
        let good = |e: &[f64]| e.iter().filter(|e| **e < 5.0).count();
        println!(
            "| {variant} | {} | {} | {:.3} | {ambiguous} | {} | {:.4} | {named}/{wanted} | {:.2} |",
            errors.len(),
            good(&errors),
            median(&mut errors.clone()),
            good(&verified),
            median(&mut verified.clone()),
            median(&mut seconds)
        );
    }
}

fn identity(right: &[Bone], left: &[Bone], most: usize) {
    let make = |bones: &[Bone]| -> Vec<(String, CoarseScaffold)> {
        let named = |b: &Bone| {
            Some((
                b.name.replace("Left", "").replace("Right", ""),
                scaffold(&b.mesh, 10_000, 1, 0.0)?,
            ))
        };
        bones.iter().take(most).filter_map(named).collect()
    };
    let (right, left) = (make(right), make(left));
    let settings = MatchingSettings {
        mirrored: true,
        ..Default::default()
    };
    let mut right_names = [0, 0, 0];
    for (name, target) in &right {
        let all: Vec<_> = left
            .iter()
            .map(|(n, s)| (n, match_scaffolds(target, s, &settings).shape_distance))
            .collect();
        let nearest = |f: &dyn Fn(usize) -> f64| {
            (0..all.len())
                .min_by(|&a, &b| f(a).total_cmp(&f(b)))
                .map(|i| all[i].0)
        };
        let picks = [
            nearest(&|i| all[i].1.with_size_mm),
            nearest(&|i| all[i].1.without_size),
            nearest(&|i| all[i].1.structure),
        ];
        for (count, pick) in right_names.iter_mut().zip(&picks) {
            *count += usize::from(*pick == Some(name));
        }
        println!("<!-- {name}: {picks:?} -->");
    }
    println!(
        "\n| right bones whose nearest mirrored left one is their own | with size | without size | structure alone |\n|---|---|---|---|"
    );
    println!(
        "| {} | {} | {} | {} |",
        right.len(),
        right_names[0],
        right_names[1],
        right_names[2]
    );
}

/// The whole way from a mesh to its coarse scaffold; noise in spacings.
fn scaffold(mesh: &TriangleMesh, count: usize, seed: u64, noise: f64) -> Option<CoarseScaffold> {
    let shape = Shape::generated("bone", Geometry::Mesh(mesh.clone()));
    let settings = SamplingSettings {
        count,
        seed,
        ..Default::default()
    };
    let generators = sample(&shape, &settings).ok()?.generators;
    let mut points = generators.points.clone();
    if noise > 0.0 {
        let spacing = (mesh.area() / points.len() as f64).sqrt();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || StandardNormal.sample(&mut rng);
        points
            .iter_mut()
            .for_each(|p| *p += DVec3::new(normal(), normal(), normal()) * noise * spacing);
    }
    let known = generators.known_surface?;
    let found = segregate_known_refined(&points, &known, &KnownSurfaceSettings::default()).ok()?;
    let fine = fine_scaffold(
        &found.triangulation,
        &found.result.segregation,
        &FineScaffoldSettings::default(),
    )
    .ok()?;
    let settings = RegulariseSettings {
        tolerance: Length::PercentDiagonal(TOLERANCE_PERCENT),
        ..Default::default()
    };
    let regularised = regularise(&fine, &settings).ok()?;
    Some(coarse_scaffold(
        &fine,
        &regularised,
        &CoarseScaffoldSettings::default(),
    ))
}

fn bones(folder: &Path, units: Units) -> Vec<Bone> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    files.sort();
    let settings = ReadSettings {
        units: Some(units),
        ..Default::default()
    };
    let read = |path: &PathBuf| {
        let Geometry::Mesh(mesh) = read_shape(path, &settings).ok()?.geometry else {
            return None;
        };
        Some(Bone {
            name: path.file_stem()?.to_string_lossy().into_owned(),
            mesh,
        })
    };
    files.iter().filter_map(read).collect()
}

fn moved(mesh: &TriangleMesh, motion: &Rigid) -> TriangleMesh {
    TriangleMesh {
        points: mesh.points.iter().map(|&p| motion.apply(p)).collect(),
        triangles: mesh.triangles.clone(),
    }
}

fn random_motion(seed: u64, size: f64) -> Rigid {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || StandardNormal.sample(&mut rng);
    let turn = DQuat::from_xyzw(normal(), normal(), normal(), normal()).normalize();
    Rigid {
        linear: DMat3::from_quat(turn),
        translation: DVec3::new(normal(), normal(), normal()) * size,
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
