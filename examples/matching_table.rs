//! Prints what the scaffolds alone say of real bones: how often they give the pose, and whose bone is nearest to whose.
//!
//! `cargo run --release --example matching_table -- [BONES] [pose] [identity] [carpals] [population] [names]` with the bones of `../shared/data` (or of the folder
//! in `MEDIAL_DATA`). `pose`: every bone against itself, sampled again (other seed, four times the points, noise of half the
//! spacing), in a random pose. `identity`: right tarsals of one person
//! against the mirrored left ones. `carpals`: the same for a wrist, and two persons' wrists. `population`: four (or BONES)
//! individuals of eight synthetic carpal-like bones, whose correspondences are known. `names`: whole sets of bones named one to one by
//! their surfaces, of one person's two sides, of two persons, of a shape model's and of synthetic individuals.

use datasets_synthetic::{Warp, bones as synthetic, population as synthetic_population};
use glam::{DMat3, DQuat, DVec3};
use medial_scaffold::coarse_scaffold::{
    CoarseScaffold, CoarseScaffoldSettings, Curve, CurveKind, Sheet, coarse_scaffold,
};
use medial_scaffold::fine_scaffold::{FineScaffoldSettings, fine_scaffold};
use medial_scaffold::geometry::{Length, Rigid, TriangleMesh};
use medial_scaffold::input::sampling::{SamplingSettings, sample};
use medial_scaffold::input::{Geometry, ReadSettings, Shape, Units, read_shape};
use medial_scaffold::matching::{
    Matching, MatchingSettings, ShapeDistance, match_scaffolds, match_scaffolds_at,
};
use medial_scaffold::registration::{
    Mirror, NamingSettings, RegistrationSettings, RegistrationShape, name_shapes, register,
};
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
    if chosen("population") {
        population(most.min(4) as u64);
    }
    if right.is_empty() || carpals.is_empty() {
        println!("skipped: no bones in {} (set MEDIAL_DATA)", data.display());
        return;
    }
    if chosen("pose") {
        let all: Vec<&Bone> = right.iter().chain(&carpals).take(most).collect();
        poses(&all);
    }
    if chosen("names") {
        names(&data, &carpals, [&right, &left]);
    }
    if chosen("identity") {
        let (r, l) = (named(&right, most), named(&left, most));
        identity("Tarsals of one person, right and mirrored left", &r, &l, true);
    }
    if chosen("carpals") {
        let folder = data.join("carpal_myosim_apache2/lowres_rvs_lvs");
        let (one_side, other_side): (Vec<Bone>, Vec<Bone>) = bones(&folder, Units::M)
            .into_iter()
            .partition(|b| b.name.ends_with("rvs"));
        let (first, r, l) = (
            named(&carpals, most),
            named(&one_side, most),
            named(&other_side, most),
        );
        identity(
            "Carpals of one person, right and mirrored left, 34 to 90 points each",
            &r,
            &l,
            true,
        );
        identity("Carpals of two persons, right", &first, &r, false);
        identity(
            "Carpals of two persons, right and mirrored left",
            &first,
            &l,
            true,
        );
    }
}

