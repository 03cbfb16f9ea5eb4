//! Meshes, samples and files for the segregation tests.
#![allow(dead_code)]

use glam::DVec3;
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::segregation::{CloudSegregation, SegregationSettings, segregate_cloud};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

/// A torus of `n` by `m` quads, each split in two.
pub fn torus(major: f64, minor: f64, n: u32, m: u32) -> TriangleMesh {
    let points = (0..n)
        .flat_map(|i| (0..m).map(move |j| (i, j)))
        .map(|(i, j)| {
            let (u, v) = (
                TAU * f64::from(i) / f64::from(n),
                TAU * f64::from(j) / f64::from(m),
            );
            let r = major + minor * v.cos();
            DVec3::new(r * u.cos(), r * u.sin(), minor * v.sin())
        })
        .collect();
    let at = |i: u32, j: u32| (i % n) * m + j % m;
    let triangles = (0..n)
        .flat_map(|i| (0..m).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            [[a, b, c], [a, c, d]]
        })
        .collect();
    TriangleMesh { points, triangles }
}

/// A sphere of `n` rings of `2 n` points and two poles.
pub fn sphere(radius: f64, n: u32) -> TriangleMesh {
    let m = 2 * n;
    let mut points = vec![DVec3::Z * radius];
    for i in 1..n {
        let t = PI * f64::from(i) / f64::from(n);
        for j in 0..m {
            let p = TAU * f64::from(j) / f64::from(m);
            points.push(radius * DVec3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos()));
        }
    }
    points.push(-DVec3::Z * radius);
    let last = points.len() as u32 - 1;
    let at = |i: u32, j: u32| 1 + (i - 1) * m + j % m;
    let mut triangles = Vec::new();
    for j in 0..m {
        triangles.push([0, at(1, j), at(1, j + 1)]);
        triangles.push([last, at(n - 1, j + 1), at(n - 1, j)]);
        for i in 1..n - 1 {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    TriangleMesh { points, triangles }
}

/// `n` points on a mesh, uniform by area.
pub fn sample(mesh: &TriangleMesh, n: usize, seed: u64) -> Vec<DVec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut total = 0.0;
    let sums: Vec<f64> = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            total += (b - a).cross(c - a).length();
            total
        })
        .collect();
    (0..n)
        .map(|_| {
            let x = rng.random::<f64>() * total;
            let t = sums.partition_point(|s| *s < x).min(sums.len() - 1);
            let [a, b, c] = mesh.triangles[t].map(|i| mesh.points[i as usize]);
            let (mut u, mut v) = (rng.random::<f64>(), rng.random::<f64>());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            a + u * (b - a) + v * (c - a)
        })
        .collect()
}

