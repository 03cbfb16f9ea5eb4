//! Floating-point expansions: exact sums and products of `f64`.
//!
//! An expansion is an exact number written as a sum of non-overlapping `f64` in order of increasing magnitude, zeros left
//! out (Shewchuk 1997, "Adaptive precision floating-point arithmetic and fast robust geometric predicates", sections
//! 2.2-2.5). The predicates here reach for it only when a filter could not decide, so clarity goes before speed.
//! Exact as long as nothing over- or underflows; [`crate::delaunay::door`] normalises coordinates so that nothing does.

/// `a + b` as an expansion of two terms: rounded sum and its error.
#[inline]
pub(crate) fn two_sum(a: f64, b: f64) -> [f64; 2] {
    let x = a + b;
    let bv = x - a;
    let av = x - bv;
    [(a - av) + (b - bv), x]
}

/// `a + b` for `|a| >= |b|` (or `a == 0`).
#[inline]
fn fast_two_sum(a: f64, b: f64) -> [f64; 2] {
    let x = a + b;
    [b - (x - a), x]
}

/// High and low halves of the significand of `a` (Dekker), 26 bits each.
#[inline]
fn split(a: f64) -> [f64; 2] {
    /// `2^27 + 1`.
    const SPLITTER: f64 = 134_217_729.0;
    let c = SPLITTER * a;
    let hi = c - (c - a);
    [a - hi, hi]
}

/// `a * b` as an expansion of two terms: error and rounded product.
#[inline]
pub(crate) fn two_product(a: f64, b: f64) -> [f64; 2] {
    let x = a * b;
    let [alo, ahi] = split(a);
    let [blo, bhi] = split(b);
    let e = x - ahi * bhi - alo * bhi - ahi * blo;
    [alo * blo - e, x]
}

/// An exact number; the empty expansion is zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Expansion(Vec<f64>);

impl Expansion {
    /// The exact difference `a - b`.
    pub(crate) fn difference(a: f64, b: f64) -> Self {
        Self::of(two_sum(a, -b))
    }

    fn of(terms: [f64; 2]) -> Self {
        Self(terms.into_iter().filter(|&t| t != 0.0).collect())
    }

    /// -1, 0 or 1.
    pub(crate) fn sign(&self) -> f64 {
        self.0.last().map_or(0.0, |t| t.signum())
    }

    /// The nearest `f64`, within a unit in the last place.
    pub(crate) fn approximate(&self) -> f64 {
        self.0.iter().sum()
    }

    pub(crate) fn neg(mut self) -> Self {
        self.0.iter_mut().for_each(|t| *t = -*t);
        self
    }

    /// Exact sum (Shewchuk's fast expansion sum with zero elimination).
    pub(crate) fn add(&self, other: &Self) -> Self {
        let (e, f) = (&self.0, &other.0);
        let mut merged = Vec::with_capacity(e.len() + f.len());
        let (mut i, mut j) = (0, 0);
        while i < e.len() || j < f.len() {
            if j == f.len() || (i < e.len() && e[i].abs() <= f[j].abs()) {
                merged.push(e[i]);
                i += 1;
            } else {
                merged.push(f[j]);
                j += 1;
            }
        }
        let mut out = Vec::with_capacity(merged.len());
        let mut terms = merged.into_iter();
        let Some(mut q) = terms.next() else {
            return Self(out);
        };
        for t in terms {
            let [err, sum] = two_sum(q, t);
            if err != 0.0 {
                out.push(err);
            }
            q = sum;
        }
        if q != 0.0 {
            out.push(q);
        }
        Self(out)
    }

    /// Exact difference.
    pub(crate) fn sub(&self, other: &Self) -> Self {
        self.add(&other.clone().neg())
    }

    /// Exact product with one `f64` (Shewchuk's scale expansion with zero elimination).
    fn scale(&self, b: f64) -> Self {
        let mut out = Vec::with_capacity(2 * self.0.len());
        let mut terms = self.0.iter();
        let Some(&first) = terms.next() else {
            return Self(out);
        };
        let mut push = |t: f64| {
            if t != 0.0 {
                out.push(t);
            }
        };
        let [err, mut q] = two_product(first, b);
        push(err);
        for &t in terms {
            let [lo, hi] = two_product(t, b);
            let [err, sum] = two_sum(q, lo);
            push(err);
            let [err, sum] = fast_two_sum(hi, sum);
            push(err);
            q = sum;
        }
        push(q);
        Self(out)
    }

    /// Exact product.
    pub(crate) fn mul(&self, other: &Self) -> Self {
        let (short, long) = if self.0.len() < other.0.len() {
            (self, other)
        } else {
            (other, self)
        };
        let mut sums: Vec<Self> = short.0.iter().map(|&b| long.scale(b)).collect();
        while sums.len() > 1 {
            sums = sums
                .chunks(2)
                .map(|c| if let [a, b] = c { a.add(b) } else { c[0].clone() })
                .collect();
        }
        sums.pop().unwrap_or_default()
    }
}

/// A vector of three expansions.
#[derive(Clone, Debug)]
pub(crate) struct Vector(pub(crate) [Expansion; 3]);

impl Vector {
    /// The exact difference `a - b` of two points.
    pub(crate) fn difference(a: glam::DVec3, b: glam::DVec3) -> Self {
        Self([
            Expansion::difference(a.x, b.x),
            Expansion::difference(a.y, b.y),
            Expansion::difference(a.z, b.z),
        ])
    }

    pub(crate) fn dot(&self, other: &Self) -> Expansion {
        let [a, b, c] = &self.0;
        let [d, e, f] = &other.0;
        a.mul(d).add(&b.mul(e)).add(&c.mul(f))
    }

    pub(crate) fn cross(&self, other: &Self) -> Self {
        let [a, b, c] = &self.0;
        let [d, e, f] = &other.0;
        Self([
            b.mul(f).sub(&c.mul(e)),
            c.mul(d).sub(&a.mul(f)),
            a.mul(e).sub(&b.mul(d)),
        ])
    }

    pub(crate) fn scale(&self, s: &Expansion) -> Self {
        Self([self.0[0].mul(s), self.0[1].mul(s), self.0[2].mul(s)])
    }

    pub(crate) fn add(&self, other: &Self) -> Self {
        Self([
            self.0[0].add(&other.0[0]),
            self.0[1].add(&other.0[1]),
            self.0[2].add(&other.0[2]),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An expansion of integers small enough that `i128` holds every result.
    fn from_int(v: i128) -> Expansion {
        let hi = v >> 40 << 40;
        Expansion::of(two_sum(hi as f64, (v - hi) as f64))
    }

    fn to_int(e: &Expansion) -> i128 {
        e.0.iter().map(|&t| t as i128).sum()
    }

    #[test]
    fn sums_and_products_agree_with_integers() {
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 4) as i64 as i128 - (1 << 58)
        };
        for _ in 0..2000 {
            let (a, b) = (next(), next());
            let (x, y) = (from_int(a), from_int(b));
            assert_eq!(to_int(&x.add(&y)), a + b);
            assert_eq!(to_int(&x.sub(&y)), a - b);
            assert_eq!(to_int(&x.mul(&y)), a * b);
            assert_eq!(x.sub(&y).sign(), ((a - b).signum()) as f64);
        }
        assert_eq!(from_int(5).sub(&from_int(5)).sign(), 0.0);
    }
}
