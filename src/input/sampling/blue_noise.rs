//! Evenly spread random samples of a surface (Poisson-disk, "blue noise").
//!
//! In: a mesh, points already taken (sharp edges), the number wanted. Out: exactly that many points (or all candidates, when
//! even those are fewer), the taken ones first.
//!
//! 1. Candidates, twelve for every sample, uniformly by area and stratified along the list of triangles.
//! 2. In random order each is taken unless a taken one is nearer than a radius; the radius begins above the jamming density of
//!    random disks (`0.547`, so `0.83` spacings) and shrinks by 5 % a pass until the number is reached. The gaps a single pass
//!    of dart throwing leaves are so filled at the largest radius that fits.
//! 3. Two samples on opposite sides of a thin wall (normals more than 90 degrees apart) do not exclude each other.
//!
//! Dart throwing: Cook 1986; relaxing the radius: McCool & Fiume 1992. Cost: expected `O(candidates)`, a hash grid finds the
//! neighbours. One seed, one result; the stream is ChaCha8.

use crate::geometry::TriangleMesh;
use glam::DVec3;
use rand::{Rng, RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use std::{
    collections::HashMap,
    hash::{BuildHasherDefault, Hasher},
};

/// Candidates for every sample.
const CANDIDATES: usize = 12;

/// First radius, in spacings.
const FIRST_RADIUS: f64 = 0.86;

/// Radius of a pass over that of the pass before.
const SHRINK: f64 = 0.95;

/// A candidate this near to a sample, in spacings, is given up: no surface needs a radius so small to take its number.
const HOPELESS: f64 = 0.66;

/// Random stream of this stage.
const STREAM: u64 = 1;

#[derive(Clone, Copy)]
struct Candidate {
    point: DVec3,
    normal: DVec3,
    /// Squared distance to a taken sample that excludes it, the nearest when it was last looked for.
    nearest2: f64,
}

/// `count` samples of `mesh` about `spacing_mm` apart, `taken` first and included in the count.
pub fn samples(mesh: &TriangleMesh, taken: &[DVec3], count: usize, spacing_mm: f64, seed: u64) -> Vec<DVec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(STREAM);
    let mut candidates = candidates(mesh, count.saturating_mul(CANDIDATES), &mut rng);
    candidates.shuffle(&mut rng);
    // Points on sharp edges have no normal: they exclude candidates of either side.
    let mut kept: Vec<Candidate> = taken
        .iter()
        .map(|&point| Candidate {
            point,
            normal: DVec3::ZERO,
            nearest2: f64::INFINITY,
        })
        .collect();
    let mut radius = FIRST_RADIUS * spacing_mm;
    let mut grid = Grid::new(radius);
    for (i, c) in kept.iter().enumerate() {
        grid.insert(c.point, i as u32);
    }
    while kept.len() < count && !candidates.is_empty() {
        let radius2 = radius * radius;
        let hopeless2 = (HOPELESS * spacing_mm).powi(2).min(radius2);
        candidates.retain_mut(|c| {
            if kept.len() >= count {
                return false;
            }
            // Samples never go: what excluded it still does.
            if c.nearest2 < radius2 {
                return true;
            }
            let mut nearest2 = f64::INFINITY;
            for i in grid.near_within(c.point, radius) {
                let k = &kept[i as usize];
                if k.normal.dot(c.normal) >= 0.0 {
                    nearest2 = nearest2.min((k.point - c.point).length_squared());
                    if nearest2 <= hopeless2 {
                        return false;
                    }
                }
            }
            if nearest2 >= radius2 {
                grid.insert(c.point, kept.len() as u32);
                kept.push(*c);
            }
            c.nearest2 = nearest2;
            nearest2 < radius2
        });
        radius *= SHRINK;
    }
    kept.into_iter().map(|c| c.point).collect()
}

