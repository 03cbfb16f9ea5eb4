//! Signed diffusion: inside and outside spread through the tetrahedra from infinity.
//!
//! In: facet weights `w` and the facets that greedy gap transforms accepted. Out: `x` in about `-1..=1` for every finite
//! tetrahedron, positive inside. No rays, no normals, no orientation.
//!
//! Minimise `sum_f c_f (x_T - s_f x_U)^2 + 1e-6 sum_T x_T^2` with `x = -1` at infinity: across an accepted facet the sign
//! flips (`s = -1`, `c = exp(-4 w) / 2`: surely when it looks like a surface), across any other it stays (`s = 1`,
//! `c = exp(4 (w - 2))`: surely when one ball reaches deep through it). The system is symmetric positive definite with four
//! off-diagonal terms a row.
//!
//! Solved by conjugate gradients with the Jacobi preconditioner, after tetrahedra joined by strong facets are gathered into
//! clusters of one unknown (they differ by little anyway): a direct factorisation of a three-dimensional tetrahedral graph
//! fills in (`O(n^(4/3))` memory), where this needs a few vectors. Cost: `O(n)` an iteration. Sums run over fixed chunks, so
//! the result does not depend on the number of threads.

use super::facets::FacetDepths;
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::TetId;
use crate::geometry::mesh::DisjointSets;
use rayon::prelude::*;

/// Strength of an accepted facet of weight 0.
const FLIP: f64 = 0.5;
/// Sharpness of both kinds of coupling.
const SHARPNESS: f64 = 4.0;
/// Pull towards 0, so that parts nothing speaks of stay undecided.
const PULL: f64 = 1e-6;
/// Facets of this weight or more join their two tetrahedra into one unknown (coupling at least 0.67 of the strongest).
/// Measured at noise of half the spacing: 1.5 chains slivers from inside to outside and cuts thin parts off.
const CLUSTER_WEIGHT: f32 = 1.9;
/// Relative residual at which the iteration ends. The labels use `x` clamped and times a weight: three digits are ample.
const TOLERANCE: f64 = 1e-3;
/// Iterations at most; the system is well solved long before (a few hundred).
const MOST_ITERATIONS: usize = 3000;
/// Length of the chunks that sums are made of.
const CHUNK: usize = 4096;

/// The solution and how it was reached.
#[derive(Clone, Debug)]
pub struct Diffusion {
    /// Value of every finite tetrahedron; positive wants to be inside.
    pub value: Vec<f32>,
    /// Unknowns after clustering.
    pub unknowns: usize,
    /// Conjugate-gradient iterations.
    pub iterations: usize,
    /// Relative residual at the end.
    pub residual: f64,
}

/// Solves the diffusion. `accepted[4 * tet + index]` marks accepted facets, on both sides.
pub fn diffuse(triangulation: &Triangulation, depths: &FacetDepths, accepted: &[bool]) -> Diffusion {
    let clusters = Clusters::new(triangulation, depths, accepted);
    let system = System::new(triangulation, depths, accepted, &clusters);
    let solved = system.solve();
    Diffusion {
        value: clusters
            .number
            .iter()
            .map(|&c| solved.x[c as usize] as f32)
            .collect(),
        unknowns: clusters.count,
        iterations: solved.iterations,
        residual: solved.residual,
    }
}

/// Tetrahedra gathered by strong facets.
struct Clusters {
    number: Vec<u32>,
    count: usize,
}

impl Clusters {
    fn new(triangulation: &Triangulation, depths: &FacetDepths, accepted: &[bool]) -> Self {
        let n = triangulation.num_finite();
        let mut sets = DisjointSets::new(n);
        for tet in triangulation.finite_tets() {
            for index in 0..4u8 {
                let facet = Facet { tet, index };
                let other = triangulation.mirror(facet).tet;
                if tet < other
                    && triangulation.is_finite(other)
                    && !accepted[slot(facet)]
                    && depths.weight(triangulation, facet) >= CLUSTER_WEIGHT
                {
                    sets.union(tet.0, other.0);
                }
            }
        }
        let mut number = vec![u32::MAX; n];
        let mut count = 0u32;
        for t in 0..n as u32 {
            let root = sets.find(t);
            // The representative is the smallest member, so it is numbered first.
            if root == t {
                number[t as usize] = count;
                count += 1;
            } else {
                number[t as usize] = number[root as usize];
            }
        }
        Self {
            number,
            count: count as usize,
        }
    }
}

/// Place of a facet side in arrays over tetrahedra and facets.
#[inline]
pub(super) fn slot(facet: Facet) -> usize {
    4 * facet.tet.index() + facet.index as usize
}

/// Coupling across a facet: strength and sign.
#[inline]
fn coupling(weight: f32, accepted: bool) -> (f64, f64) {
    let w = f64::from(weight);
    if accepted {
        (FLIP * (-SHARPNESS * w).exp(), -1.0)
    } else {
        ((SHARPNESS * (w - 2.0)).exp(), 1.0)
    }
}

/// The sparse system in row form.
struct System {
    start: Vec<u32>,
    column: Vec<u32>,
    off: Vec<f64>,
    diagonal: Vec<f64>,
    right: Vec<f64>,
}

struct Solved {
    x: Vec<f64>,
    iterations: usize,
    residual: f64,
}

