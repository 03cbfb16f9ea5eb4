//! The door: checks the points, puts them into lexicographic order and merges equal ones.
//!
//! In: points as they come. Out: [`Generators`]: distinct points in order, how often each came, and where every input
//! point went; and a [`Frame`], the power of two that brings coordinates to a magnitude at which no predicate can over- or
//! underflow. Steps: (1) finite check, (2) `-0.0` becomes `0.0`, (3) sort by (x, y, z), (4) merge equal points, (5) check
//! that the range of exponents can be handled exactly. Cost: `O(n log n)`, `O(n)` when the points come sorted.

use super::canonical::room;
use super::sort::{DIGIT, radix_sort};
use crate::geometry::predicates::lexicographic;
use glam::DVec3;
use rayon::prelude::*;
use thiserror::Error;

/// Distinct points in lexicographic order with the way back to the input.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Generators {
    /// Distinct points, mm, sorted by (x, y, z); no negative zeros.
    pub points: Vec<DVec3>,
    /// For each input point, the index of its generator.
    pub source: Vec<u32>,
    /// For each generator, the number of input points merged into it, at least 1.
    pub multiplicity: Vec<u32>,
}

/// Why points were refused.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum DelaunayError {
    /// A coordinate is NaN or infinite.
    #[error("point {index} has the coordinate {value}; remove it or repair the file")]
    NotFinite {
        /// Index of the point in the input.
        index: usize,
        /// The coordinate.
        value: f64,
    },
    /// Coordinates differ so much in magnitude that their products leave the range of `f64`.
    #[error(
        "point {index} has the coordinate {value:e} beside one of size {largest:e}; exact tests span 2^338 (about 1e101) \
         from the largest coordinate to the last bit of the smallest: round such coordinates to 0"
    )]
    Range {
        /// Index of the point in the input.
        index: usize,
        /// The coordinate.
        value: f64,
        /// The largest magnitude of a coordinate.
        largest: f64,
    },
    /// More points than ids.
    #[error("{count} points; the limit is {limit}: thin the cloud or split it")]
    TooMany {
        /// Number of points.
        count: usize,
        /// Largest number that is accepted.
        limit: usize,
    },
}

/// Tetrahedra are packed as `4 * id + facet` in 32 bits, and there can be about seven a point.
pub const MAX_POINTS: usize = (u32::MAX / 4 / 8) as usize;

/// The largest coordinate is brought below `2^TOP`: the sixth power of a difference then stays below `2^1020`.
const TOP: i32 = 160;
/// Every coordinate is then a multiple of `2^BOTTOM`: the sixth power stays above `2^-1074`, the last bit of `f64`.
const BOTTOM: i32 = -178;

/// The power of two between the points as given and the points the predicates see. Multiplying by it is exact, so order,
/// orientation and empty spheres are unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// `normalised = given * 2^exponent`.
    pub exponent: i32,
}

impl Frame {
    /// The frame of finite points, or the error that says which of them spans too wide a range. Clouds of ordinary
    /// magnitude (coordinates and their last bits between `2^BOTTOM` and `2^TOP`) are left as they are.
    pub fn of(points: &[DVec3]) -> Result<Self, DelaunayError> {
        if points.par_iter().all(|p| is_ordinary(*p)) {
            return Ok(Self { exponent: 0 });
        }
        let [lo, hi] = exponents(points);
        if hi < lo || (lo >= BOTTOM && hi <= TOP) {
            return Ok(Self { exponent: 0 });
        }
        let frame = Self { exponent: TOP - hi };
        if lo + frame.exponent >= BOTTOM {
            return Ok(frame);
        }
        let magnitudes = points.iter().flat_map(|p| p.abs().to_array());
        let largest = magnitudes.fold(0.0, f64::max);
        let coordinates = points
            .iter()
            .enumerate()
            .flat_map(|(i, p)| p.to_array().map(|v| (i, v)));
        let (index, value) = coordinates
            .filter(|&(_, v)| v != 0.0)
            .min_by_key(|&(_, v)| last_bit(v))
            .expect("a cloud with a range of exponents has a coordinate that is not zero");
        Err(DelaunayError::Range {
            index,
            value,
            largest,
        })
    }

    /// A point in the frame, exactly.
    #[inline]
    pub fn apply(self, p: DVec3) -> DVec3 {
        if self.exponent == 0 {
            p
        } else {
            scale(p, self.exponent)
        }
    }

    /// A length or coordinate of the frame back in the units of the input; rounds only when it leaves the normal range.
    #[inline]
    pub fn restore(self, v: f64) -> f64 {
        if self.exponent == 0 {
            v
        } else {
            scale(DVec3::splat(v), -self.exponent).x
        }
    }
}

