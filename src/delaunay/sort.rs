//! Sorting numbers by their bits, with all threads.
//!
//! In: whole numbers. Out: the same in order of their upper bits, equal ones in the order they came in. Least significant digit
//! first; every thread counts the digits of its part of the numbers, and moves them to the places that follow from all
//! counts. The words are atomic because places of different parts mix; on common processors their stores are plain ones.

use super::canonical::zeros;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Bits sorted at a time: the places of all digits stay in the fastest memory.
pub(super) const DIGIT: u32 = 11;

/// Numbers that are worth a thread.
const PART: usize = 1 << 14;

/// Sorts numbers by their bits from `low` up; equal ones keep their order.
pub(super) fn radix_sort(keys: &mut Vec<u64>, low: u32) {
    let all_bits = keys
        .par_iter()
        .with_min_len(PART)
        .copied()
        .reduce(|| 0, |a, b| a | b);
    let significant = u64::BITS - all_bits.leading_zeros();
    let part = keys.len().div_ceil(rayon::current_num_threads()).max(PART);
    let mut from = atomic(std::mem::take(keys));
    let mut to = atomic(zeros(from.len()));
    for shift in (low..significant).step_by(DIGIT as usize) {
        let digit = |k: &AtomicU64| (k.load(Relaxed) >> shift) as usize & ((1 << DIGIT) - 1);
        let count = |keys: &[AtomicU64]| {
            let mut counts = [0u32; 1 << DIGIT];
            for k in keys {
                counts[digit(k)] += 1;
            }
            counts
        };
        let mut places: Vec<[u32; 1 << DIGIT]> = from.par_chunks(part).map(count).collect();
        let mut sum = 0;
        for d in 0..1 << DIGIT {
            for part in &mut places {
                (part[d], sum) = (sum, sum + part[d]);
            }
        }
        from.par_chunks(part).zip(&mut places).for_each(|(keys, places)| {
            for k in keys {
                let place = &mut places[digit(k)];
                to[*place as usize].store(k.load(Relaxed), Relaxed);
                *place += 1;
            }
        });
        std::mem::swap(&mut from, &mut to);
    }
    *keys = from.into_iter().map(AtomicU64::into_inner).collect();
}

/// The same words, in the same place.
fn atomic(keys: Vec<u64>) -> Vec<AtomicU64> {
    keys.into_iter().map(AtomicU64::new).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_numbers_keep_their_order() {
        let mut state = 1u64;
        let keys: Vec<u64> = (0..100_000)
            .map(|i| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1);
                (state >> 50) << 20 | i
            })
            .collect();
        let mut expected = keys.clone();
        expected.sort_by_key(|k| k >> 20);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let mut sorted = keys.clone();
            pool.expect("threads").install(|| radix_sort(&mut sorted, 20));
            assert_eq!(sorted, expected);
        }
    }
}