/// `n` points on a mesh with one hole: of a larger sample those nearest to a random point of the surface, on the side of it
/// that faces the same way, are left out, `share` of all, so that the hole has that share of the area.
pub fn sample_with_hole(mesh: &TriangleMesh, n: usize, share: f64, seed: u64) -> Vec<DVec3> {
    let all = (n as f64 / (1.0 - share)).round() as usize;
    let points = sample(mesh, all, seed);
    let closest = medial_scaffold::geometry::ClosestOnMesh::new(mesh).expect("the mesh has triangles");
    let normals: Vec<DVec3> = points
        .iter()
        .map(|&p| {
            let [a, b, c] =
                mesh.triangles[closest.closest(p).triangle as usize].map(|i| mesh.points[i as usize]);
            (b - a).cross(c - a).normalize_or_zero()
        })
        .collect();
    let centre = (seed as usize * 7919) % all;
    let mut order: Vec<usize> = (0..all).collect();
    order.sort_by(|&i, &j| {
        let key = |k: usize| {
            let turned = normals[k].dot(normals[centre]) < -0.2;
            (turned, points[k].distance(points[centre]))
        };
        let (a, b) = (key(i), key(j));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    order[all - n..].iter().map(|&k| points[k]).collect()
}

/// The folder of real shapes, when there is one.
pub fn data() -> Option<PathBuf> {
    let root = std::env::var_os("MEDIAL_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    root.is_dir().then_some(root)
}

/// The STL file of a data folder whose name holds `word`; says so when there is none.
pub fn data_mesh(folder: &str, word: &str) -> Option<TriangleMesh> {
    let found = data().and_then(|root| {
        let mut files: Vec<PathBuf> = std::fs::read_dir(root.join(folder))
            .ok()?
            .filter_map(|e| Some(e.ok()?.path()))
            .filter(|p| p.to_string_lossy().contains(word) && p.extension().is_some_and(|e| e == "stl"))
            .collect();
        files.sort();
        files.into_iter().next()
    });
    let Some(path) = found else {
        println!("skipped: no {word} in {folder} (set MEDIAL_DATA to the folder of real shapes)");
        return None;
    };
    let mut file = std::fs::File::open(&path).expect("the file was listed");
    let stl = stl_io::read_stl(&mut file).expect("an STL file");
    Some(TriangleMesh {
        points: stl
            .vertices
            .iter()
            .map(|v| DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2])))
            .collect(),
        triangles: stl.faces.iter().map(|f| f.vertices.map(|i| i as u32)).collect(),
    })
}

/// A box of the given size with its corner at the origin.
pub fn cuboid(size: DVec3) -> TriangleMesh {
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * size;
    TriangleMesh {
        points: (0..8).map(corner).collect(),
        triangles: vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ],
    }
}

/// A right prism over a regular polygon of `n` corners.
pub fn prism(n: u32, radius: f64, height: f64) -> TriangleMesh {
    let mut points = Vec::new();
    for z in [0.0, height] {
        for i in 0..n {
            let a = TAU * f64::from(i) / f64::from(n);
            points.push(DVec3::new(radius * a.cos(), radius * a.sin(), z));
        }
    }
    let mut triangles = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
        if i > 0 && j > 0 {
            triangles.extend([[0, j, i], [n, n + i, n + j]]);
        }
    }
    TriangleMesh { points, triangles }
}

/// A tube of the given radius round a closed curve.
pub fn tube(curve: impl Fn(f64) -> DVec3, radius: f64, n: u32, m: u32) -> TriangleMesh {
    let at = |i: u32| curve(TAU * f64::from(i) / f64::from(n));
    let tangent = |i: u32| (at((i + 1) % n) - at((i + n - 1) % n)).normalize();
    // A frame carried along the curve; the turn left over after one round is spread evenly.
    let mut normals = vec![tangent(0).any_orthonormal_vector()];
    for i in 1..=n {
        let t = tangent(i % n);
        let before = normals[i as usize - 1];
        normals.push((before - t * before.dot(t)).normalize());
    }
    let (first, last) = (normals[0], normals[n as usize]);
    let t = tangent(0);
    let turn = first.cross(last).dot(t).atan2(first.dot(last));
    let mut points = Vec::new();
    for i in 0..n {
        let t = tangent(i);
        let u = normals[i as usize];
        let v = t.cross(u);
        let start = -turn * f64::from(i) / f64::from(n);
        for j in 0..m {
            let a = start + TAU * f64::from(j) / f64::from(m);
            points.push(at(i) + radius * (u * a.cos() + v * a.sin()));
        }
    }
    let index = |i: u32, j: u32| (i % n) * m + j % m;
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b, c, d) = (index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let mut mesh = TriangleMesh { points, triangles };
    if mesh.signed_volume() < 0.0 {
        mesh.flip();
    }
    mesh
}

/// A trefoil knot as a tube.
pub fn knot() -> TriangleMesh {
    tube(
        |t| {
            DVec3::new(
                t.sin() + 2.0 * (2.0 * t).sin(),
                t.cos() - 2.0 * (2.0 * t).cos(),
                -(3.0 * t).sin(),
            )
        },
        0.45,
        300,
        24,
    )
}