/// Whether the coordinates of a point are finite and need no frame, whatever their last bits.
#[inline(always)]
fn is_ordinary(p: DVec3) -> bool {
    const SMALLEST: f64 = power(BOTTOM + 52);
    const LARGEST: f64 = power(TOP);
    let ordinary = |v: f64| (v == 0.0) | ((v.abs() >= SMALLEST) & (v.abs() < LARGEST));
    ordinary(p.x) & ordinary(p.y) & ordinary(p.z)
}

/// `2^e` for a normal number.
const fn power(e: i32) -> f64 {
    f64::from_bits(((e + 1023) as u64) << 52)
}

/// `p * 2^e`, in two steps so that the factors stay in range.
fn scale(p: DVec3, e: i32) -> DVec3 {
    let half = e / 2;
    // |e| <= 1074 + TOP, so both halves are normal numbers.
    p * power(half) * power(e - half)
}

/// Smallest exponent of a last set bit and exponent above the largest magnitude; `lo > hi` when all is zero.
fn exponents(points: &[DVec3]) -> [i32; 2] {
    let mut lo = i32::MAX;
    let mut hi = i32::MIN;
    for v in points.iter().flat_map(|p| p.to_array()).filter(|&v| v != 0.0) {
        lo = lo.min(last_bit(v));
        hi = hi.max(top_bit(v));
    }
    [lo, hi]
}

/// Significand as an integer and its exponent: `|v| = m * 2^e`.
fn decompose(v: f64) -> (u64, i32) {
    let bits = v.to_bits();
    let e = ((bits >> 52) & 0x7ff) as i32;
    let m = bits & ((1 << 52) - 1);
    if e == 0 {
        (m, -1074)
    } else {
        (m | 1 << 52, e - 1075)
    }
}

/// Exponent of the last set bit of a non-zero number.
fn last_bit(v: f64) -> i32 {
    let (m, e) = decompose(v);
    e + m.trailing_zeros() as i32
}

/// Smallest `k` with `|v| < 2^k`.
fn top_bit(v: f64) -> i32 {
    let (m, e) = decompose(v);
    e + 64 - m.leading_zeros() as i32
}

/// Checks, sorts and merges points; see the module.
///
/// # Errors
/// [`DelaunayError`] names the first point that cannot be used.
///
/// ```
/// # use glam::DVec3;
/// # use medial_scaffold::delaunay::door::prepare;
/// let g = prepare(&[DVec3::X, DVec3::ZERO, DVec3::X])?;
/// assert_eq!(g.points, [DVec3::ZERO, DVec3::X]);
/// assert_eq!((g.source, g.multiplicity), (vec![1, 0, 1], vec![1, 2]));
/// # Ok::<(), medial_scaffold::delaunay::DelaunayError>(())
/// ```
pub fn prepare(points: &[DVec3]) -> Result<Generators, DelaunayError> {
    check(points)?;
    let mut out = Generators::default();
    if is_sorted(points) {
        out.points = points.iter().map(|&p| p + DVec3::ZERO).collect();
        out.source = (0..points.len() as u32).collect();
        out.multiplicity = vec![1; points.len()];
        return Ok(out);
    }
    out.source = vec![0; points.len()];
    for i in lexicographic_order(points).collect::<Vec<_>>() {
        let p = points[i as usize] + DVec3::ZERO;
        if out.points.last() != Some(&p) {
            out.points.push(p);
            out.multiplicity.push(0);
        }
        let last = out.points.len() - 1;
        out.source[i as usize] = last as u32;
        out.multiplicity[last] += 1;
    }
    Ok(out)
}

/// The distinct points of [`prepare`], without the way back.
pub(super) fn distinct(points: &[DVec3]) -> Result<Vec<DVec3>, DelaunayError> {
    check(points)?;
    if is_sorted(points) {
        return Ok(points.iter().map(|&p| p + DVec3::ZERO).collect());
    }
    // Adding zero turns -0.0 into 0.0 and leaves every other number as it is.
    let mut out: Vec<DVec3> = Vec::with_capacity(points.len());
    out.par_extend(lexicographic_order(points).map(|i| points[i as usize] + DVec3::ZERO));
    if out.par_windows(2).any(|w| w[0] == w[1]) {
        out.dedup();
    }
    Ok(out)
}