/// Sets of bones named jointly on their surfaces: one person's two sides, and several persons.
fn names(data: &Path, carpals: &[Bone], tarsals: [&[Bone]; 2]) {
    println!(
        "\n| sets | nearest, without size | jointly, without size | wrong in doubt | right in doubt | nearest, with size | jointly, with size | wrong in doubt | right in doubt | size ratio | mirrored | s |"
    );
    println!("|{}", "---|".repeat(12));
    let folder = data.join("carpal_myosim_apache2/lowres_rvs_lvs");
    let (coarse_right, coarse_left): (Vec<Bone>, Vec<Bone>) = bones(&folder, Units::M)
        .into_iter()
        .partition(|b| b.name.ends_with("rvs"));
    joint("carpals of two persons, right", carpals, &coarse_right);
    joint("carpals of two persons, right and left", carpals, &coarse_left);
    joint("one coarse wrist, right and left", &coarse_right, &coarse_left);
    joint("tarsals of one person, right and left", tarsals[0], tarsals[1]);
    let knees = bones(&data.join("knee_ssm_synthetic_localonly"), Units::Mm);
    let knee = |person: &str| -> Vec<Bone> {
        let of = knees.iter().filter(|b| b.name.starts_with(person));
        of.map(|b| Bone {
            name: b.name.clone(),
            mesh: b.mesh.clone(),
        })
        .collect()
    };
    for (a, b) in [
        ("S001", "S002"),
        ("S001", "S003"),
        ("S002", "S004"),
        ("S003", "S004"),
    ] {
        joint(&format!("knees {a} and {b}"), &knee(a), &knee(b));
    }
    let person = |k: u64| -> Vec<Bone> {
        let bone = |kind: &synthetic::Bone| {
            let reference = synthetic::bone(*kind, 0);
            let shape = if k == 0 {
                reference
            } else {
                synthetic_population::individual(&reference, k).shape
            };
            let made = shape.mesh(6000);
            Bone {
                name: kind.name().to_owned(),
                mesh: TriangleMesh {
                    points: made.points,
                    triangles: made.triangles,
                },
            }
        };
        synthetic::Bone::ALL.iter().map(bone).collect()
    };
    for (a, b) in [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)] {
        joint(&format!("synthetic carpals {a} and {b}"), &person(a), &person(b));
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

/// Bones by name with their scaffolds.
type Named = Vec<(String, CoarseScaffold)>;

fn short(name: &str) -> String {
    let parts = [
        "arm_r_",
        "_rvs",
        "_lvs",
        "VHF_Right_Bone_",
        "VHF_Left_Bone_",
        "_smooth",
    ];
    let bare = parts.iter().fold(name.to_owned(), |n, part| n.replace(part, ""));
    // Individuals of the shape model: S001_Femur.
    bare.split_once('_')
        .map_or(bare.clone(), |(_, bone)| bone.to_owned())
}

fn views(set: &[TriangleMesh]) -> Vec<RegistrationShape<'_>> {
    set.iter().map(RegistrationShape::mesh).collect()
}

/// Names one set of bones by another on their surfaces: every bone by its nearest, with and without size, and all jointly.
fn joint(title: &str, targets: &[Bone], sources: &[Bone]) {
    let shapes = |set: &[Bone]| -> Vec<TriangleMesh> { set.iter().map(|b| b.mesh.clone()).collect() };
    let (a, b) = (shapes(targets), shapes(sources));
    let same = |i: usize, j: usize| short(&targets[i].name) == short(&sources[j].name);
    let mut cells = Vec::new();
    let clock = Instant::now();
    for size_weight in [0.0, NamingSettings::default().size_weight] {
        let settings = NamingSettings {
            mirror: Mirror::Auto,
            size_weight,
            ..Default::default()
        };
        let found = name_shapes(&views(&a), &views(&b), &settings).expect("the meshes are sound");
        let cost = |i: usize, j: usize| {
            let size = size_weight * (found.size_ratios[i][j] / found.size_ratio).ln();
            found.differences[i][j].hypot(size)
        };
        let least = |costs: Vec<f64>| (0..costs.len()).min_by(|&x, &y| costs[x].total_cmp(&costs[y]));
        let of_target = (0..a.len())
            .filter(|&i| least((0..b.len()).map(|j| cost(i, j)).collect()).is_some_and(|j| same(i, j)))
            .count();
        let of_source = (0..b.len())
            .filter(|&j| least((0..a.len()).map(|i| cost(i, j)).collect()).is_some_and(|i| same(i, j)))
            .count();
        for i in 0..a.len() {
            for j in (0..b.len()).filter(|&j| same(i, j)) {
                let (name, own) = (short(&targets[i].name), cost(i, j));
                let nearer = |c: f64, other: String| {
                    if c < own {
                        println!(
                            "<!-- {title}, weight {size_weight}: {name} {own:.4}, but {c:.4} from {other} -->"
                        );
                    }
                };
                (0..b.len())
                    .for_each(|k| nearer(cost(i, k), format!("the source's {}", short(&sources[k].name))));
                (0..a.len())
                    .for_each(|k| nearer(cost(k, j), format!("the target's {}", short(&targets[k].name))));
            }
        }
        let right = found.pairs.iter().filter(|p| same(p.target, p.source)).count();
        let wrong: Vec<_> = found.pairs.iter().filter(|p| !same(p.target, p.source)).collect();
        let flagged = |w: bool| {
            let of = found
                .pairs
                .iter()
                .filter(|p| same(p.target, p.source) != w && p.ambiguous);
            of.count()
        };
        let leads: Vec<f64> = found
            .pairs
            .iter()
            .map(|p| (p.lead * 100.0).round() / 100.0)
            .collect();
        println!("<!-- {title}, weight {size_weight}: leads {leads:?} -->");
        cells.push(format!(
            "{}/{} | {right}/{} | {}/{} | {}/{right}",
            of_target + of_source,
            a.len() + b.len(),
            found.pairs.len(),
            flagged(true),
            wrong.len(),
            flagged(false),
        ));
        if size_weight > 0.0 {
            cells.push(format!("{:.2} | {}", found.size_ratio, found.mirrored));
        }
    }
    println!(
        "| {title} | {} | {:.1} |",
        cells.join(" | "),
        clock.elapsed().as_secs_f64()
    );
}

