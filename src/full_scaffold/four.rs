//! Four tetrahedra at a time: plain arithmetic on four numbers, by vector instructions where the processor has them.
//!
//! Every operation rounds as the one on single numbers does and none is fused, so results are the same bits on every
//! processor and beside the code for one tetrahedron.

use crate::delaunay::lanes::Lanes;
use glam::DVec3;
use std::ops::{Add, Div, Mul, Sub};

/// Four numbers.
#[derive(Clone, Copy)]
pub(super) struct Four<L: Lanes>(L, L::Four);

impl<L: Lanes> Four<L> {
    #[inline(always)]
    pub(super) fn new(lanes: L, v: [f64; 4]) -> Self {
        Self(lanes, lanes.four(v))
    }

    /// The same number four times.
    #[inline(always)]
    pub(super) fn all(lanes: L, v: f64) -> Self {
        Self::new(lanes, [v; 4])
    }

    #[inline(always)]
    pub(super) fn array(self) -> [f64; 4] {
        self.0.array(self.1)
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt(self.1))
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        Self(self.0, self.0.abs(self.1))
    }

    /// The smaller of each two; no care is taken of NaN.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min(self.1, other.1))
    }

    /// Bit `k` when number `k` is larger than the other's.
    #[inline(always)]
    pub(super) fn larger(self, other: Self) -> u8 {
        self.0.larger(self.1, other.1)
    }
}

impl<L: Lanes> Add for Four<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0, self.0.add(self.1, other.1))
    }
}

impl<L: Lanes> Sub for Four<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0, self.0.sub(self.1, other.1))
    }
}

impl<L: Lanes> Mul for Four<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0, self.0.mul(self.1, other.1))
    }
}

impl<L: Lanes> Div for Four<L> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0, self.0.div(self.1, other.1))
    }
}

/// Four vectors, with the operations of [`DVec3`] in the same order.
#[derive(Clone, Copy)]
pub(super) struct FourVectors<L: Lanes> {
    pub x: Four<L>,
    pub y: Four<L>,
    pub z: Four<L>,
}

impl<L: Lanes> FourVectors<L> {
    #[inline(always)]
    pub(super) fn new(lanes: L, [a, b, c, d]: [DVec3; 4]) -> Self {
        Self {
            x: Four::new(lanes, [a.x, b.x, c.x, d.x]),
            y: Four::new(lanes, [a.y, b.y, c.y, d.y]),
            z: Four::new(lanes, [a.z, b.z, c.z, d.z]),
        }
    }

    #[inline(always)]
    pub(super) fn dot(self, o: Self) -> Four<L> {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    #[inline(always)]
    pub(super) fn cross(self, o: Self) -> Self {
        Self {
            x: self.y * o.z - o.y * self.z,
            y: self.z * o.x - o.z * self.x,
            z: self.x * o.y - o.x * self.y,
        }
    }

    #[inline(always)]
    pub(super) fn scale(self, s: Four<L>) -> Self {
        Self {
            x: self.x * s,
            y: self.y * s,
            z: self.z * s,
        }
    }

    #[inline(always)]
    pub(super) fn add(self, o: Self) -> Self {
        Self {
            x: self.x + o.x,
            y: self.y + o.y,
            z: self.z + o.z,
        }
    }

    #[inline(always)]
    pub(super) fn sub(self, o: Self) -> Self {
        Self {
            x: self.x - o.x,
            y: self.y - o.y,
            z: self.z - o.z,
        }
    }
}