impl System {
    fn new(
        triangulation: &Triangulation,
        depths: &FacetDepths,
        accepted: &[bool],
        clusters: &Clusters,
    ) -> Self {
        let n = clusters.count;
        // Tetrahedra by cluster (counting sort), so that rows are gathered in a fixed order.
        let mut first = vec![0u32; n + 1];
        for &c in &clusters.number {
            first[c as usize + 1] += 1;
        }
        for i in 0..n {
            first[i + 1] += first[i];
        }
        let mut members = vec![0u32; clusters.number.len()];
        let mut next = first.clone();
        for (t, &c) in clusters.number.iter().enumerate() {
            members[next[c as usize] as usize] = t as u32;
            next[c as usize] += 1;
        }
        let rows: Vec<Row> = (0..n)
            .into_par_iter()
            .map(|c| {
                let tets = &members[first[c] as usize..first[c + 1] as usize];
                Row::gather(triangulation, depths, accepted, clusters, c as u32, tets)
            })
            .collect();
        let mut start = Vec::with_capacity(n + 1);
        let mut column = Vec::new();
        let mut off = Vec::new();
        start.push(0);
        for row in &rows {
            for &(c, value) in &row.entries {
                column.push(c);
                off.push(value);
            }
            start.push(column.len() as u32);
        }
        Self {
            start,
            column,
            off,
            diagonal: rows.iter().map(|r| r.diagonal).collect(),
            right: rows.iter().map(|r| r.right).collect(),
        }
    }

    /// `y = A x`.
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        y.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (k, slot) in out.iter_mut().enumerate() {
                let i = chunk * CHUNK + k;
                let row = self.start[i] as usize..self.start[i + 1] as usize;
                let mut sum = self.diagonal[i] * x[i];
                for (c, v) in self.column[row.clone()].iter().zip(&self.off[row]) {
                    sum += v * x[*c as usize];
                }
                *slot = sum;
            }
        });
    }

    fn solve(&self) -> Solved {
        let n = self.diagonal.len();
        let mut x = vec![0.0; n];
        let mut r = self.right.clone();
        let scale = dot(&r, &r).sqrt();
        if scale == 0.0 {
            return Solved {
                x,
                iterations: 0,
                residual: 0.0,
            };
        }
        // Everything starts outside: the answer in most of space.
        x.fill(-1.0);
        let mut q = vec![0.0; n];
        self.apply(&x, &mut q);
        for i in 0..n {
            r[i] -= q[i];
        }
        let precondition = |r: &[f64], z: &mut Vec<f64>| {
            z.par_chunks_mut(CHUNK).enumerate().for_each(|(c, out)| {
                for (k, slot) in out.iter_mut().enumerate() {
                    let i = c * CHUNK + k;
                    *slot = r[i] / self.diagonal[i];
                }
            });
        };
        let mut z = vec![0.0; n];
        precondition(&r, &mut z);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        // Residuals are judged in the preconditioned norm, where every tetrahedron counts alike.
        let start = rz.max(f64::MIN_POSITIVE);
        let mut iterations = 0;
        while iterations < MOST_ITERATIONS && rz > TOLERANCE * TOLERANCE * start {
            self.apply(&p, &mut q);
            let alpha = rz / dot(&p, &q);
            axpy(alpha, &p, &mut x);
            axpy(-alpha, &q, &mut r);
            precondition(&r, &mut z);
            let next = dot(&r, &z);
            let beta = next / rz;
            rz = next;
            p.par_iter_mut()
                .zip(z.par_iter())
                .for_each(|(p, z)| *p = z + beta * *p);
            iterations += 1;
        }
        Solved {
            x,
            iterations,
            residual: (rz / start).sqrt(),
        }
    }
}

/// One row of the system.
struct Row {
    entries: Vec<(u32, f64)>,
    diagonal: f64,
    right: f64,
}

impl Row {
    fn gather(
        triangulation: &Triangulation,
        depths: &FacetDepths,
        accepted: &[bool],
        clusters: &Clusters,
        own: u32,
        tets: &[u32],
    ) -> Self {
        let mut entries: Vec<(u32, f64)> = Vec::with_capacity(4 * tets.len());
        let mut diagonal = PULL * tets.len() as f64;
        let mut right = 0.0;
        for &t in tets {
            for index in 0..4u8 {
                let facet = Facet { tet: TetId(t), index };
                let other = triangulation.mirror(facet).tet;
                let (c, sign) = coupling(depths.weight(triangulation, facet), accepted[slot(facet)]);
                if !triangulation.is_finite(other) {
                    diagonal += c;
                    right -= c * sign;
                } else if clusters.number[other.index()] != own {
                    diagonal += c;
                    entries.push((clusters.number[other.index()], -c * sign));
                } else {
                    // Inside one cluster only a sign flip costs: (x + x)^2 = 4 x^2.
                    diagonal += if sign < 0.0 { 2.0 * c } else { 0.0 };
                }
            }
        }
        entries.sort_by_key(|e| e.0);
        entries.dedup_by(|later, kept| {
            let same = later.0 == kept.0;
            if same {
                kept.1 += later.1;
            }
            same
        });
        Self {
            entries,
            diagonal,
            right,
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let parts: Vec<f64> = a
        .par_chunks(CHUNK)
        .zip(b.par_chunks(CHUNK))
        .map(|(a, b)| a.iter().zip(b).map(|(x, y)| x * y).sum())
        .collect();
    parts.iter().sum()
}

fn axpy(alpha: f64, x: &[f64], y: &mut [f64]) {
    y.par_iter_mut()
        .zip(x.par_iter())
        .for_each(|(y, x)| *y += alpha * x);
}
