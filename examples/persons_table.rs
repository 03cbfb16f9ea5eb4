//! Prints how whole bones of two persons are laid on each other.
//!
//! `cargo run --release --example persons_table -- [PAIRS] [SET...]` with `../shared/data` (or the folder in `MEDIAL_DATA`); sets:
//! `wrists` (one wrist on another one's, right and mirrored left), `sides` (tarsals, left mirrored), `knees` and `patellas`
//! (individuals of a shape model with known correspondences), `population` (synthetic individuals, known correspondences; needs no data).
//!
//! Each pair is registered from three random poses with three seeds. The peer is four flips of the principal axes and wide
//! point-to-point ICP on exact nearest places, symmetric and untruncated. Columns: pairs whose symmetric rms exceeds 1.05 times
//! the peer's; the worst ratio; pairs whose three answers lie within 5 degrees; against the pose of the known correspondences
//! (least squares): right within 20 degrees, and how many of the right and of the wrong were called ambiguous.

use datasets_synthetic::population::population;
use datasets_synthetic::{bones as synthetic, rigid};
use glam::{DMat3, DVec3};
use medial_scaffold::geometry::{ClosestOnMesh, Rigid, TriangleMesh};
use medial_scaffold::input::{Geometry, ReadSettings, Units, read_shape};
use medial_scaffold::registration::{
    Mirror, Registration, RegistrationSettings, RegistrationShape, register,
};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Two bones; `source` is already mirrored where it must be.
struct Pair {
    name: String,
    target: TriangleMesh,
    source: TriangleMesh,
    /// Vertices correspond by index.
    corresponds: bool,
}

/// Reads or makes the pairs of a set.
type Make = fn(&Path) -> Vec<Pair>;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let most = args.iter().find_map(|a| a.parse().ok()).unwrap_or(usize::MAX);
    let names: Vec<&String> = args.iter().filter(|a| a.parse::<usize>().is_err()).collect();
    let data = std::env::var_os("MEDIAL_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    println!(
        "| set | pairs | rms > 1.05 peer | worst ratio | median rms % diag | three answers agree | right | right, ambiguous | wrong, ambiguous | median s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let sets: [(&str, Make); 5] = [
        ("wrists", wrists),
        ("sides", sides),
        ("knees", |data| of_model(data, &[("Femur", 4), ("Tibia", 4)])),
        ("patellas", |data| of_model(data, &[("Patella", 20)])),
        ("population", |_| individuals()),
    ];
    for (name, make) in sets {
        if names.is_empty() || names.iter().any(|n| *n == name) {
            let pairs = make(&data);
            if pairs.is_empty() {
                println!(
                    "<!-- {name} skipped: no data in {} (set MEDIAL_DATA) -->",
                    data.display()
                );
            } else {
                let step = (pairs.len() / most.clamp(1, pairs.len())).max(1);
                row(name, &pairs.iter().step_by(step).collect::<Vec<_>>());
            }
        }
    }
}

fn row(name: &str, pairs: &[&Pair]) {
    let (mut worse, mut worst, mut agree) = (0, 0.0f64, 0);
    let (mut right, mut wrong, mut right_flagged, mut wrong_flagged) = (0, 0, 0, 0);
    let (mut shares, mut seconds) = (Vec::new(), Vec::new());
    for pair in pairs {
        let truth = pair
            .corresponds
            .then(|| least_squares(&pair.source.points, &pair.target.points));
        let mut found: Vec<(Registration, Rigid)> = Vec::new();
        for seed in 0..3u64 {
            let motion = rigid::random(31 + seed);
            let motion = Rigid {
                linear: motion.rotation,
                translation: motion.translation,
            };
            let settings = RegistrationSettings {
                seed,
                mirror: Mirror::No,
                ..Default::default()
            };
            let clock = Instant::now();
            let source = moved(&pair.source, &motion);
            let one = register(
                &RegistrationShape::mesh(&pair.target),
                &RegistrationShape::mesh(&source),
                &settings,
            )
            .expect("the meshes are sound");
            seconds.push(clock.elapsed().as_secs_f64());
            let pose = one.T_target_source.after(&motion);
            found.push((one, pose));
        }
        let surfaces = Surfaces::new(&pair.target, &pair.source);
        let peer = surfaces.peer();
        let ours = surfaces.rms(&found[0].1);
        let ratio = ours / peer.1;
        worse += usize::from(ratio > 1.05);
        worst = worst.max(ratio);
        shares.push(100.0 * ours / pair.target.diagonal_mm());
        let spread = (0..3)
            .map(|k| found[k].1.rotation_angle_deg(&found[(k + 1) % 3].1))
            .fold(0.0, f64::max);
        agree += usize::from(spread < 5.0);
        let mut said = String::new();
        if let Some(truth) = truth {
            for (one, pose) in &found {
                let error = pose.rotation_angle_deg(&truth);
                said += &format!(" {error:.1}");
                if error < 20.0 {
                    right += 1;
                    right_flagged += usize::from(one.ambiguous);
                } else {
                    wrong += 1;
                    wrong_flagged += usize::from(one.ambiguous);
                }
            }
        }
        println!(
            "<!-- {}: ratio {ratio:.3}, {:.1} degrees from the peer, spread {spread:.1}, errors{said}, {:?} -->",
            pair.name,
            found[0].1.rotation_angle_deg(&peer.0),
            found[0].0.ambiguity
        );
    }
    println!(
        "| {name} | {} | {worse} | {worst:.3} | {:.2} | {agree} | {right}/{} | {right_flagged}/{right} | {wrong_flagged}/{wrong} | {:.2} |",
        pairs.len(),
        median(&mut shares),
        right + wrong,
        median(&mut seconds),
    );
}

