//! Independent random points on a mesh.
//!
//! 1. cumulative areas of the triangles;
//! 2. a uniform number picks the triangle (binary search), two more the place in it (square-root warp:
//!    Osada et al., *Shape distributions*, 2002, eq. 1);
//! 3. with a density, a point is kept with probability density / maximum (rejection), so that the
//!    density is exact at every place, not only triangle by triangle.
//!
//! O(n log t); a million points take a few tenths of a second.

use super::{generator, stream};
use crate::cloud::Cloud;
use crate::mesh::TriangleMesh;
use glam::DVec3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Draws points from the area measure of a mesh.
pub(crate) struct AreaSampler<'a> {
    mesh: &'a TriangleMesh,
    cumulative: Vec<f64>,
}

impl<'a> AreaSampler<'a> {
    pub(crate) fn new(mesh: &'a TriangleMesh) -> Self {
        let mut total = 0.0;
        let cumulative = (0..mesh.triangles.len())
            .map(|t| {
                total += 0.5 * mesh.double_area_normal(t).length();
                total
            })
            .collect();
        AreaSampler { mesh, cumulative }
    }

    pub(crate) fn area(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// One point and the triangle it lies in.
    pub(crate) fn draw(&self, rng: &mut ChaCha8Rng) -> (DVec3, u32) {
        let u = rng.random::<f64>() * self.area();
        let t = self
            .cumulative
            .partition_point(|&c| c <= u)
            .min(self.cumulative.len() - 1);
        let [a, b, c] = self.mesh.corners(t);
        let s = rng.random::<f64>().sqrt();
        let r = rng.random::<f64>();
        ((1.0 - s) * a + s * (1.0 - r) * b + s * r * c, t as u32)
    }
}

/// Draws `n` independent points, uniform over the area of `mesh`, with the normals of their triangles.
///
/// An empty mesh gives an empty cloud.
///
/// # Example
/// ```
/// let mesh = datasets_synthetic::shapes::sphere(1.0).mesh(2_000);
/// let cloud = datasets_synthetic::sample_uniform(&mesh, 500, 7);
/// assert_eq!(cloud.len(), 500);
/// assert_eq!(cloud, datasets_synthetic::sample_uniform(&mesh, 500, 7));
/// ```
pub fn sample_uniform(mesh: &TriangleMesh, n: usize, seed: u64) -> Cloud {
    sample_with_density(mesh, n, seed, |_| 1.0, 1.0)
}

/// Draws `n` points whose density over the area is proportional to `density(p)`.
///
/// `maximum` bounds the density from above; values beyond it are treated as equal to it. Expected cost
/// is `n * maximum / mean density` draws. A density that is zero on the whole mesh would never end, so
/// the draws stop after a million times `n` and fewer points come back.
pub fn sample_with_density(
    mesh: &TriangleMesh,
    n: usize,
    seed: u64,
    density: impl Fn(DVec3) -> f64,
    maximum: f64,
) -> Cloud {
    let sampler = AreaSampler::new(mesh);
    if sampler.area() <= 0.0 {
        return Cloud::default();
    }
    let mut rng = generator(seed, stream::UNIFORM);
    let mut cloud = Cloud {
        points: Vec::with_capacity(n),
        normals: Vec::with_capacity(n),
    };
    let mut draws_left = n.saturating_mul(1_000_000);
    while cloud.points.len() < n && draws_left > 0 {
        draws_left -= 1;
        let (p, t) = sampler.draw(&mut rng);
        if rng.random::<f64>() * maximum <= density(p) {
            cloud.points.push(p);
            cloud
                .normals
                .push(mesh.double_area_normal(t as usize).normalize_or_zero());
        }
    }
    cloud
}

/// The density of [`sample_density_gradient`]: grows geometrically along x from 1 at the least x of the
/// mesh to `ratio` at the greatest.
pub fn density_gradient_x(mesh: &TriangleMesh, ratio: f64) -> impl Fn(DVec3) -> f64 + use<> {
    let b = mesh.bounds();
    let (x0, width) = (b.min.x, b.size().x.max(f64::MIN_POSITIVE));
    move |p: DVec3| ratio.powf(((p.x - x0) / width).clamp(0.0, 1.0))
}

/// Draws `n` independent points whose density grows geometrically along x, from 1 to `ratio`
/// (20 is the harness's standard).
pub fn sample_density_gradient(mesh: &TriangleMesh, n: usize, ratio: f64, seed: u64) -> Cloud {
    sample_with_density(mesh, n, seed, density_gradient_x(mesh, ratio), ratio.max(1.0))
}
