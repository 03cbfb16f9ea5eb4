//! Poisson-disk (blue-noise) points on a mesh: random, but never closer than a radius.
//!
//! Dart throwing in a hash grid (Cook 1986; on surfaces Corsini, Cignoni & Scopigno 2012), with the
//! radius found from the number of points wanted:
//!
//! 1. a pool of `POOL` candidates a point is drawn from the area measure;
//! 2. darts: a candidate is kept unless a kept one lies within the radius **and** faces the same way
//!    (normals less than 120 degrees apart), so that the two sides of a thin plate do not push each other;
//! 3. the radius starts from the packing density of maximal dart throwing and is corrected by the count
//!    it gave, until slightly more than `n` points are kept;
//! 4. the surplus goes, those with the nearest neighbour first.
//!
//! Cost O(pool) expected; a million points take a few seconds. With a density the radius varies as
//! `density^(-1/2)` and two points collide at the smaller of their radii.

use super::uniform::AreaSampler;
use super::{generator, stream};
use crate::cloud::Cloud;
use crate::mesh::TriangleMesh;
use glam::DVec3;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Candidates a point: with eight, the kept set is maximal up to a percent of the area.
const POOL: usize = 8;

/// Points kept in the area of one squared radius by dart throwing from that pool on a plane (measured).
const PACKING: f64 = 0.66;

/// Cosine between normals below which two points do not see each other.
const SAME_SIDE: f64 = -0.5;

/// Draws `n` blue-noise points on `mesh`, with the normals of their triangles.
///
/// Exactly `n` points come back (fewer only for an empty mesh); their order is random.
///
/// # Example
/// ```
/// let mesh = datasets_synthetic::shapes::sphere(1.0).mesh(2_000);
/// let cloud = datasets_synthetic::sample_poisson(&mesh, 300, 1);
/// let closest = |i: usize| {
///     (0..300).filter(|&j| j != i).map(|j| cloud.points[i].distance(cloud.points[j])).fold(f64::MAX, f64::min)
/// };
/// // The square that each point owns has side 0.2; random points would come 20 times closer.
/// assert!((0..300).map(closest).fold(f64::MAX, f64::min) > 0.13);
/// ```
pub fn sample_poisson(mesh: &TriangleMesh, n: usize, seed: u64) -> Cloud {
    sample_poisson_with_density(mesh, n, seed, |_| 1.0)
}

/// Draws `n` blue-noise points with density proportional to `density(p)` (positive).
pub fn sample_poisson_with_density(
    mesh: &TriangleMesh,
    n: usize,
    seed: u64,
    density: impl Fn(DVec3) -> f64,
) -> Cloud {
    let sampler = AreaSampler::new(mesh);
    if n == 0 || sampler.area() <= 0.0 {
        return Cloud::default();
    }
    let pool = Pool::draw(mesh, &sampler, n, seed, density);
    // Radius for unit density; the pool's mean density turns area into expected mass.
    let mut radius = (PACKING * sampler.area() * pool.mean_density / n as f64).sqrt();
    let mut kept = pool.darts(radius);
    for _ in 0..12 {
        if kept.len() >= n && kept.len() <= n + n / 40 + 2 {
            break;
        }
        let ratio = (kept.len() as f64 / n as f64).sqrt();
        // Aim half a percent of radius below, because the surplus can be removed and a deficit cannot be filled.
        radius *= ratio.clamp(0.5, 2.0) * 0.995;
        kept = pool.darts(radius);
    }
    while kept.len() < n {
        radius *= 0.97;
        kept = pool.darts(radius);
    }
    pool.without_surplus(kept, n, radius)
}

/// Candidates with their normals and local radius factors.
struct Pool {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    /// Radius in units of the common one: density^(-1/2).
    scale: Vec<f64>,
    largest_scale: f64,
    mean_density: f64,
}

impl Pool {
    fn draw(
        mesh: &TriangleMesh,
        sampler: &AreaSampler<'_>,
        n: usize,
        seed: u64,
        density: impl Fn(DVec3) -> f64,
    ) -> Self {
        let mut rng = generator(seed, stream::POISSON);
        let triangle_normals: Vec<DVec3> = (0..mesh.triangles.len())
            .map(|t| mesh.double_area_normal(t).normalize_or_zero())
            .collect();
        // Candidates follow the area, so a dense corner needs a larger pool to be filled; count first.
        let probe: Vec<f64> = (0..512).map(|_| density(sampler.draw(&mut rng).0)).collect();
        let mean_density = probe.iter().sum::<f64>() / probe.len() as f64;
        let contrast = (probe.iter().copied().fold(0.0, f64::max) / mean_density).clamp(1.0, 8.0);
        let count = (POOL as f64 * n as f64 * contrast) as usize + 64;
        let mut pool = Pool {
            points: Vec::with_capacity(count),
            normals: Vec::with_capacity(count),
            scale: Vec::with_capacity(count),
            largest_scale: 0.0,
            mean_density,
        };
        for _ in 0..count {
            let (p, t) = sampler.draw(&mut rng);
            let scale = density(p).max(1e-12).powf(-0.5);
            pool.largest_scale = pool.largest_scale.max(scale);
            pool.points.push(p);
            pool.normals.push(triangle_normals[t as usize]);
            pool.scale.push(scale);
        }
        pool
    }