/// Both surfaces with samples, for an independent measure of a pose and for the peer.
struct Surfaces {
    target: ClosestOnMesh,
    source: ClosestOnMesh,
    target_points: Vec<DVec3>,
    source_points: Vec<DVec3>,
    diagonal: f64,
}

impl Surfaces {
    fn new(target: &TriangleMesh, source: &TriangleMesh) -> Self {
        let sampled = |mesh: &TriangleMesh| {
            let mesh = datasets_synthetic::TriangleMesh {
                points: mesh.points.clone(),
                triangles: mesh.triangles.clone(),
            };
            datasets_synthetic::sample_uniform(&mesh, 1500, 99).points
        };
        Self {
            target: ClosestOnMesh::new(target).expect("triangles"),
            source: ClosestOnMesh::new(source).expect("triangles"),
            target_points: sampled(target),
            source_points: sampled(source),
            diagonal: target.diagonal_mm(),
        }
    }

    /// Corresponding places of both directions within `reach`, `[source, target]`.
    fn pairs(&self, pose: &Rigid, reach: f64) -> (Vec<DVec3>, Vec<DVec3>) {
        let back = pose.inverse();
        let there = self.source_points.iter().map(|&p| {
            let q = self.target.closest(pose.apply(p)).point;
            (p, q)
        });
        let here = self.target_points.iter().map(|&q| {
            let p = self.source.closest(back.apply(q)).point;
            (p, q)
        });
        there
            .chain(here)
            .filter(|(p, q)| pose.apply(*p).distance(*q) < reach)
            .unzip()
    }

    fn rms(&self, pose: &Rigid) -> f64 {
        let (from, to) = self.pairs(pose, f64::INFINITY);
        let sum: f64 = from
            .iter()
            .zip(&to)
            .map(|(p, q)| pose.apply(*p).distance_squared(*q))
            .sum();
        (sum / from.len() as f64).sqrt()
    }