/// Indices of finite points in lexicographic order, equal points in order of their indices: by the leading bits of x as whole
/// numbers, then in full where those agree.
fn lexicographic_order(points: &[DVec3]) -> impl IndexedParallelIterator<Item = u32> {
    let index_bits = usize::BITS - points.len().leading_zeros();
    let cells = ((1u64 << (u64::BITS - index_bits)) - 1) as f64 * 0.5;
    let xs = || points.par_iter().with_min_len(1 << 14).map(|p| p.x);
    let lo = xs().reduce(|| f64::INFINITY, f64::min);
    let hi = xs().reduce(|| f64::NEG_INFINITY, f64::max);
    let factor = cells / (hi - lo);
    // Rounding is monotonic. Ranges beyond f64 make all keys equal or extreme, which is correct as well.
    let key = |x: f64| (((x - lo) * factor).min(cells) as u64) << index_bits;
    let mut keys: Vec<u64> = room(points.len());
    keys.par_extend(
        points
            .par_iter()
            .zip(0..points.len() as u32)
            .map(|(p, i)| key(p.x) | u64::from(i)),
    );
    // Three digits tell nearly all points apart; the others are compared anyway.
    let low = index_bits.max(u64::BITS - 3 * DIGIT);
    radix_sort(&mut keys, low);
    let index = move |k: u64| (k & ((1 << index_bits) - 1)) as u32;
    keys.par_chunk_by_mut(|a, b| a >> low == b >> low)
        .filter(|run| run.len() > 1)
        .for_each(|run| {
            run.par_sort_unstable_by(|&a, &b| {
                let [p, q] = [a, b].map(|k| points[index(k) as usize]);
                lexicographic(p, q).then_with(|| index(a).cmp(&index(b)))
            });
        });
    keys.into_par_iter().map(index)
}

/// Strictly increasing, so distinct too.
fn is_sorted(points: &[DVec3]) -> bool {
    points.par_windows(2).all(|w| lexicographic(w[0], w[1]).is_lt())
}

fn check(points: &[DVec3]) -> Result<(), DelaunayError> {
    if points.len() > MAX_POINTS {
        return Err(DelaunayError::TooMany {
            count: points.len(),
            limit: MAX_POINTS,
        });
    }
    if points.par_iter().all(|p| is_ordinary(*p)) {
        return Ok(());
    }
    let bad = |p: &DVec3| p.to_array().into_iter().find(|v| !v.is_finite());
    match points
        .iter()
        .enumerate()
        .find_map(|(i, p)| bad(p).map(|v| (i, v)))
    {
        Some((index, value)) => Err(DelaunayError::NotFinite { index, value }),
        None => Frame::of(points).map(|_| ()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_those_of_the_bits() {
        assert_eq!((last_bit(1.0), top_bit(1.0)), (0, 1));
        assert_eq!((last_bit(-12.0), top_bit(-12.0)), (2, 4));
        assert_eq!(
            (
                last_bit(f64::MIN_POSITIVE / 4.0),
                top_bit(f64::MIN_POSITIVE / 4.0)
            ),
            (-1024, -1023)
        );
        assert_eq!(top_bit(f64::MAX), 1024);
    }

    #[test]
    fn frames_are_exact_and_come_back() {
        for v in [1e-300, 1e200, f64::MAX, f64::MIN_POSITIVE / 1024.0, 3.7e-310] {
            let p = DVec3::new(v, -v / 2.0, 0.0);
            let frame = Frame::of(&[p]).expect("one magnitude");
            let q = frame.apply(p);
            assert!(
                q.x > 2f64.powi(100) && q.x <= 2f64.powi(160),
                "{v:e} -> {:e}",
                q.x
            );
            assert_eq!(frame.restore(q.x), v);
        }
        assert_eq!(
            Frame::of(&[DVec3::new(1.0, 1e-17, 250.0)]).map(|f| f.exponent),
            Ok(0)
        );
    }

    #[test]
    fn too_wide_a_range_is_named() {
        let r = prepare(&[DVec3::X, DVec3::new(0.0, 1e-120, 0.0)]);
        assert!(matches!(r, Err(DelaunayError::Range { index: 1, .. })), "{r:?}");
        let r = prepare(&[DVec3::X, DVec3::new(0.0, f64::NAN, 0.0)]);
        assert!(matches!(r, Err(DelaunayError::NotFinite { index: 1, .. })));
    }

    #[test]
    fn negative_zero_is_zero() {
        let g = prepare(&[DVec3::new(0.0, 1.0, 0.0), DVec3::new(-0.0, 1.0, -0.0)]).expect("finite");
        assert_eq!((g.points.len(), g.multiplicity), (1, vec![2]));
        assert!(g.points[0].x.is_sign_positive());
    }
}
