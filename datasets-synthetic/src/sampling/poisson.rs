//! Poisson-disk (blue-noise) points on a mesh: random, but never closer than a radius.
//!
//! Dart throwing in a grid (Cook 1986; on surfaces Corsini, Cignoni & Scopigno 2012), with the radius found from the
//! number of points wanted:
//!
//! 1. a pool of `POOL` candidates a point is drawn from the area measure and sorted into the cells of a grid as wide as the radius;
//! 2. darts: in round `k` every cell throws its `k`-th candidate, the cells in 27 interleaved phases so that no direction is
//!    favoured (Wei 2008). A candidate is kept unless a kept one lies within the radius **and** faces the same way
//!    (normals less than 120 degrees apart), so that the two sides of a thin plate do not push each other;
//! 3. the radius starts from the packing density of maximal dart throwing and is corrected by the count
//!    it gave, until slightly more than `n` points are kept;
//! 4. the surplus goes, those with the nearest neighbour first; the rest is shuffled.
//!
//! Cost O(pool log pool); a million points take a few seconds. Sorting by cell instead of hashing makes all accesses local:
//! ten times faster at a million points. With a density the radius varies as
//! `density^(-1/2)` and two points collide at the smaller of their radii.

use super::uniform::AreaSampler;
use super::{generator, shuffle, stream};
use crate::cloud::Cloud;
use crate::mesh::{Bounds, TriangleMesh};
use glam::DVec3;
use rayon::prelude::*;

/// Candidates a point: with eight, the kept set is maximal up to a percent of the area.
const POOL: usize = 8;

/// Points kept in the area of one squared radius by dart throwing from that pool: 0.547 measured on smooth surfaces, less one percent, so that
/// the first throw usually has a small surplus and no second is needed.
const PACKING: f64 = 0.541;

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
    let mut darts = Darts::throw(&pool, radius);
    for _ in 0..12 {
        if darts.kept >= n && darts.kept <= n + n / 40 + 2 {
            break;
        }
        let ratio = (darts.kept as f64 / n as f64).sqrt();
        // Aim half a percent of radius below, because the surplus can be removed and a deficit cannot be filled.
        radius *= ratio.clamp(0.5, 2.0) * 0.995;
        darts = Darts::throw(&pool, radius);
    }
    while darts.kept < n {
        radius *= 0.97;
        darts = Darts::throw(&pool, radius);
    }
    darts.without_surplus(n, seed)
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
            let scale = 1.0 / density(p).max(1e-12).sqrt();
            pool.largest_scale = pool.largest_scale.max(scale);
            pool.points.push(p);
            pool.normals.push(triangle_normals[t as usize]);
            pool.scale.push(scale);
        }
        pool
    }
}

/// A candidate in its cell.
#[derive(Clone, Copy)]
struct Dart {
    point: DVec3,
    normal: DVec3,
    scale: f64,
}

impl Dart {
    fn collides(&self, other: &Dart, radius: f64) -> bool {
        let r = radius * self.scale.min(other.scale);
        self.point.distance_squared(other.point) < r * r && self.normal.dot(other.normal) > SAME_SIDE
    }
}

/// The candidates sorted by cell, the kept ones first in each.
struct Darts {
    radius: f64,
    darts: Vec<Dart>,
    /// First dart of every cell, and the end.
    start: Vec<u32>,
    /// Darts kept in every cell.
    count: Vec<u32>,
    /// For every cell nine runs of neighbouring cells (first, end), one for each row around it.
    rows: Vec<[[u32; 2]; 9]>,
    kept: usize,
}

/// Bits of a cell number along one axis.
const BITS: u32 = 21;

impl Darts {
    fn throw(pool: &Pool, radius: f64) -> Self {
        let mut field = Self::sort(pool, radius);
        let (order, rounds) = field.phases(pool);
        for round in 0..rounds {
            for &cell in &order {
                let at = field.start[cell as usize] + round;
                if at < field.start[cell as usize + 1] && field.is_free(cell, &field.darts[at as usize]) {
                    // Kept darts stand first in their cell: rejected ones are never looked at again.
                    let place = field.start[cell as usize] + field.count[cell as usize];
                    field.darts.swap(at as usize, place as usize);
                    field.count[cell as usize] += 1;
                    field.kept += 1;
                }
            }
        }
        field
    }