    /// The best of four flips after wide point-to-point ICP (reach 0.5 to 0.15 of the diagonal, then all), with its rms.
    fn peer(&self) -> (Rigid, f64) {
        let (ct, at) = axes(&self.target_points);
        let (cs, a) = axes(&self.source_points);
        let flips = [
            (1.0, 1.0, 1.0),
            (1.0, -1.0, -1.0),
            (-1.0, 1.0, -1.0),
            (-1.0, -1.0, 1.0),
        ];
        flips
            .iter()
            .map(|&(x, y, z)| {
                let linear = at * DMat3::from_diagonal(DVec3::new(x, y, z)) * a.transpose();
                let mut pose = Rigid {
                    linear,
                    translation: ct - linear * cs,
                };
                for k in 0..60 {
                    let reach = match k {
                        0..10 => 0.5 * self.diagonal,
                        10..20 => 0.15 * self.diagonal,
                        _ => f64::INFINITY,
                    };
                    let (from, to) = self.pairs(&pose, reach);
                    pose = least_squares(&from, &to);
                }
                (pose, self.rms(&pose))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .expect("four flips")
    }
}

/// Centroid and right-handed principal axes.
fn axes(points: &[DVec3]) -> (DVec3, DMat3) {
    let centre = points.iter().copied().sum::<DVec3>() / points.len() as f64;
    let mut m = nalgebra::Matrix3::<f64>::zeros();
    for p in points {
        let d = *p - centre;
        let d = nalgebra::Vector3::new(d.x, d.y, d.z);
        m += d * d.transpose();
    }
    let eigen = m.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let column = |k: usize| {
        let v = eigen.eigenvectors.column(order[k]);
        DVec3::new(v[0], v[1], v[2])
    };
    let (x, y) = (column(0), column(1));
    (centre, DMat3::from_cols(x, y, x.cross(y)))
}

/// The rigid motion that brings `from` onto `to` in the least squares sense (Kabsch).
fn least_squares(from: &[DVec3], to: &[DVec3]) -> Rigid {
    let n = from.len().max(1) as f64;
    let (a, b) = (
        from.iter().copied().sum::<DVec3>() / n,
        to.iter().copied().sum::<DVec3>() / n,
    );
    let mut m = nalgebra::Matrix3::<f64>::zeros();
    for (p, q) in from.iter().zip(to) {
        let (p, q) = (*p - a, *q - b);
        m += nalgebra::Vector3::new(q.x, q.y, q.z) * nalgebra::Vector3::new(p.x, p.y, p.z).transpose();
    }
    let svd = m.svd(true, true);
    let (u, vt) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let mut d = nalgebra::Matrix3::identity();
    d[(2, 2)] = (u * vt).determinant().signum();
    let r = u * d * vt;
    let linear = DMat3::from_cols_array(&[
        r[(0, 0)],
        r[(1, 0)],
        r[(2, 0)],
        r[(0, 1)],
        r[(1, 1)],
        r[(2, 1)],
        r[(0, 2)],
        r[(1, 2)],
        r[(2, 2)],
    ]);
    Rigid {
        linear,
        translation: b - linear * a,
    }
}

fn moved(mesh: &TriangleMesh, motion: &Rigid) -> TriangleMesh {
    TriangleMesh {
        points: mesh.points.iter().map(|&p| motion.apply(p)).collect(),
        triangles: mesh.triangles.clone(),
    }
}

fn mirrored(mesh: &TriangleMesh) -> TriangleMesh {
    let mut out = mesh.clone();
    out.points.iter_mut().for_each(|p| p.x = -p.x);
    out.flip();
    out
}

fn wrists(data: &Path) -> Vec<Pair> {
    let folder = data.join("carpal_myosim_apache2");
    let mut out = Vec::new();
    for bone in [
        "capitate",
        "hamate",
        "lunate",
        "scaphoid",
        "trapezium",
        "trapezoid",
        "triquetrum",
    ] {
        let fine = read(&folder.join(format!("frameA/arm_r_{bone}.stl")), Units::M);
        for (side, flip) in [("rvs", false), ("lvs", true)] {
            let coarse = read(
                &folder.join(format!("lowres_rvs_lvs/{bone}_{side}.stl")),
                Units::M,
            );
            if let (Some(target), Some(source)) = (fine.clone(), coarse) {
                out.push(Pair {
                    name: format!("{bone} {side}"),
                    target,
                    source: if flip { mirrored(&source) } else { source },
                    corresponds: false,
                });
            }
        }
    }
    out
}

fn sides(data: &Path) -> Vec<Pair> {
    let bones = [
        "Calcaneous",
        "Cuboid",
        "IntermediateCuneiform",
        "LateralCuneiform",
        "MedialCuneiform",
        "Navicular",
        "Patella",
        "Talus",
    ];
    let pair = |bone: &&str| {
        let side = |side: &str| {
            let file = format!("tarsal_visiblehuman_ccby4/VHF_{side}/VHF_{side}_Bone_{bone}_smooth.stl");
            read(&data.join(file), Units::Mm)
        };
        Some(Pair {
            name: bone.to_string(),
            target: side("Right")?,
            source: mirrored(&side("Left")?),
            corresponds: false,
        })
    };
    bones.iter().filter_map(pair).collect()
}

/// Individuals of the shape model: bones and how many of each.
fn of_model(data: &Path, bones: &[(&str, usize)]) -> Vec<Pair> {
    let folder = data.join("knee_ssm_synthetic_localonly");
    let mut out = Vec::new();
    for &(bone, count) in bones {
        let all: Vec<(usize, TriangleMesh)> = (1..=count)
            .filter_map(|k| {
                let file = folder.join(format!("S{k:03}_{bone}.ply"));
                Some((k, read(&file, Units::Mm)?))
            })
            .collect();
        for (i, (a, target)) in all.iter().enumerate() {
            // Every pair of femurs and tibias, neighbours among the patellas.
            for (b, source) in all.iter().skip(i + 1).take(if count > 4 { 1 } else { 3 }) {
                out.push(Pair {
                    name: format!("{bone} {a} {b}"),
                    target: target.clone(),
                    source: source.clone(),
                    corresponds: true,
                });
            }
        }
    }
    out
}

fn individuals() -> Vec<Pair> {
    let mut out = Vec::new();
    for reference in synthetic::all(0) {
        let family = population(&reference, 4, 11);
        let meshes: Vec<TriangleMesh> = family
            .individuals
            .iter()
            .map(|one| {
                let mesh = one.shape.mesh(6000);
                TriangleMesh {
                    points: mesh.points,
                    triangles: mesh.triangles,
                }
            })
            .collect();
        for k in 1..meshes.len() {
            out.push(Pair {
                name: format!("{} {k}", reference.name),
                target: meshes[0].clone(),
                source: meshes[k].clone(),
                corresponds: true,
            });
        }
    }
    out
}

fn read(path: &Path, units: Units) -> Option<TriangleMesh> {
    let settings = ReadSettings {
        units: Some(units),
        ..Default::default()
    };
    match read_shape(path, &settings).ok()?.geometry {
        Geometry::Mesh(mesh) => Some(mesh),
        _ => None,
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