/// Shapes with exact meshes, by name.
pub fn shapes() -> Vec<(String, TriangleMesh)> {
    let mut ellipsoid = sphere(1.0, 80);
    for p in &mut ellipsoid.points {
        *p *= DVec3::new(1.0, 0.7, 0.5);
    }
    vec![
        ("ellipsoid".to_owned(), ellipsoid),
        ("torus".to_owned(), torus(1.0, 0.4, 160, 64)),
        ("box".to_owned(), cuboid(DVec3::new(1.0, 1.4, 2.0))),
        ("prism".to_owned(), prism(5, 1.0, 1.5)),
        ("knot".to_owned(), knot()),
    ]
}

/// A shape of the data folder, the triangles of all its parts; `None` (and a word) when it is not there.
pub fn data_shape(path: &str) -> Option<TriangleMesh> {
    use medial_scaffold::input::{Geometry, ReadSettings, read_shape};
    let file = data()?.join(path);
    if !file.is_file() {
        println!("skipped: no {path} (set MEDIAL_DATA to the folder of real shapes)");
        return None;
    }
    let shape = read_shape(&file, &ReadSettings::default()).expect("a readable file");
    match shape.geometry {
        Geometry::Mesh(mesh) => Some(mesh),
        _ => None,
    }
}

/// A sampled shape with isotropic Gaussian noise, a density that changes by the given ratio along x, and outliers in the
/// bounding box inflated by a tenth.
pub fn corrupted(
    mesh: &TriangleMesh,
    n: usize,
    sigma: f64,
    density: f64,
    outliers: f64,
    seed: u64,
) -> Vec<DVec3> {
    let [low, high] = mesh.bounds().expect("a mesh with points");
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(1_000_000));
    let mut points = Vec::with_capacity(n);
    let mut round = 0;
    while points.len() < n {
        for p in sample(mesh, n, seed.wrapping_mul(1009).wrapping_add(round)) {
            let share = (p.x - low.x) / (high.x - low.x);
            if points.len() < n && (density <= 1.0 || rng.random::<f64>() < density.powf(share - 1.0)) {
                points.push(p);
            }
        }
        round += 1;
    }
    shake_with(&mut points, sigma, &mut rng);
    let margin = 0.1 * (high - low);
    for _ in 0..(outliers * n as f64) as usize {
        let u = DVec3::new(rng.random(), rng.random(), rng.random());
        points.push(low - margin + u * (high - low + 2.0 * margin));
    }
    points
}

/// Adds isotropic Gaussian noise.
pub fn shake(points: &mut [DVec3], sigma: f64, seed: u64) {
    shake_with(
        points,
        sigma,
        &mut ChaCha8Rng::seed_from_u64(seed.wrapping_add(2_000_000)),
    );
}

fn shake_with(points: &mut [DVec3], sigma: f64, rng: &mut ChaCha8Rng) {
    use rand_distr::{Distribution, StandardNormal};
    if sigma > 0.0 {
        for p in points {
            let mut normal = || -> f64 { StandardNormal.sample(rng) };
            *p += sigma * DVec3::new(normal(), normal(), normal());
        }
    }
}

/// A mesh against the truth; distances in spacings.
pub struct Verdict {
    /// Closed, no bad edge or vertex, the true Euler number and components.
    pub right: bool,
    pub hausdorff: f64,
    pub mean: f64,
    /// Per cent; NaN for an open mesh.
    pub volume_error: f64,
    /// The part of the volume error that any mesh of these triangles has, its vertices on the true surface: per cent.
    pub inscription_error: f64,
    pub open_edges: usize,
}