    fn sort(pool: &Pool, radius: f64) -> Self {
        let bounds = Bounds::of(&pool.points).expect("the pool is not empty");
        // Cells are at least as wide as the largest radius, and few enough for their numbers.
        let width =
            (radius * pool.largest_scale).max(bounds.size().max_element() / (1u64 << (BITS - 1)) as f64);
        let key = |p: DVec3| -> u64 {
            // One empty layer around keeps neighbours' numbers positive.
            let c = ((p - bounds.min) / width).floor() + 1.0;
            ((c.z as u64) << (2 * BITS)) | ((c.y as u64) << BITS) | c.x as u64
        };
        let mut keyed: Vec<(u64, u32)> = pool
            .points
            .par_iter()
            .enumerate()
            .map(|(i, &p)| (key(p), i as u32))
            .collect();
        keyed.par_sort_unstable();
        let darts = keyed
            .par_iter()
            .map(|&(_, i)| {
                let i = i as usize;
                Dart {
                    point: pool.points[i],
                    normal: pool.normals[i],
                    scale: pool.scale[i],
                }
            })
            .collect();
        let mut cells: Vec<u64> = Vec::new();
        let mut start = Vec::new();
        for (i, &(key, _)) in keyed.iter().enumerate() {
            if cells.last() != Some(&key) {
                cells.push(key);
                start.push(i as u32);
            }
        }
        start.push(keyed.len() as u32);
        let rows = neighbour_rows(&cells);
        Darts {
            radius,
            darts,
            start,
            count: vec![0; cells.len()],
            rows,
            kept: 0,
        }
    }

    /// Cells by phase, and the number of rounds.
    fn phases(&self, pool: &Pool) -> (Vec<u32>, u32) {
        let corner = Bounds::of(&pool.points).expect("the pool is not empty").min;
        let width = self.radius * pool.largest_scale;
        let phase = |cell: u32| -> u32 {
            let c = ((self.darts[self.start[cell as usize] as usize].point - corner) / width).floor();
            let part = |x: f64| (x as i64).rem_euclid(3) as u32;
            // 10 is coprime to 27: phases that follow each other are not neighbours.
            (9 * part(c.z) + 3 * part(c.y) + part(c.x)) * 10 % 27
        };
        let cells = self.count.len() as u32;
        let mut order: Vec<(u32, u32)> = (0..cells).map(|c| (phase(c), c)).collect();
        order.par_sort_unstable();
        let rounds = self.start.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
        (order.into_iter().map(|o| o.1).collect(), rounds)
    }

    fn is_free(&self, cell: u32, dart: &Dart) -> bool {
        !self.near(cell).any(|other| dart.collides(other, self.radius))
    }

    /// Kept darts in the 27 cells around.
    fn near(&self, cell: u32) -> impl Iterator<Item = &Dart> {
        self.rows[cell as usize]
            .iter()
            .flat_map(|&[first, end]| first..end)
            .flat_map(|c| {
                let first = self.start[c as usize] as usize;
                &self.darts[first..first + self.count[c as usize] as usize]
            })
    }

    /// Removes the points with the nearest neighbour until `n` are left, and shuffles the rest.
    fn without_surplus(&self, n: usize, seed: u64) -> Cloud {
        let mut crowding: Vec<(f64, u32)> = (0..self.count.len() as u32)
            .into_par_iter()
            .flat_map_iter(|cell| {
                let first = self.start[cell as usize];
                (first..first + self.count[cell as usize]).map(move |i| (self.crowding(cell, i), i))
            })
            .collect();
        crowding.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        crowding.truncate(n);
        let order = shuffle(n, seed);
        let left = |i: u32| &self.darts[crowding[i as usize].1 as usize];
        Cloud {
            points: order.iter().map(|&i| left(i).point).collect(),
            normals: order.iter().map(|&i| left(i).normal).collect(),
        }
    }

