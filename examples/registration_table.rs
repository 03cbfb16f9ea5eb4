//! Prints how often, how precisely and how fast `register` finds the pose of real bones.
//!
//! `cargo run --release --example registration_table -- [TRIALS] [CASE...] [each] [from N]` with the bones of `../shared/data` (or of the folder
//! in `MEDIAL_DATA`); cases: whole, crop50, crop50-low, crop50-high, overlap33, overlap20, one55, one35, one25,
//! size55, size35, size25, size-crop50 (the same cuts with the source 0.8 to 1.2 times as large), mesh, mirror.
//! `... -- TRIALS dump FOLDER CASE...` writes the clouds of the trials, raw and de-noised, for `compare/registration.py`.
//! `from N` starts with trial N instead of trial 0 (other cuts, noise and poses of the same bones);
//! `each` prints the error of every trial as well, with the standard error that was reported.
//! Every trial takes one bone, samples it twice independently (4 000 points as target, 2 000 as source), cuts, adds noise in
//! percent of the whole bone's diagonal, and turns the source by a uniform random rotation.

use glam::{DMat3, DQuat, DVec3};
use medial_scaffold::geometry::{Rigid, TriangleMesh};
use medial_scaffold::registration::{Mirror, RegistrationSettings, RegistrationShape, clean_cloud, register};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// One row of the table.
struct Case {
    name: &'static str,
    /// Shares kept of target and source, cut by opposite half-spaces.
    keep: [f64; 2],
    /// Noise, percent of the diagonal.
    noise: f64,
    /// The source's size is unknown: a factor of 0.8 to 1.2, found with `scale`.
    sized: bool,
}

const CASES: [Case; 13] = [
    Case {
        name: "whole",
        keep: [1.0, 1.0],
        noise: 1.0,
        sized: false,
    },
    Case {
        name: "crop50",
        keep: [2.0 / 3.0, 2.0 / 3.0],
        noise: 1.0,
        sized: false,
    },
    Case {
        name: "crop50-low",
        keep: [2.0 / 3.0, 2.0 / 3.0],
        noise: 0.2,
        sized: false,
    },
    Case {
        name: "crop50-high",
        keep: [2.0 / 3.0, 2.0 / 3.0],
        noise: 2.0,
        sized: false,
    },
    Case {
        name: "overlap33",
        keep: [0.6, 0.6],
        noise: 1.0,
        sized: false,
    },
    Case {
        name: "overlap20",
        keep: [1.0 / 1.8, 1.0 / 1.8],
        noise: 1.0,
        sized: false,
    },
    Case {
        name: "one55",
        keep: [1.0, 0.55],
        noise: 1.0,
        sized: false,
    },
    Case {
        name: "one35",
        keep: [1.0, 0.35],
        noise: 1.0,
        sized: false,
    },
    Case {
        name: "one25",
        keep: [1.0, 0.25],
        noise: 1.0,
        sized: false,
    },
    Case {
        name: "size55",
        keep: [1.0, 0.55],
        noise: 1.0,
        sized: true,
    },
    Case {
        name: "size35",
        keep: [1.0, 0.35],
        noise: 1.0,
        sized: true,
    },
    Case {
        name: "size25",
        keep: [1.0, 0.25],
        noise: 1.0,
        sized: true,
    },
    Case {
        name: "size-crop50",
        keep: [2.0 / 3.0, 2.0 / 3.0],
        noise: 1.0,
        sized: true,
    },
];

