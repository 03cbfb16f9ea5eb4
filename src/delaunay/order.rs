//! Insertion order: biased randomised rounds, each along a Hilbert curve.
//!
//! In: points. Out: their indices in the order of insertion. Steps: (1) every point draws a round, the last with probability
//! 7/8, the one before with 7/64 and so on (Amenta, Choi & Rote 2003, "Incremental constructions con BRIO"), so that each
//! round is a thin random sample of the next and the expected cost stays that of a random order; (2) within a round points
//! follow a Hilbert curve (Skilling 2004, "Programming the Hilbert curve"), so that the walk from one to the next is short
//! and the memory it touches is warm. The triangulation does not depend on the order; only the time does.

use glam::DVec3;
use rayon::prelude::*;

/// Bits of the number of a round: eight to the power 15 points are more than there are.
const ROUND_BITS: u32 = 4;

/// Rounds end when one would hold fewer points than this.
const SMALLEST_ROUND: usize = 64;

/// Indices of the points in insertion order and where each round ends.
#[derive(Clone, Debug)]
pub(super) struct InsertionOrder {
    /// Indices of the points.
    pub indices: Vec<u32>,
    /// Position of each on the curve, a whole number below `2^60`.
    pub positions: Vec<f64>,
    /// End of each round in `indices`.
    pub ends: Vec<u32>,
}

/// The order in which points are inserted.
pub(super) fn insertion_order(points: &[DVec3], bounds: [DVec3; 2]) -> InsertionOrder {
    let [lo, hi] = bounds;
    // One word a point, sorted as a number: round, position on the curve, index. A million points leave 13 bits a coordinate.
    let index_bits = usize::BITS - points.len().leading_zeros();
    let bits = ((64 - ROUND_BITS - index_bits) / 3).min(20);
    let extent = (hi - lo).max_element();
    let factor = if extent > 0.0 {
        ((1u32 << bits) - 1) as f64 / extent
    } else {
        0.0
    };
    let rounds = rounds(points.len());
    let key = |(&p, i): (&DVec3, u32)| {
        let cell = ((p - lo) * factor).to_array().map(|v| v as u32);
        let position = u64::from(round(i, rounds)) << (3 * bits) | hilbert(cell, bits);
        position << index_bits | u64::from(i)
    };
    let mut keys: Vec<u64> = points.par_iter().zip(0..points.len() as u32).map(key).collect();
    keys.par_sort_unstable();
    let round_of = |k: u64| (k >> (3 * bits + index_bits)) as u32;
    let ends = (0..rounds)
        .map(|r| keys.partition_point(|&k| round_of(k) <= r) as u32)
        .collect();
    let indices = keys
        .iter()
        .map(|k| (k & ((1 << index_bits) - 1)) as u32)
        .collect();
    let positions = keys
        .iter()
        .map(|k| (k >> index_bits & ((1 << (3 * bits)) - 1)) as f64)
        .collect();
    InsertionOrder {
        indices,
        positions,
        ends,
    }
}

/// Number of rounds for `n` points.
fn rounds(n: usize) -> u32 {
    let mut rounds = 1;
    let mut left = n / 8;
    while left >= SMALLEST_ROUND {
        rounds += 1;
        left /= 8;
    }
    rounds
}

/// The round a point draws: the last for 7 of 8.
fn round(index: u32, rounds: u32) -> u32 {
    let zeros = mix(u64::from(index)).trailing_zeros() / 3;
    rounds - 1 - zeros.min(rounds - 1)
}

/// A fixed scrambling of an index (the finaliser of SplitMix64, Steele, Lea & Flood 2014).
fn mix(index: u64) -> u64 {
    let mut z = index.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Position of a cell along the Hilbert curve.
fn hilbert(cell: [u32; 3], bits: u32) -> u64 {
    let mut x = cell;
    let mut q = 1u32 << (bits - 1);
    while q > 1 {
        let p = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= p;
            } else {
                let t = (x[0] ^ x[i]) & p;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    let mut q = 1u32 << (bits - 1);
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    x.iter()
        .zip([2, 1, 0])
        .fold(0, |key, (&v, shift)| key | spread(v ^ t) << shift)
}

/// Moves bit `i` to bit `3 i`, for 21 bits.
fn spread(v: u32) -> u64 {
    let mut v = u64::from(v) & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_neighbouring_cells() {
        // The 512 cells of an 8 x 8 x 8 block at the origin are an unbroken stretch of the curve.
        let mut cells: Vec<(u64, [u32; 3])> = (0..512u32)
            .map(|i| [i & 7, i >> 3 & 7, i >> 6])
            .map(|c| (hilbert(c, 13), c))
            .collect();
        cells.sort_unstable();
        for w in cells.windows(2) {
            let step: u32 = (0..3).map(|i| w[0].1[i].abs_diff(w[1].1[i])).sum();
            assert_eq!((w[1].0 - w[0].0, step), (1, 1));
        }
    }

    #[test]
    fn every_point_comes_once() {
        let points: Vec<DVec3> = (0..3000u32)
            .map(|i| DVec3::new(f64::from(i % 13), f64::from(i % 17), f64::from(i)))
            .collect();
        let InsertionOrder {
            indices: mut order,
            ends,
            ..
        } = insertion_order(&points, [DVec3::ZERO, DVec3::splat(3000.0)]);
        assert!(ends.len() == 2 && ends[1] == 3000);
        order.sort_unstable();
        assert!(order.into_iter().eq(0..3000));
    }
}
