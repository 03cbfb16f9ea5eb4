//! Clouds by kind and size, for races and benches. Seeded: the same every time.
//!
//! Kinds: `cube` uniform; `ellipsoid` and `bone` surfaces with noise of 0.002; `sphere` unit sphere rounded to `f64`;
//! `grid` the integer lattice of the largest cube that fits.

use glam::DVec3;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// All kinds.
pub const KINDS: [&str; 5] = ["cube", "ellipsoid", "bone", "sphere", "grid"];

const NOISE: f64 = 0.002;

/// The cloud of a kind, `KINDS` lists them; `grid` has at most `n` points.
pub fn cloud(kind: &str, n: usize) -> Vec<DVec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(20);
    let rng = &mut rng;
    let make: fn(&mut ChaCha8Rng) -> DVec3 = match kind {
        "cube" => |rng| vector(rng) * 0.5 + 0.5,
        "ellipsoid" => |rng| unit(rng) * DVec3::new(1.5, 1.0, 0.7) + noise(rng),
        "bone" => |rng| bone(rng) + noise(rng),
        "sphere" => |rng| unit(rng),
        "grid" => return grid(n),
        _ => panic!("unknown kind of cloud: {kind}"),
    };
    (0..n).map(|_| make(rng)).collect()
}

fn grid(n: usize) -> Vec<DVec3> {
    let side = (n as f64).cbrt() as usize;
    let at = |i: usize| {
        DVec3::new(
            (i % side) as f64,
            (i / side % side) as f64,
            (i / side / side) as f64,
        )
    };
    // Scattered, as a file could be: multiplication by a number coprime to the size.
    let count = side.pow(3);
    (0..count).map(|i| at(i * 1_000_003 % count)).collect()
}

fn vector(rng: &mut impl Rng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

fn unit(rng: &mut impl Rng) -> DVec3 {
    loop {
        let p = vector(rng);
        if (1e-4..1.0).contains(&p.length_squared()) {
            return p.normalize();
        }
    }
}

/// Sum of three uniform numbers: variance 1 after scaling, near enough to normal.
fn noise(rng: &mut impl Rng) -> DVec3 {
    NOISE * (vector(rng) + vector(rng) + vector(rng))
}

/// A shaft with two heads of different shape, bent a little; sampled by area through rejection.
fn bone(rng: &mut impl Rng) -> DVec3 {
    loop {
        let z: f64 = rng.random_range(-1.0..1.0);
        let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
        let cap = (1.0 - z.powi(16)).sqrt();
        let head = if z > 0.0 {
            z.powi(4) * (1.0 + 0.35 * (2.0 * angle).cos())
        } else {
            z.powi(4) * (1.0 + 0.2 * angle.sin())
        };
        let r = (0.12 + 0.25 * head) * cap;
        if rng.random_range(0.0..0.5) < r + 0.05 {
            return DVec3::new(r * angle.cos() + 0.08 * z * z, r * angle.sin(), z);
        }
    }
}
