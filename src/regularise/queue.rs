//! A queue of ids by ascending length, ties by id, so that every order is total.

use ordered_float::OrderedFloat;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

#[derive(Clone, Debug, Default)]
pub(crate) struct Queue {
    heap: BinaryHeap<Reverse<(OrderedFloat<f64>, u32)>>,
}

impl Queue {
    pub fn new() -> Self {
        Self::default()
    }

    pub fn push(&mut self, key: f64, id: u32) {
        self.heap.push(Reverse((OrderedFloat(key), id)));
    }

    pub fn pop(&mut self) -> Option<(f64, u32)> {
        self.heap.pop().map(|Reverse((key, id))| (key.0, id))
    }
}
