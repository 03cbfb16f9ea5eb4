//! Any bytes as points: the triangulation passes the validator, does not depend on order, and its scaffold is sound.
//!
//! The first byte chooses how the rest is read: lattices of several sizes and scales, three bytes a point; `f64` bit by bit; or
//! lattice points moved by a few units in the last place. Run with
//! `RUSTC_BOOTSTRAP=1 cargo fuzz run delaunay -- -max_len=400 -max_total_time=1800`.
#![no_main]

#[path = "../../tests/support/exact.rs"]
mod exact;
#[path = "../../tests/support/validate.rs"]
mod validate;

use glam::DVec3;
use libfuzzer_sys::fuzz_target;
use medial_scaffold::delaunay::{DelaunaySettings, delaunay};
use medial_scaffold::full_scaffold::full_scaffold;

/// Exact validation is slow, and so are long inputs.
const MOST_POINTS: usize = 40;

fuzz_target!(|data: &[u8]| {
    let Some((&kind, bytes)) = data.split_first() else {
        return;
    };
    let points = read(kind, bytes);
    let Ok(t) = delaunay(&points, &DelaunaySettings { threads: 1 }) else {
        return;
    };
    if let Err(message) = validate::check(&t, &points) {
        panic!("{message}");
    }
    let reversed: Vec<DVec3> = points.iter().rev().copied().collect();
    assert!(delaunay(&reversed, &DelaunaySettings { threads: 1 }).is_ok_and(|r| r == t));
    let scaffold = full_scaffold(&t).expect("the triangulation was made of points in range");
    assert_eq!(scaffold.counts.morse, i64::from(!points.is_empty()));
    assert_eq!(scaffold.acyclic_order(&t).len(), t.num_finite());
});

fn read(kind: u8, bytes: &[u8]) -> Vec<DVec3> {
    let lattice = |p: &[u8], cells: u8| {
        DVec3::new(
            (p[0] % cells).into(),
            (p[1] % cells).into(),
            (p[2] % cells).into(),
        )
    };
    let cells = 2 + (kind >> 2) % 16;
    match kind & 3 {
        0 => bytes
            .chunks_exact(3)
            .take(MOST_POINTS)
            .map(|p| lattice(p, cells))
            .collect(),
        1 => bytes
            .chunks_exact(3)
            .take(MOST_POINTS)
            .map(|p| lattice(p, cells) * 0.1 - 0.3)
            .collect(),
        2 => bytes
            .chunks_exact(24)
            .take(MOST_POINTS)
            .map(|p| {
                let at = |i: usize| f64::from_le_bytes(std::array::from_fn(|k| p[8 * i + k]));
                DVec3::new(at(0), at(1), at(2))
            })
            .collect(),
        _ => bytes
            .chunks_exact(4)
            .take(MOST_POINTS)
            .map(|p| {
                let q = lattice(p, cells) + 1.0;
                let nudge = |v: f64, k: u8| f64::from_bits(v.to_bits() + u64::from(k & 3));
                DVec3::new(nudge(q.x, p[3]), nudge(q.y, p[3] >> 2), nudge(q.z, p[3] >> 4))
            })
            .collect(),
    }
}