fn named(bones: &[Bone], most: usize) -> Named {
    let all: Vec<&Bone> = bones.iter().take(most).collect();
    all.iter()
        .filter_map(|b| Some((short(&b.name), scaffold(&b.mesh, 10_000, 1, 0.0)?)))
        .collect()
}

/// The ways to say how far apart two bones are.
const MEASURES: [&str; 6] = [
    "aligned, with size",
    "aligned, without",
    "distributions, with",
    "distributions, without",
    "structure, mm",
    "structure, share",
];

fn measures(d: &ShapeDistance) -> [f64; 6] {
    [
        d.with_size_mm,
        d.without_size,
        d.distribution_mm,
        d.distribution,
        d.structure_mm,
        d.structure,
    ]
}

/// Names every bone of either set by its nearest in the other; prints who is taken for whom.
fn identity(title: &str, a: &Named, b: &Named, mirrored: bool) {
    let settings = MatchingSettings {
        mirrored,
        ..Default::default()
    };
    let table: Vec<Vec<[f64; 6]>> = a
        .iter()
        .map(|(_, s)| {
            b.iter()
                .map(|(_, t)| measures(&match_scaffolds(s, t, &settings).shape_distance))
                .collect()
        })
        .collect();
    println!("\n{title}: nearest of the other set, wrong ones named\n");
    println!("| bone | {} |", MEASURES.join(" | "));
    println!("|---|{}", "---|".repeat(MEASURES.len()));
    let mut right = [0; 6];
    let mut row = |name: &str, others: &Named, distance: &dyn Fn(usize) -> [f64; 6]| {
        let cells: Vec<String> = (0..MEASURES.len())
            .map(|m| {
                let nearest = (0..others.len())
                    .min_by(|&i, &j| distance(i)[m].total_cmp(&distance(j)[m]))
                    .expect("there are bones");
                if others[nearest].0 == name {
                    right[m] += 1;
                    "right".to_owned()
                } else {
                    others[nearest].0.clone()
                }
            })
            .collect();
        if cells.iter().any(|c| c != "right") {
            println!("| {name} | {} |", cells.join(" | "));
        }
    };
    for (i, (name, _)) in a.iter().enumerate() {
        row(name, b, &|j| table[i][j]);
    }
    for (j, (name, _)) in b.iter().enumerate() {
        row(name, a, &|i| table[i][j]);
    }
    let total = a.len() + b.len();
    println!(
        "| **right of {total}** | {} |",
        right.map(|r| r.to_string()).join(" | ")
    );
}

