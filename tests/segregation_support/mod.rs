//! Meshes, samples and files for the segregation tests.
#![allow(dead_code)]

use glam::DVec3;
use medial_scaffold::geometry::TriangleMesh;
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