struct Bone {
    name: String,
    mesh: TriangleMesh,
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let trials = args.iter().find_map(|a| a.parse().ok()).unwrap_or(20);
    let first = args
        .iter()
        .position(|a| a == "from")
        .and_then(|k| args.get(k + 1)?.parse().ok())
        .unwrap_or(0);
    let chosen: Vec<&String> = args.iter().filter(|a| a.parse::<usize>().is_err()).collect();
    let data = std::env::var_os("MEDIAL_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    let bones = read_bones(&data);
    if bones.is_empty() {
        println!("skipped: no bones in {} (set MEDIAL_DATA)", data.display());
        return;
    }
    if let Some(folder) = args
        .iter()
        .position(|a| a == "dump")
        .and_then(|k| args.get(k + 1))
    {
        for case in CASES.iter().filter(|case| chosen.iter().any(|c| *c == case.name)) {
            dump(case, &bones, trials, Path::new(folder));
        }
        return;
    }
    println!(
        "{} bones, {trials} trials a case, success: rotation within 5 degrees",
        bones.len()
    );
    println!(
        "| case | noise % | success | median deg | median size error % | wrong, flagged | right, flagged | rms of error / standard error | within two | median s | max s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for case in &CASES {
        if chosen.is_empty() || chosen.iter().any(|c| *c == case.name) {
            run(case, &bones, first, trials);
        }
    }
    if chosen.is_empty() || chosen.iter().any(|c| *c == "mesh") {
        frames(&data);
    }
    if chosen.is_empty() || chosen.iter().any(|c| *c == "mirror") {
        sides(&data);
    }
}

/// Two clouds and the motion between them: `source` was moved by `motion`.
struct Trial<'a> {
    bone: &'a Bone,
    target: Vec<DVec3>,
    source: Vec<DVec3>,
    motion: Rigid,
    /// Size of the source as a factor of the bone's; part of `motion`.
    size: f64,
}

fn make<'a>(case: &Case, bones: &'a [Bone], trial: usize) -> Trial<'a> {
    let bone = &bones[trial % bones.len()];
    let mut rng = ChaCha8Rng::seed_from_u64(1000 + trial as u64);
    let sigma = case.noise / 100.0 * bone.mesh.diagonal_mm();
    let axis = random_direction(&mut rng);
    let target = cut(noisy(&bone.mesh, 4000, sigma, &mut rng), axis, case.keep[0]);
    let source = cut(noisy(&bone.mesh, 2000, sigma, &mut rng), -axis, case.keep[1]);
    let mut motion = random_motion(&mut rng, bone.mesh.diagonal_mm());
    let size = if case.sized {
        rng.random_range(0.8..1.2)
    } else {
        1.0
    };
    motion.linear *= size;
    let source: Vec<DVec3> = source.iter().map(|&p| motion.apply(p)).collect();
    Trial {
        bone,
        target,
        source,
        motion,
        size,
    }
}

/// Writes the clouds of every trial as `CASE_TRIAL.json`.
fn dump(case: &Case, bones: &[Bone], trials: usize, folder: &Path) {
    std::fs::create_dir_all(folder).expect("the folder can be made");
    let rows = |points: &[DVec3]| points.iter().map(|p| p.to_array()).collect::<Vec<_>>();
    for trial in 0..trials {
        let t = make(case, bones, trial);
        let (target, source) = (
            clean_cloud(&t.target).expect("a sound cloud"),
            clean_cloud(&t.source).expect("a sound cloud"),
        );
        let json = serde_json::json!({
            "target": rows(&t.target),
            "source": rows(&t.source),
            "T_target_source": t.motion.inverse().to_rows()[..3].to_vec(),
            "diagonal": t.bone.mesh.diagonal_mm(),
            "target_clean": rows(&target.points),
            "target_normals": rows(&target.normals),
            "source_clean": rows(&source.points),
            "source_normals": rows(&source.normals),
        });
        let file = folder.join(format!("{}_{trial:03}.json", case.name));
        std::fs::write(file, json.to_string()).expect("the file can be written");
    }
}

