//! Point sets that are known to hurt: random ones of several kinds, and one hundred degenerate ones.
#![allow(dead_code)]

use glam::DVec3;
use rand::{Rng, RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn unit(rng: &mut impl Rng) -> DVec3 {
    loop {
        let p = DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        if (0.01..1.0).contains(&p.length_squared()) {
            return p.normalize();
        }
    }
}

/// A small random fixture; the seed chooses kind and size.
pub fn random(seed: u64) -> Vec<DVec3> {
    let mut rng = rng(seed);
    let n = rng.random_range(4..=60);
    let kind = seed % 8;
    (0..n)
        .map(|_| {
            let cube = DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
            match kind {
                0 => cube,
                1 => unit(&mut rng) * DVec3::new(3.0, 2.0, 1.0),
                2 => unit(&mut rng),
                3 => (cube * 2.0).round(),
                4 => (cube * 3.0).round() * 1e6 + DVec3::splat(0.1),
                5 => cube * DVec3::new(1.0, 1.0, 1e-9),
                6 => DVec3::new((cube.x * 4.0).round() * 0.1, (cube.y * 4.0).round() * 0.1, cube.z),
                _ => unit(&mut rng) + (cube * 1e-15),
            }
        })
        .collect()
}

pub fn grid(nx: i32, ny: i32, nz: i32) -> Vec<DVec3> {
    let mut out = Vec::new();
    for x in 0..nx {
        for y in 0..ny {
            for z in 0..nz {
                out.push(DVec3::new(x.into(), y.into(), z.into()));
            }
        }
    }
    out
}

/// Integer points on the sphere of squared radius `rr`.
pub fn integer_sphere(rr: i32) -> Vec<DVec3> {
    let r = f64::from(rr).sqrt() as i32 + 1;
    grid(2 * r + 1, 2 * r + 1, 2 * r + 1)
        .into_iter()
        .map(|p| p - DVec3::splat(r.into()))
        .filter(|p| p.length_squared() == f64::from(rr))
        .collect()
}

fn octahedron() -> Vec<DVec3> {
    [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .flat_map(|a| [a, -a])
        .collect()
}

fn with(mut points: Vec<DVec3>, more: impl IntoIterator<Item = DVec3>) -> Vec<DVec3> {
    points.extend(more);
    points
}

fn scaled(points: &[DVec3], s: f64) -> Vec<DVec3> {
    points.iter().map(|&p| p * s).collect()
}

/// One hundred degenerate fixtures and more: flat, lattice, cospherical, cocircular, repeated, extreme in scale.
pub fn degenerate() -> Vec<(String, Vec<DVec3>)> {
    let mut out: Vec<(String, Vec<DVec3>)> = Vec::new();
    let mut add = |name: String, points: Vec<DVec3>| out.push((name, points));
    for n in 0..=4 {
        add(
            format!("{n} points on a line"),
            (0..n).map(|i| DVec3::splat(f64::from(i))).collect(),
        );
    }
    add("one point five times".into(), vec![DVec3::new(0.1, 0.2, 0.3); 5]);
    add("triangle".into(), vec![DVec3::X, DVec3::Y, DVec3::Z]);
    for n in [2, 3, 5] {
        add(format!("flat grid {n}"), grid(n, n, 1));
        add(format!("upright flat grid {n}"), grid(1, n, n));
        add(format!("grid {n}"), grid(n, n, n));
        add(
            format!("grid with centres {n}"),
            with(grid(n, n, n), grid(n - 1, n - 1, n - 1).iter().map(|p| *p + 0.5)),
        );
        add(
            format!("sheared grid {n}"),
            grid(n, n, n).iter().map(|p| *p + DVec3::X * p.y).collect(),
        );
        add(
            format!("face-centred {n}"),
            grid(2 * n, n, n)
                .into_iter()
                .filter(|p| (p.x + p.y + p.z) % 2.0 == 0.0)
                .collect(),
        );
        add(format!("two layers {n}"), grid(n, n, 2));
        add(format!("grid of tenths {n}"), scaled(&grid(n, n, n), 0.1));
        add(
            format!("grid far away {n}"),
            grid(n, n, n).iter().map(|p| *p + 1e9).collect(),
        );
        add(
            format!("anisotropic grid {n}"),
            grid(n, n, n)
                .iter()
                .map(|p| *p * DVec3::new(0.5, 0.5, 2.0))
                .collect(),
        );
        add(format!("grid twice {n}"), with(grid(n, n, n), grid(n, n, n)));
    }
    add("octahedron".into(), octahedron());
    add("octahedron with centre".into(), with(octahedron(), [DVec3::ZERO]));
    add(
        "octahedron, centre and cube".into(),
        with(
            with(octahedron(), [DVec3::ZERO]),
            grid(3, 3, 3).iter().map(|p| *p - 1.0),
        ),
    );
    add(
        "octahedra in a row".into(),
        (0..6)
            .flat_map(|k| {
                octahedron()
                    .into_iter()
                    .map(move |p| p + 2.0 * f64::from(k) * DVec3::X)
            })
            .collect(),
    );
    for rr in [1, 2, 3, 5, 9, 14, 27, 50, 81, 146] {
        add(format!("integer sphere {rr}"), integer_sphere(rr));
        add(
            format!("integer sphere with centre {rr}"),
            with(integer_sphere(rr), [DVec3::ZERO]),
        );
        add(
            format!("integer sphere beside itself {rr}"),
            with(integer_sphere(rr), integer_sphere(rr).iter().map(|p| *p + 3.0)),
        );
    }
    for rr in [5, 25, 65, 325] {
        let circle: Vec<DVec3> = integer_sphere(rr).into_iter().filter(|p| p.z == 0.0).collect();
        add(format!("cocircular {rr}"), circle.clone());
        add(format!("cone {rr}"), with(circle.clone(), [DVec3::Z]));
        add(
            format!("double cone {rr}"),
            with(circle.clone(), [DVec3::Z, -DVec3::Z]),
        );
        add(
            format!("prism {rr}"),
            with(circle.clone(), circle.iter().map(|p| *p + DVec3::Z)),
        );
        add(
            format!("stack of circles {rr}"),
            (0..4)
                .flat_map(|k| circle.iter().map(move |p| *p + f64::from(k) * DVec3::Z))
                .collect(),
        );
    }
    for seed in 0..8 {
        let mut rng = rng(1000 + seed);
        add(
            format!("points on a line and one off it {seed}"),
            with(
                (0..20).map(|i| DVec3::X * f64::from(i)).collect(),
                [unit(&mut rng)],
            ),
        );
        add(
            format!("two skew lines {seed}"),
            (0..12)
                .flat_map(|i| [DVec3::X * f64::from(i), DVec3::new(3.0, f64::from(i), 5.0)])
                .take(8 + 2 * seed as usize)
                .collect(),
        );
        add(
            format!("plane and one point {seed}"),
            with(grid(4, 4, 1), [unit(&mut rng) + 2.0]),
        );
        add(
            format!("random points of a plane {seed}"),
            (0..30)
                .map(|_| DVec3::new(rng.random_range(0..8).into(), rng.random_range(0..8).into(), 7.0))
                .collect(),
        );
    }
    for s in [1e-300, 1e-200, 1e-110, 1e200, 1e300] {
        add(format!("grid at scale {s:e}"), scaled(&grid(3, 3, 3), s));
        add(format!("random at scale {s:e}"), scaled(&random(8), s));
    }
    add(
        "coordinates of very different size".into(),
        with(
            grid(2, 2, 2),
            [DVec3::new(1e-40, 1e-30, 0.5), DVec3::new(0.5, 1e20, 1e-17)],
        ),
    );
    out
}

/// The same points in another order.
pub fn shuffled(points: &[DVec3], seed: u64) -> Vec<DVec3> {
    let mut out = points.to_vec();
    out.shuffle(&mut rng(seed));
    out
}

/// `n` uniform points of a cube.
pub fn random_cube(n: usize, seed: u64) -> Vec<DVec3> {
    let mut rng = rng(seed);
    (0..n)
        .map(|_| DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0))))
        .collect()
}

/// Sets large enough for several threads to work on.
pub fn larger() -> Vec<(String, Vec<DVec3>)> {
    let mut rng = rng(77);
    let n = if std::env::var_os("MEDIAL_SLOW").is_some() {
        60_000
    } else {
        6_000
    };
    let cube = (0..n)
        .map(|_| DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0))))
        .collect();
    let sphere = (0..n).map(|_| unit(&mut rng)).collect();
    let ellipsoid = (0..n)
        .map(|_| unit(&mut rng) * DVec3::new(3.0, 2.0, 1.0))
        .collect();
    let flat = (0..n)
        .map(|_| {
            DVec3::new(
                rng.random_range(-1.0..1.0),
                rng.random_range(-1.0..1.0),
                1e-3 * rng.random_range(-1.0..1.0),
            )
        })
        .collect();
    vec![
        ("cube".into(), cube),
        ("sphere".into(), sphere),
        ("ellipsoid".into(), ellipsoid),
        ("flat slab".into(), flat),
        ("grid".into(), shuffled(&grid(18, 18, 18), 1)),
    ]
}
