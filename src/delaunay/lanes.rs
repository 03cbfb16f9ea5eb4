//! The arithmetic of the filters: one tetrahedron against one point, four corners at a time where the processor can; and four
//! numbers at a time for whom they help elsewhere.
//!
//! In: corners and a point as [`Site`]s. Out: the in-sphere determinant with the largest lift. With the corners relative to the point as rows `a, b, c, d` all 2x2 minors of neighbouring rows are one
//! vector operation on a rotated copy, and so are the four 3x3 minors; the determinant is their product with the lifts.
//!
//! Which arithmetic runs is decided once a triangulation ([`Lanes`] is a type parameter of the insertion, and
//! [`with_lanes`] compiles the whole insertion for the wider instructions). Results may differ in the last bits, so only a
//! sign that clears the bounds of `filter` may be used: signs, and with them the triangulation, do not depend on the choice.

use glam::DVec3;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m256d, _CMP_GT_OQ};

/// A point that fills one vector register, so that one load fetches it.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub(crate) struct Site {
    /// x, y, z and the position along the longest side of the box, which only several threads look at.
    pub lanes: [f64; 4],
}

impl Site {
    /// The point, at a position along the longest side of the box.
    pub(crate) fn new(p: DVec3, position: f64) -> Self {
        Self {
            lanes: [p.x, p.y, p.z, position],
        }
    }

    /// The point alone.
    #[inline(always)]
    pub(crate) fn point(&self) -> DVec3 {
        let [x, y, z, _] = self.lanes;
        DVec3::new(x, y, z)
    }

    /// Where the point is along the longest side of the box.
    #[inline(always)]
    pub(crate) fn position(&self) -> f64 {
        self.lanes[3]
    }
}

/// Four corners in order.
pub(crate) type Corners<'a> = [&'a Site; 4];

/// How the arithmetic is done.
pub(crate) trait Lanes: Copy + Send + Sync {
    /// Four numbers. The operations on them round like those on single numbers.
    type Four: Copy;

    /// The in-sphere determinant of the corners relative to `p`, in an order of operations no deeper than Shewchuk's (stage
    /// A), and the largest lift.
    fn insphere(self, corners: Corners, p: &Site) -> (f64, f64);
    /// From an array.
    fn four(self, v: [f64; 4]) -> Self::Four;
    /// To an array.
    fn array(self, v: Self::Four) -> [f64; 4];
    /// Sums.
    fn add(self, a: Self::Four, b: Self::Four) -> Self::Four;
    /// Differences.
    fn sub(self, a: Self::Four, b: Self::Four) -> Self::Four;
    /// Products.
    fn mul(self, a: Self::Four, b: Self::Four) -> Self::Four;
    /// Quotients.
    fn div(self, a: Self::Four, b: Self::Four) -> Self::Four;
    /// Square roots.
    fn sqrt(self, v: Self::Four) -> Self::Four;
    /// Magnitudes.
    fn abs(self, v: Self::Four) -> Self::Four;
    /// The smaller of each two; no care is taken of NaN.
    fn min(self, a: Self::Four, b: Self::Four) -> Self::Four;
    /// Bit `k` when number `k` is larger than the other's.
    fn larger(self, a: Self::Four, b: Self::Four) -> u8;
}

/// One number at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scalar;

impl Lanes for Scalar {
    type Four = [f64; 4];

    #[inline(always)]
    fn insphere(self, corners: Corners, p: &Site) -> (f64, f64) {
        let p = p.point();
        let [a, b, c, d] = corners.map(|q| q.point() - p);
        let ab = a.x * b.y - b.x * a.y;
        let bc = b.x * c.y - c.x * b.y;
        let cd = c.x * d.y - d.x * c.y;
        let da = d.x * a.y - a.x * d.y;
        let ac = a.x * c.y - c.x * a.y;
        let bd = b.x * d.y - d.x * b.y;
        let abc = a.z * bc - b.z * ac + c.z * ab;
        let bcd = b.z * cd - c.z * bd + d.z * bc;
        let cda = c.z * da + d.z * ac + a.z * cd;
        let dab = d.z * ab + a.z * bd + b.z * da;
        let lift = |p: DVec3| p.x * p.x + p.y * p.y + p.z * p.z;
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let (la, lb, lc, ld) = (lift(a), lift(b), lift(c), lift(d));
        let det = (la * bcd - lb * cda) + (lc * dab - ld * abc);
        (det, larger(larger(la, lb), larger(lc, ld)))
    }

    #[inline(always)]
    fn four(self, v: [f64; 4]) -> [f64; 4] {
        v
    }

    #[inline(always)]
    fn array(self, v: [f64; 4]) -> [f64; 4] {
        v
    }

    #[inline(always)]
    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn sqrt(self, v: [f64; 4]) -> [f64; 4] {
        v.map(f64::sqrt)
    }

    #[inline(always)]
    fn abs(self, v: [f64; 4]) -> [f64; 4] {
        v.map(f64::abs)
    }

    #[inline(always)]
    fn min(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn larger(self, a: [f64; 4], b: [f64; 4]) -> u8 {
        (0..4).fold(0, |bits, k| bits | u8::from(a[k] > b[k]) << k)
    }
}

/// One operation on each two numbers.
#[inline(always)]
fn each(a: [f64; 4], b: [f64; 4], f: impl Fn(f64, f64) -> f64) -> [f64; 4] {
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])]
}