fn run(case: &Case, bones: &[Bone], first: usize, trials: usize) {
    let mut errors = Vec::new();
    // Error over standard error, of the right ones.
    let mut normed = Vec::new();
    // Of the size, percent.
    let mut size_errors = Vec::new();
    let mut each = String::new();
    let mut seconds = Vec::new();
    let (mut wrong_flagged, mut wrong, mut right_flagged) = (0, 0, 0);
    let mut uncertain = 0;
    for trial in first..first + trials {
        let Trial {
            bone,
            target,
            source,
            motion,
            size,
        } = make(case, bones, trial);
        let clock = Instant::now();
        let found = register(
            &RegistrationShape::cloud(&target),
            &RegistrationShape::cloud(&source),
            &RegistrationSettings {
                scale: case.sized,
                ..Default::default()
            },
        )
        .expect("the clouds are sound");
        seconds.push(clock.elapsed().as_secs_f64());
        let error = found.T_target_source.rotation_angle_deg(&motion.inverse());
        errors.push(error);
        let standard = found.precision.as_ref().map_or(f64::NAN, |p| p.rotation_deg);
        let flagged = found.ambiguous || found.uncertain;
        let flag = if flagged { "!" } else { "" };
        each += &format!(" {error:.2}({standard:.2}){flag}");
        if case.sized {
            size_errors.push(100.0 * (found.scale * size - 1.0).abs());
            let told = found.precision.as_ref().and_then(|p| p.scale_percent);
            each += &format!(
                "[{:.1}%({:.1})]",
                100.0 * (found.scale * size - 1.0),
                told.unwrap_or(f64::NAN)
            );
        }
        if error < 5.0 {
            normed.push(error / standard);
        }
        if error >= 5.0 {
            wrong += 1;
            wrong_flagged += usize::from(flagged);
            println!(
                "<!-- {} trial {trial} {}: {error:.2} degrees, flagged {}, {:?} score {:.3} {:?} standard error {standard:.2} {:?} {:?} -->",
                case.name,
                bone.name,
                flagged,
                found.method,
                found.score,
                found
                    .hypotheses
                    .iter()
                    .map(|h| (h.score * 1000.0).round() / 1000.0)
                    .collect::<Vec<_>>(),
                found.ambiguity,
                found.uncertainty
            );
        } else {
            right_flagged += usize::from(flagged);
            uncertain += usize::from(!found.ambiguous && found.uncertain);
        }
    }
    if std::env::args().any(|a| a == "each") {
        println!("<!-- {}, error (standard error):{each} -->", case.name);
    }
    errors.sort_by(f64::total_cmp);
    seconds.sort_by(f64::total_cmp);
    let normed_rms = (normed.iter().map(|x: &f64| x * x).sum::<f64>() / normed.len().max(1) as f64).sqrt();
    let within = normed.iter().filter(|x| **x <= 2.0).count();
    size_errors.sort_by(f64::total_cmp);
    let size_error = size_errors
        .get(trials / 2)
        .map_or(String::new(), |e| format!("{e:.1}"));
    println!(
        "| {} | {} | {}/{trials} | {:.3} | {size_error} | {wrong_flagged}/{wrong} | {right_flagged}/{} ({uncertain} only uncertain) | {normed_rms:.2} | {within}/{} | {:.2} | {:.2} |",
        case.name,
        case.noise,
        trials - wrong,
        errors[trials / 2],
        trials - wrong,
        normed.len(),
        seconds[trials / 2],
        seconds[trials - 1],
    );
}

/// The two frames of one wrist: exact meshes, known motion of 90 degrees.
fn frames(data: &Path) {
    println!(
        "\n| bone, frame B on A | rotation deg | rms mm | max mm | ambiguous | s |\n|---|---|---|---|---|---|"
    );
    for name in [
        "capitate",
        "hamate",
        "pisiform",
        "scaphoid",
        "trapezium",
        "trapezoid",
    ] {
        let folder = data.join("carpal_myosim_apache2");
        let a = read_stl(&folder.join(format!("frameA/arm_r_{name}.stl")), 1000.0);
        let b = read_stl(&folder.join(format!("frameB/{name}.stl")), 1000.0);
        let (Some(a), Some(b)) = (a, b) else { continue };
        let clock = Instant::now();
        let found = register(
            &RegistrationShape::mesh(&a),
            &RegistrationShape::mesh(&b),
            &RegistrationSettings::default(),
        )
        .expect("the meshes are sound");
        println!(
            "| {name} | {:.6} | {:.6} | {:.6} | {} | {:.2} |",
            found.T_target_source.rotation_angle_deg(&Rigid::IDENTITY),
            found.rms,
            found.max,
            found.ambiguous,
            clock.elapsed().as_secs_f64()
        );
    }
}