    /// Distance to the nearest kept dart in units of the local radius; beyond two radii it does not matter which.
    fn crowding(&self, cell: u32, dart: u32) -> f64 {
        let me = &self.darts[dart as usize];
        let others = self.near(cell).filter(|other| !std::ptr::eq(*other, me));
        others
            .map(|other| other.point.distance(me.point) / me.scale)
            .fold(f64::MAX, f64::min)
    }
}

/// The rows around a cell, its own first: most rejected darts are rejected there.
const ROWS: [(i64, i64); 9] = [
    (0, 0),
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 1),
    (-1, 1),
    (1, -1),
    (-1, -1),
];

/// For every cell of a sorted list the runs of cells in the nine rows around it, found by one merge a row.
fn neighbour_rows(cells: &[u64]) -> Vec<[[u32; 2]; 9]> {
    let mut rows = vec![[[0; 2]; 9]; cells.len()];
    for row in 0..9usize {
        let (dy, dz) = ROWS[row];
        let shift = (dz << (2 * BITS)) + (dy << BITS);
        let (mut first, mut end) = (0, 0);
        for (i, &cell) in cells.iter().enumerate() {
            let middle = cell.wrapping_add_signed(shift);
            while first < cells.len() && cells[first] < middle - 1 {
                first += 1;
            }
            end = end.max(first);
            while end < cells.len() && cells[end] <= middle + 1 {
                end += 1;
            }
            rows[i][row] = [first as u32, end as u32];
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    fn nearest_distances(points: &[DVec3]) -> Vec<f64> {
        let nearest = |i: usize| {
            let others = points.iter().enumerate().filter(|(j, _)| *j != i);
            others
                .map(|(_, q)| q.distance(points[i]))
                .fold(f64::MAX, f64::min)
        };
        (0..points.len()).into_par_iter().map(nearest).collect()
    }

    #[test]
    fn points_keep_apart_and_leave_no_gaps() {
        let shape = shapes::torus(3.0, 1.0);
        let mesh = shape.mesh(8_000);
        let n = 3_000;
        let cloud = sample_poisson(&mesh, n, 2);
        assert_eq!(cloud.len(), n);
        let spacing = (mesh.area() / n as f64).sqrt();
        let nearest = nearest_distances(&cloud.points);
        let least = nearest.iter().copied().fold(f64::MAX, f64::min);
        assert!(
            least > 0.72 * spacing,
            "closest pair at {} spacings",
            least / spacing
        );
        // No vertex of the mesh is far from all points.
        let gap = |p: DVec3| {
            cloud
                .points
                .iter()
                .map(|q| q.distance(p))
                .fold(f64::MAX, f64::min)
        };
        let widest = mesh.points.iter().step_by(3).map(|&p| gap(p)).fold(0.0, f64::max);
        assert!(widest < 1.3 * spacing, "widest gap {} spacings", widest / spacing);
    }

    #[test]
    fn sides_of_a_thin_plate_do_not_push_each_other() {
        let mesh = shapes::box_shape(10.0, 9.0, 0.05).mesh(4_000);
        let cloud = sample_poisson(&mesh, 2_000, 1);
        let above = cloud.points.iter().filter(|p| p.z > 0.0249).count();
        assert!(
            (above as f64 / 1_000.0 - 1.0).abs() < 0.06,
            "{above} of 2000 on the upper side"
        );
    }

    #[test]
    fn density_varies_as_asked() {
        let mesh = shapes::box_shape(10.0, 3.0, 2.0).mesh(4_000);
        let cloud =
            sample_poisson_with_density(&mesh, 4_000, 1, super::super::density_gradient_x(&mesh, 20.0));
        let count = |a: f64, b: f64| cloud.points.iter().filter(|p| p.x > a && p.x < b).count() as f64;
        let ratio = count(3.0, 4.0) / count(-4.0, -3.0);
        assert!((ratio / 20f64.powf(0.7) - 1.0).abs() < 0.25, "{ratio}");
        assert_eq!(cloud.len(), 4_000);
    }
}