/// `n` points spread uniformly by area, the i-th in the i-th of `n` equal shares of the area.
fn candidates(mesh: &TriangleMesh, n: usize, rng: &mut impl Rng) -> Vec<Candidate> {
    let total = mesh.area();
    let mut out = Vec::with_capacity(n);
    let mut walked = 0.0;
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.points[i as usize]);
        let cross = (b - a).cross(c - a);
        walked += 0.5 * cross.length();
        let normal = cross.normalize_or_zero();
        while out.len() < n && (out.len() as f64 + 0.5) / n as f64 * total < walked {
            let (u, v): (f64, f64) = (rng.random(), rng.random());
            let s = u.sqrt();
            let point = a * (1.0 - s) + b * (s * (1.0 - v)) + c * (s * v);
            out.push(Candidate {
                point,
                normal,
                nearest2: f64::INFINITY,
            });
        }
    }
    out
}

/// A hash grid of points: cells as wide as the search radius, chained lists.
pub(super) struct Grid {
    cell: f64,
    heads: HashMap<[i64; 3], u32, BuildHasherDefault<CellHasher>>,
    next: Vec<u32>,
}

/// The cell itself and its 26 neighbours, those across a face first: near points are found early.
const NEAREST_FIRST: [[i64; 3]; 27] = {
    let mut out = [[0; 3]; 27];
    let mut filled = 0;
    let mut apart = 0;
    while apart <= 3 {
        let mut n = 0;
        while n < 27 {
            let [i, j, k] = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
            if i * i + j * j + k * k == apart {
                out[filled] = [i, j, k];
                filled += 1;
            }
            n += 1;
        }
        apart += 1;
    }
    out
};

/// End of a list.
const NONE: u32 = u32::MAX;

impl Grid {
    pub(super) fn new(cell: f64) -> Self {
        Self {
            cell,
            heads: HashMap::default(),
            next: Vec::new(),
        }
    }

    fn key(&self, p: DVec3) -> [i64; 3] {
        (p / self.cell).floor().to_array().map(|x| x as i64)
    }

    /// Adds a point under an index; indices must come in order from 0.
    pub(super) fn insert(&mut self, p: DVec3, index: u32) {
        debug_assert_eq!(index as usize, self.next.len());
        let head = self.heads.entry(self.key(p)).or_insert(NONE);
        self.next.push(*head);
        *head = index;
    }

    /// The points of the 27 cells about `p`.
    pub(super) fn near(&self, p: DVec3) -> impl Iterator<Item = u32> + '_ {
        self.near_within(p, f64::INFINITY)
    }

    /// The points of those of the 27 cells about `p` that come within `reach` of it: about half of them for a reach of one cell.
    fn near_within(&self, p: DVec3, reach: f64) -> impl Iterator<Item = u32> + '_ {
        let [x, y, z] = self.key(p);
        let from_low = p - DVec3::new(x as f64, y as f64, z as f64) * self.cell;
        // Squared distance to the slab of the cells below, the same and above, on each axis.
        let slab2 = from_low.to_array().map(|d| {
            let (below, above) = (d.max(0.0), (self.cell - d).max(0.0));
            [below * below, 0.0, above * above]
        });
        let reach2 = reach * reach * (1.0 + 1e-9);
        NEAREST_FIRST.iter().flat_map(move |[i, j, k]| {
            let key = [x + i, y + j, z + k];
            let away2 = slab2[0][(i + 1) as usize] + slab2[1][(j + 1) as usize] + slab2[2][(k + 1) as usize];
            let mut at = if away2 > reach2 {
                NONE
            } else {
                self.heads.get(&key).copied().unwrap_or(NONE)
            };
            std::iter::from_fn(move || {
                let here = at;
                if here == NONE {
                    return None;
                }
                at = self.next[here as usize];
                Some(here)
            })
        })
    }
}

/// Mixes the three cell numbers; only look-ups depend on it, never an order.
#[derive(Default)]
pub(super) struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 29)
    }

    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_i64(i64::from(b));
        }
    }

    fn write_i64(&mut self, v: i64) {
        self.0 = (self.0.rotate_left(21) ^ v as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn write_usize(&mut self, _: usize) {} // the length of the array, always 3
}