/// Something to be compiled for the instructions at hand.
pub(crate) trait Task {
    /// What it returns.
    type Output;
    /// Does it. Implementations are inlined into the code of the processor they run on.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// Runs a task with the widest arithmetic the processor has.
#[cfg(target_arch = "x86_64")]
pub(crate) fn with_lanes<T: Task>(task: T) -> T::Output {
    struct Wide<T>(T, pulp::x86::V3);
    impl<T: Task> pulp::NullaryFnOnce for Wide<T> {
        type Output = T::Output;
        #[inline(always)]
        fn call(self) -> T::Output {
            self.0.run(Avx(self.1))
        }
    }
    match pulp::x86::V3::try_new() {
        Some(v3) => v3.vectorize(Wide(task, v3)),
        None => task.run(Scalar),
    }
}

/// Runs a task with the widest arithmetic the processor has.
#[cfg(not(target_arch = "x86_64"))]
pub(crate) fn with_lanes<T: Task>(task: T) -> T::Output {
    task.run(Scalar)
}

/// Four numbers at a time, with fused products; only made where the processor has them.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx(pulp::x86::V3);

#[cfg(target_arch = "x86_64")]
impl Lanes for Avx {
    type Four = __m256d;

    #[inline(always)]
    fn insphere(self, corners: Corners, p: &Site) -> (f64, f64) {
        let (avx, avx2, fma, sse2) = (self.0.avx, self.0.avx2, self.0.fma, self.0.sse2);
        let load = |q: &Site| -> __m256d { pulp::cast(q.lanes) };
        let p = load(p);
        let [a, b, c, d] = corners.map(|q| avx._mm256_sub_pd(load(q), p));
        // Rows to columns; the fourth column is of no use.
        let (ab, abh) = (avx._mm256_unpacklo_pd(a, b), avx._mm256_unpackhi_pd(a, b));
        let (cd, cdh) = (avx._mm256_unpacklo_pd(c, d), avx._mm256_unpackhi_pd(c, d));
        let x = avx._mm256_permute2f128_pd::<0x20>(ab, cd);
        let y = avx._mm256_permute2f128_pd::<0x20>(abh, cdh);
        let z = avx._mm256_permute2f128_pd::<0x31>(ab, cd);
        let next = |v: __m256d| avx2._mm256_permute4x64_pd::<0b00_11_10_01>(v);
        let after_next = |v: __m256d| avx2._mm256_permute4x64_pd::<0b01_00_11_10>(v);
        let minor = |x1: __m256d, y1: __m256d| fma._mm256_fmsub_pd(x, y1, avx._mm256_mul_pd(x1, y));
        let (z1, z2) = (next(z), after_next(z));
        // ab, bc, cd, da and ac, bd, ca, db.
        let near = minor(next(x), next(y));
        let far = minor(after_next(x), after_next(y));
        // abc, bcd, cda, dab.
        let last = avx._mm256_mul_pd(z2, near);
        let three = fma._mm256_fmadd_pd(z, next(near), fma._mm256_fnmadd_pd(z1, far, last));
        let lift = fma._mm256_fmadd_pd(x, x, fma._mm256_fmadd_pd(y, y, avx._mm256_mul_pd(z, z)));
        let terms = avx._mm256_mul_pd(lift, next(three));
        let halves = |v: __m256d| (avx._mm256_castpd256_pd128(v), avx._mm256_extractf128_pd::<1>(v));
        let (low, high) = halves(terms);
        let sum = sse2._mm_add_pd(low, high);
        let det = sse2._mm_sub_sd(sum, sse2._mm_unpackhi_pd(sum, sum));
        let (low, high) = halves(lift);
        let largest = sse2._mm_max_pd(low, high);
        let largest = sse2._mm_max_sd(largest, sse2._mm_unpackhi_pd(largest, largest));
        (sse2._mm_cvtsd_f64(det), sse2._mm_cvtsd_f64(largest))
    }

    #[inline(always)]
    fn four(self, v: [f64; 4]) -> __m256d {
        pulp::cast(v)
    }

    #[inline(always)]
    fn array(self, v: __m256d) -> [f64; 4] {
        pulp::cast(v)
    }

    #[inline(always)]
    fn add(self, a: __m256d, b: __m256d) -> __m256d {
        self.0.avx._mm256_add_pd(a, b)
    }

    #[inline(always)]
    fn sub(self, a: __m256d, b: __m256d) -> __m256d {
        self.0.avx._mm256_sub_pd(a, b)
    }

    #[inline(always)]
    fn mul(self, a: __m256d, b: __m256d) -> __m256d {
        self.0.avx._mm256_mul_pd(a, b)
    }

    #[inline(always)]
    fn div(self, a: __m256d, b: __m256d) -> __m256d {
        self.0.avx._mm256_div_pd(a, b)
    }

    #[inline(always)]
    fn sqrt(self, v: __m256d) -> __m256d {
        self.0.avx._mm256_sqrt_pd(v)
    }

    #[inline(always)]
    fn abs(self, v: __m256d) -> __m256d {
        self.0.avx._mm256_andnot_pd(pulp::cast([-0.0f64; 4]), v)
    }

    #[inline(always)]
    fn min(self, a: __m256d, b: __m256d) -> __m256d {
        self.0.avx._mm256_min_pd(a, b)
    }

    #[inline(always)]
    fn larger(self, a: __m256d, b: __m256d) -> u8 {
        let avx = self.0.avx;
        avx._mm256_movemask_pd(avx._mm256_cmp_pd::<_CMP_GT_OQ>(a, b)) as u8
    }
}