/// One bone of one individual of the synthetic population.
struct Member {
    bone: &'static str,
    person: u64,
    /// From the reference, person 0.
    warp: Warp,
    scaffold: CoarseScaffold,
}

/// Eight carpal-like bones of several individuals: who is nearest, and who corresponds to whom.
fn population(persons: u64) {
    let mut members = Vec::new();
    for kind in synthetic::Bone::ALL {
        let reference = synthetic::bone(kind, 0);
        let modes = synthetic_population::modes(&reference.bounds());
        for person in 0..persons {
            let (shape, warp) = if person == 0 {
                (reference.clone(), synthetic_population::warp_of(&modes, &[]))
            } else {
                let one = synthetic_population::individual(&reference, person);
                (one.shape, one.warp)
            };
            let made = shape.mesh(20_000);
            let mesh = TriangleMesh {
                points: made.points,
                triangles: made.triangles,
            };
            if let Some(scaffold) = scaffold(&mesh, 10_000, 1 + person, 0.0) {
                members.push(Member {
                    bone: kind.name(),
                    person,
                    warp,
                    scaffold,
                });
            }
        }
    }
    let settings = MatchingSettings::default();
    let found: Vec<Vec<Option<Matching>>> = members
        .iter()
        .enumerate()
        .map(|(i, a)| {
            let with = |(j, b): (usize, &Member)| {
                (j < i && a.person != b.person).then(|| match_scaffolds(&b.scaffold, &a.scaffold, &settings))
            };
            members.iter().enumerate().map(with).collect()
        })
        .collect();
    let between = |i: usize, j: usize| found[i.max(j)][i.min(j)].as_ref();
    println!(
        "\n{persons} individuals of 8 carpal-like bones, each against the bones of all others: the nearest, wrong ones named\n"
    );
    println!("| bone | {} |", MEASURES.join(" | "));
    println!("|---|{}", "---|".repeat(MEASURES.len()));
    let mut right = [0; 6];
    for (i, a) in members.iter().enumerate() {
        let cells: Vec<String> = (0..MEASURES.len())
            .map(|m| {
                let nearest = (0..members.len())
                    .filter_map(|j| Some((measures(&between(i, j)?.shape_distance)[m], j)))
                    .min_by(|x, y| x.0.total_cmp(&y.0));
                match nearest {
                    Some((_, j)) if members[j].bone == a.bone => {
                        right[m] += 1;
                        "right".to_owned()
                    }
                    Some((_, j)) => members[j].bone.to_owned(),
                    None => "none".to_owned(),
                }
            })
            .collect();
        if cells.iter().any(|c| c != "right") {
            println!("| {} of {} | {} |", a.bone, a.person, cells.join(" | "));
        }
    }
    println!(
        "| **right of {}** | {} |",
        members.len(),
        right.map(|r| r.to_string()).join(" | ")
    );
    let mut counts = Counts::default();
    for (i, a) in members.iter().enumerate() {
        for (j, b) in members.iter().enumerate() {
            // The reference is the target: it comes first in the list of its bone.
            if a.bone == b.bone
                && (b.person, a.person) != (0, 0)
                && b.person == 0
                && let Some(m) = between(i, j)
            {
                counts.add(b, a, m);
            }
        }
    }
    counts.print();
}

/// How many elements of the reference have a counterpart in an individual, and how many of those matching finds.
#[derive(Default)]
struct Counts {
    poses: usize,
    within: usize,
    curves: [usize; 3],
    sheets: [usize; 3],
}

