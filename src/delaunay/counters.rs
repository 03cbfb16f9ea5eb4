//! Counters that many threads advance: the first half of a counting sort, and the places of the second.
//!
//! In: how many. Out: counts, then beginnings of buckets. With one thread an advance is a load and a store, which atomic
//! read-modify-write instructions cost several times.

use super::canonical::zeros;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Counters, all zero at first.
pub(crate) struct Counters {
    counts: Vec<AtomicU32>,
    alone: bool,
}

impl Counters {
    /// `len` counters, advanced by the threads of the current rayon pool only.
    pub(crate) fn new(len: usize) -> Self {
        Self {
            counts: zeros::<u32>(len).into_iter().map(AtomicU32::new).collect(),
            alone: rayon::current_num_threads() == 1,
        }
    }

    /// Adds to a counter and returns what it was.
    #[inline(always)]
    pub(crate) fn add(&self, counter: usize, more: u32) -> u32 {
        let count = &self.counts[counter];
        if self.alone {
            let old = count.load(Relaxed);
            count.store(old + more, Relaxed);
            old
        } else {
            count.fetch_add(more, Relaxed)
        }
    }

    /// Makes counts into beginnings: each becomes the sum of those before it; returns the sum of all.
    pub(crate) fn accumulate(&mut self) -> u32 {
        let mut sum = 0;
        for count in &mut self.counts {
            let count = count.get_mut();
            (*count, sum) = (sum, sum + *count);
        }
        sum
    }

    /// The values.
    pub(crate) fn into_inner(self) -> Vec<u32> {
        self.counts.into_iter().map(AtomicU32::into_inner).collect()
    }
}
