//! Four tetrahedra at a time: plain arithmetic on four numbers, which compilers turn into vector instructions.
//!
//! Every operation rounds as the one on single numbers does and none is fused, so results are the same bits on every
//! processor and beside the code for one tetrahedron.

use glam::DVec3;
use std::ops::{Add, Mul, Sub};

/// Four numbers.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Four(pub [f64; 4]);

impl Four {
    /// The same number four times.
    #[inline(always)]
    pub(super) fn all(v: f64) -> Self {
        Self([v; 4])
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let (a, b) = (self.0, other.0);
        Self([f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])])
    }

    #[inline(always)]
    pub(super) fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let [a, b, c, d] = self.0;
        Self([f(a), f(b), f(c), f(d)])
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        self.map(f64::abs)
    }

    /// The smaller of each two; no care is taken of NaN.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    pub(super) fn over(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }

    /// Bit `k` when number `k` is larger than the other's.
    #[inline(always)]
    pub(super) fn larger(self, other: Self) -> u8 {
        let (a, b) = (self.0, other.0);
        (0..4).fold(0, |bits, k| bits | u8::from(a[k] > b[k]) << k)
    }
}

impl Add for Four {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Four {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Four {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

/// Four vectors, with the operations of [`DVec3`] in the same order.
#[derive(Clone, Copy, Debug)]
pub(super) struct FourVectors {
    pub x: Four,
    pub y: Four,
    pub z: Four,
}

impl FourVectors {
    #[inline(always)]
    pub(super) fn new([a, b, c, d]: [DVec3; 4]) -> Self {
        Self {
            x: Four([a.x, b.x, c.x, d.x]),
            y: Four([a.y, b.y, c.y, d.y]),
            z: Four([a.z, b.z, c.z, d.z]),
        }
    }

    #[inline(always)]
    pub(super) fn dot(self, o: Self) -> Four {
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
    pub(super) fn scale(self, s: Four) -> Self {
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

    /// Vector `k`.
    #[inline(always)]
    pub(super) fn get(&self, k: usize) -> DVec3 {
        DVec3::new(self.x.0[k], self.y.0[k], self.z.0[k])
    }
}