/// Judges a mesh; distances are measured both ways, over its vertices, centroids and mid-edges and over points of the truth.
pub fn judge(surface: &TriangleMesh, truth: &TriangleMesh, spacing: f64) -> Verdict {
    use medial_scaffold::geometry::ClosestOnMesh;
    let (topology, wanted) = (surface.topology(), truth.topology());
    let to_truth = ClosestOnMesh::new(truth).expect("the truth has triangles");
    let mut distances: Vec<f64> = surface
        .triangles
        .iter()
        .flat_map(|t| {
            let [a, b, c] = t.map(|i| surface.points[i as usize]);
            [a, (a + b + c) / 3.0, 0.5 * (a + b), 0.5 * (b + c)]
        })
        .map(|p| to_truth.closest(p).distance2.sqrt())
        .collect();
    if let Some(to_surface) = ClosestOnMesh::new(surface) {
        let n = (4 * surface.points.len()).min(40_000);
        distances.extend(
            sample(truth, n, 99)
                .iter()
                .map(|&p| to_surface.closest(p).distance2.sqrt()),
        );
    }
    let volume = truth.signed_volume();
    let error = |mesh: &TriangleMesh| 100.0 * (mesh.signed_volume().abs() - volume) / volume;
    let (mut volume_error, mut inscription_error) = (f64::NAN, f64::NAN);
    if topology.watertight {
        volume_error = error(surface);
        let mut inscribed = surface.clone();
        for p in &mut inscribed.points {
            *p = to_truth.closest(*p).point;
        }
        inscription_error = error(&inscribed);
    }
    Verdict {
        right: topology.watertight
            && topology.nonmanifold_vertices == 0
            && topology.euler == wanted.euler
            && topology.components == wanted.components,
        hausdorff: distances.iter().copied().fold(0.0, f64::max) / spacing,
        mean: distances.iter().sum::<f64>() / distances.len().max(1) as f64 / spacing,
        volume_error,
        inscription_error,
        open_edges: topology.boundary_edges,
    }
}

/// The synthetic shapes, and the real ones that are there.
pub fn all_shapes() -> Vec<(String, TriangleMesh)> {
    let real = [
        ("fandisk", "generic_mixed_localonly/fandisk.off"),
        ("bunny", "generic_mixed_localonly/bunny.off"),
        ("rocker", "generic_mixed_localonly/rocker-arm.obj"),
        ("hand", "generic_mixed_localonly/hand.off"),
        (
            "calcaneus",
            "tarsal_visiblehuman_ccby4/VHF_Right/VHF_Right_Bone_Calcaneous_smooth.stl",
        ),
        ("capitate", "carpal_myosim_apache2/frameB/capitate.stl"),
    ];
    shapes()
        .into_iter()
        .chain(
            real.into_iter()
                .filter_map(|(name, path)| Some((name.to_owned(), data_shape(path)?))),
        )
        .collect()
}

/// A cloud of a surface given over the unit square, `n` points at random.
pub fn patch(n: usize, seed: u64, at: impl Fn(f64, f64) -> DVec3) -> Vec<DVec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| at(rng.random(), rng.random())).collect()
}

/// Segregates with the settings as they come.
pub fn cloud(points: &[DVec3]) -> CloudSegregation {
    segregate_cloud(points, &SegregationSettings::default()).expect("a finite cloud that spans space")
}

/// What a test prints of a result.
pub fn describe(r: &CloudSegregation) -> String {
    format!(
        "{} euler {} open {} nonmanifold {} + {} components {:?} rims {:?} unsupported {:.3}; {}; {:?}",
        if r.segregation.closed { "closed" } else { "open" },
        r.report.topology.euler,
        r.report.topology.boundary_edges,
        r.report.topology.nonmanifold_edges,
        r.report.topology.nonmanifold_vertices,
        r.report
            .components
            .iter()
            .map(|c| (c.points, c.euler))
            .collect::<Vec<_>>(),
        r.report.rims.iter().map(|r| r.edges).collect::<Vec<_>>(),
        r.report.decision.unsupported_area_share,
        r.report.decision.reason,
        r.report.doubts.iter().map(|d| d.kind).collect::<Vec<_>>(),
    )
}