    fn collide(&self, i: u32, j: u32, radius: f64) -> bool {
        let (i, j) = (i as usize, j as usize);
        let r = radius * self.scale[i].min(self.scale[j]);
        self.points[i].distance_squared(self.points[j]) < r * r
            && self.normals[i].dot(self.normals[j]) > SAME_SIDE
    }

    /// Indices of the kept candidates, in the order they were thrown.
    fn darts(&self, radius: f64) -> Vec<u32> {
        let mut grid = Grid::new(radius * self.largest_scale, self.points.len() / POOL);
        let mut kept = Vec::new();
        for i in 0..self.points.len() as u32 {
            let p = self.points[i as usize];
            if !grid.any_near(p, |j| self.collide(i, j, radius)) {
                grid.insert(p, i);
                kept.push(i);
            }
        }
        kept
    }

    /// Removes the points with the nearest neighbour until `n` are left.
    fn without_surplus(&self, kept: Vec<u32>, n: usize, radius: f64) -> Cloud {
        let mut grid = Grid::new(1.5 * radius * self.largest_scale, kept.len());
        kept.iter().for_each(|&i| grid.insert(self.points[i as usize], i));
        let mut crowding: Vec<(f64, u32)> = kept
            .iter()
            .map(|&i| {
                let mut nearest = f64::MAX;
                grid.any_near(self.points[i as usize], |j| {
                    if j != i {
                        let d = self.points[i as usize].distance(self.points[j as usize]);
                        nearest = nearest.min(d / self.scale[i as usize]);
                    }
                    false
                });
                (nearest, i)
            })
            .collect();
        crowding.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut drop: Vec<u32> = crowding[..kept.len() - n].iter().map(|c| c.1).collect();
        drop.sort_unstable();
        let left: Vec<u32> = kept
            .into_iter()
            .filter(|i| drop.binary_search(i).is_err())
            .collect();
        Cloud {
            points: left.iter().map(|&i| self.points[i as usize]).collect(),
            normals: left.iter().map(|&i| self.normals[i as usize]).collect(),
        }
    }
}

/// Hash grid with chained cells; only looked up, never iterated, so hashing cannot leak into results.
struct Grid {
    inverse_cell: f64,
    head: HashMap<(i32, i32, i32), u32, BuildHasherDefault<CellHasher>>,
    entries: Vec<(u32, u32)>,
}

impl Grid {
    fn new(cell: f64, expected: usize) -> Self {
        Grid {
            inverse_cell: 1.0 / cell,
            head: HashMap::with_capacity_and_hasher(expected, Default::default()),
            entries: Vec::with_capacity(expected),
        }
    }

    fn cell(&self, p: DVec3) -> (i32, i32, i32) {
        let q = (p * self.inverse_cell).floor();
        (q.x as i32, q.y as i32, q.z as i32)
    }

    fn insert(&mut self, p: DVec3, id: u32) {
        let slot = self.entries.len() as u32;
        let before = self.head.insert(self.cell(p), slot).unwrap_or(u32::MAX);
        self.entries.push((id, before));
    }

    /// Whether any point in the 27 cells around satisfies `test`; the own cell is asked first, because
    /// most rejected darts are rejected there.
    fn any_near(&self, p: DVec3, mut test: impl FnMut(u32) -> bool) -> bool {
        const STEPS: [i32; 3] = [0, -1, 1];
        let (x, y, z) = self.cell(p);
        for dz in STEPS {
            for dy in STEPS {
                for dx in STEPS {
                    let Some(&first) = self.head.get(&(x + dx, y + dy, z + dz)) else {
                        continue;
                    };
                    let mut slot = first;
                    while slot != u32::MAX {
                        let (id, next) = self.entries[slot as usize];
                        if test(id) {
                            return true;
                        }
                        slot = next;
                    }
                }
            }
        }
        false
    }
}

/// Multiplicative hash of cell numbers: three multiplications instead of SipHash.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 32)
    }

    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_u32(b as u32);
        }
    }

    fn write_u32(&mut self, value: u32) {
        self.0 = (self.0.rotate_left(21) ^ value as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }

    fn write_i32(&mut self, value: i32) {
        self.write_u32(value as u32);
    }
}
