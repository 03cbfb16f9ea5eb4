//! Any bytes as a cloud: several threads give the triangulation that one thread gives.
//!
//! The bytes choose a lattice, a spread and a seed; clouds are large enough for threads to meet. Run with
//! `RUSTC_BOOTSTRAP=1 cargo fuzz run delaunay_parallel -- -max_len=16 -max_total_time=1800`.
#![no_main]

use glam::DVec3;
use libfuzzer_sys::fuzz_target;
use medial_scaffold::delaunay::{DelaunaySettings, delaunay};

fuzz_target!(|data: &[u8]| {
    let byte = |i: usize| data.get(i).copied().unwrap_or(0);
    let mut state = data
        .iter()
        .fold(0x9e37_79b9_7f4a_7c15u64, |s, &b| (s ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as f64 / f64::from(1u32 << 31)
    };
    // Few cells make cospherical points, many a general cloud; some clouds are flat or lie on a sphere.
    let cells = f64::from(1u32 << (4 + byte(0) % 20));
    let flat = [1.0, 0.1, 1e-3, 1e-9][byte(1) as usize % 4];
    let points: Vec<DVec3> = (0..17_000 + 16 * usize::from(byte(2)))
        .map(|_| {
            let p = DVec3::new(next(), next(), next()) - 0.5;
            let p = if byte(3) & 1 == 1 { p.normalize_or_zero() } else { p };
            (p * DVec3::new(1.0, 1.0, flat) * cells).round() / cells
        })
        .collect();
    let one = delaunay(&points, &DelaunaySettings { threads: 1 }).expect("finite points of one magnitude");
    let threads = 2 + usize::from(byte(4) % 6);
    let many = delaunay(&points, &DelaunaySettings { threads }).expect("the same points");
    assert!(one == many, "{threads} threads");
});