/// Left bones on right ones with either handedness allowed, and right ones of another person.
fn sides(data: &Path) {
    println!(
        "\n| target, source | mirrored | rms mm | rms % diag | PCA + wide ICP % | ratio | ambiguous | s |\n|---|---|---|---|---|---|---|---|"
    );
    for name in [
        "Calcaneous",
        "Cuboid",
        "IntermediateCuneiform",
        "LateralCuneiform",
        "MedialCuneiform",
        "Navicular",
        "Patella",
        "Talus",
    ] {
        let read = |side: &str| {
            let file = format!("tarsal_visiblehuman_ccby4/VHF_{side}/VHF_{side}_Bone_{name}_smooth.stl");
            read_stl(&data.join(file), 1.0)
        };
        let (Some(right), Some(left)) = (read("Right"), read("Left")) else {
            continue;
        };
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let motion = random_motion(&mut rng, 50.0);
        let mut source = left.clone();
        source.points.iter_mut().for_each(|p| *p = motion.apply(*p));
        let clock = Instant::now();
        let settings = RegistrationSettings {
            mirror: Mirror::Auto,
            ..Default::default()
        };
        let found = register(
            &RegistrationShape::mesh(&right),
            &RegistrationShape::mesh(&source),
            &settings,
        )
        .expect("the meshes are sound");
        println!(
            "| {name} R, L | {} | {:.3} | {:.2} | | | {} | {:.2} | {:?}",
            found.mirrored,
            found.rms,
            100.0 * found.rms / right.diagonal_mm(),
            found.ambiguous,
            clock.elapsed().as_secs_f64(),
            found.ambiguity
        );
    }
}

fn read_bones(data: &Path) -> Vec<Bone> {
    let mut files: Vec<(PathBuf, f64)> = Vec::new();
    for (folder, factor) in [
        ("carpal_myosim_apache2/frameA", 1000.0),
        ("tarsal_visiblehuman_ccby4/VHF_Right", 1.0),
    ] {
        let Ok(entries) = std::fs::read_dir(data.join(folder)) else {
            continue;
        };
        files.extend(entries.flatten().map(|e| (e.path(), factor)));
    }
    files.sort_by(|a, b| a.0.cmp(&b.0));
    files
        .iter()
        .filter_map(|(path, factor)| {
            let name = path.file_stem()?.to_string_lossy().into_owned();
            Some(Bone {
                name,
                mesh: read_stl(path, *factor)?,
            })
        })
        .collect()
}

fn read_stl(path: &Path, to_mm: f64) -> Option<TriangleMesh> {
    let mut file = std::fs::File::open(path).ok()?;
    let stl = stl_io::read_stl(&mut file).ok()?;
    Some(TriangleMesh {
        points: stl
            .vertices
            .iter()
            .map(|v| DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2])) * to_mm)
            .collect(),
        triangles: stl.faces.iter().map(|f| f.vertices.map(|i| i as u32)).collect(),
    })
}

fn noisy(mesh: &TriangleMesh, count: usize, sigma: f64, rng: &mut ChaCha8Rng) -> Vec<DVec3> {
    let mut sums = Vec::with_capacity(mesh.triangles.len());
    let mut total = 0.0;
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.points[i as usize]);
        total += (b - a).cross(c - a).length();
        sums.push(total);
    }
    (0..count)
        .map(|_| {
            let mark = rng.random::<f64>() * total;
            let face = sums.partition_point(|s| *s < mark).min(sums.len() - 1);
            let [a, b, c] = mesh.triangles[face].map(|i| mesh.points[i as usize]);
            let (mut u, mut v) = (rng.random::<f64>(), rng.random::<f64>());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let mut normal = || StandardNormal.sample(&mut *rng);
            let shake = DVec3::new(normal(), normal(), normal());
            a + (b - a) * u + (c - a) * v + shake * sigma
        })
        .collect()
}

fn cut(mut points: Vec<DVec3>, axis: DVec3, keep: f64) -> Vec<DVec3> {
    if keep < 1.0 {
        points.sort_by(|a, b| a.dot(axis).total_cmp(&b.dot(axis)));
        points.truncate((points.len() as f64 * keep).round() as usize);
    }
    points
}

fn random_direction(rng: &mut ChaCha8Rng) -> DVec3 {
    let mut normal = || StandardNormal.sample(&mut *rng);
    DVec3::new(normal(), normal(), normal()).normalize()
}

fn random_motion(rng: &mut ChaCha8Rng, size: f64) -> Rigid {
    let mut normal = || StandardNormal.sample(&mut *rng);
    let turn = DQuat::from_xyzw(normal(), normal(), normal(), normal()).normalize();
    Rigid {
        linear: DMat3::from_quat(turn),
        translation: DVec3::new(normal(), normal(), normal()) * size,
    }
}