impl Counts {
    /// The true counterpart of an element is the nearest of its kind to where the warp takes it, when both lie within 4 % of the
    /// diagonal of one another on average; an element without one does not count.
    fn add(&mut self, target: &Member, source: &Member, m: &Matching) {
        let (a, b) = (&target.scaffold, &source.scaffold);
        let reach = 0.04 * a.diagonal_mm;
        let cut = 1.5 * a.tolerance_mm.max(b.tolerance_mm);
        // Individuals are in the frame of the reference: the pose should be near the identity.
        self.poses += 1;
        self.within += usize::from(m.T_target_source.rotation_angle_deg(&Rigid::IDENTITY) < 15.0);
        let axial = |c: &&Curve| c.kind == CurveKind::Axial && c.persistence > cut;
        let points = |c: &Curve| -> Vec<DVec3> { c.polyline.iter().map(|p| p.position).collect() };
        for c in a.curves.iter().filter(axial) {
            let moved: Vec<DVec3> = points(c)
                .into_iter()
                .map(|p| target_to_source(source, p))
                .collect();
            let others = b.curves.iter().filter(axial).map(|d| (d.id.0, points(d)));
            let truth = counterpart(&moved, others, reach);
            let named = m.correspondences.curves.iter().find(|p| p.target == c.id);
            tally(&mut self.curves, truth, named.map(|p| p.source.0));
        }
        let spots = |s: &Sheet| -> Vec<DVec3> {
            let step = s.mesh.vertices.len().div_ceil(300).max(1);
            s.mesh.vertices.iter().step_by(step).map(|v| v.position).collect()
        };
        for s in a.sheets.iter().filter(|s| s.persistence > cut) {
            let moved: Vec<DVec3> = spots(s)
                .into_iter()
                .map(|p| target_to_source(source, p))
                .collect();
            let others = b
                .sheets
                .iter()
                .filter(|t| t.persistence > cut)
                .map(|t| (t.id.0, spots(t)));
            let truth = counterpart(&moved, others, reach);
            let named = m.correspondences.sheets.iter().find(|p| p.target == s.id);
            tally(&mut self.sheets, truth, named.map(|p| p.source.0));
        }
    }

    fn print(&self) {
        println!(
            "\nReference against individual, by the warp that made it ({} pairs, {} within 15 degrees):\n",
            self.poses, self.within
        );
        println!(
            "| elements of persistence > 1.5 tau with a counterpart | named right | named wrong | left out |"
        );
        println!("|---|---|---|---|");
        for (name, c) in [("axial curves", self.curves), ("sheets", self.sheets)] {
            println!(
                "| {} {name} | {} | {} | {} |",
                c.iter().sum::<usize>(),
                c[0],
                c[1],
                c[2]
            );
        }
    }
}

fn target_to_source(source: &Member, p: DVec3) -> DVec3 {
    source.warp.apply(p)
}

/// Right, wrong, left out.
fn tally(counts: &mut [usize; 3], truth: Option<u32>, named: Option<u32>) {
    match (truth, named) {
        (Some(t), Some(n)) if t == n => counts[0] += 1,
        (Some(_), Some(_)) => counts[1] += 1,
        (Some(_), None) => counts[2] += 1,
        (None, _) => {}
    }
}

/// The candidate nearest to the points, both ways on average, when that is within reach.
fn counterpart(
    points: &[DVec3],
    candidates: impl Iterator<Item = (u32, Vec<DVec3>)>,
    reach: f64,
) -> Option<u32> {
    let one_way = |from: &[DVec3], to: &[DVec3]| {
        let nearest = |p: &DVec3| to.iter().map(|q| p.distance(*q)).fold(f64::INFINITY, f64::min);
        from.iter().map(nearest).sum::<f64>() / from.len().max(1) as f64
    };
    candidates
        .map(|(id, other)| (one_way(points, &other).max(one_way(&other, points)), id))
        .filter(|c| c.0 < reach)
        .min_by(|x, y| x.0.total_cmp(&y.0))
        .map(|c| c.1)
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
