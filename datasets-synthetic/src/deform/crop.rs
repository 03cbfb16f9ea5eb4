//! Crops: what a fracture, a field of view or a scanner leaves of a shape.
//!
//! Crops of points give the indices kept, so that truth by index stays valid; they need a [`Cloud`], and
//! visibility needs its normals. [`TriangleMesh`] crops keep whole triangles, so the rest is an open mesh.

use crate::cloud::Cloud;
use crate::mesh::TriangleMesh;
use crate::sampling::{generator, stream};
use glam::DVec3;
use rand::RngExt;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// What a crop left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// The points left, with their normals.
    pub cloud: Cloud,
    /// Index of each of them in the cloud that was cropped.
    pub indices: Vec<u32>,
    /// Share of the points left, 0 to 1.
    pub share: f64,
}

impl Kept {
    fn new(cloud: &Cloud, indices: Vec<u32>) -> Self {
        let share = indices.len() as f64 / cloud.len().max(1) as f64;
        Kept {
            cloud: cloud.selected(&indices),
            indices,
            share,
        }
    }
}

/// Keeps the share of the points that lies farthest **against** `direction` (a cut plane across it).
///
/// `share = 2/3` along `d` in one cloud and along `-d` in another leaves a mutual overlap of about one half.
pub fn crop_half_space(cloud: &Cloud, direction: DVec3, share: f64) -> Kept {
    let mut order: Vec<u32> = (0..cloud.len() as u32).collect();
    let key = |i: &u32| cloud.points[*i as usize].dot(direction);
    order.sort_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let count = ((share * cloud.len() as f64).round() as usize).min(cloud.len());
    let mut kept = order[..count].to_vec();
    kept.sort_unstable();
    Kept::new(cloud, kept)
}

/// Cuts several times by random planes until `share` of the points is left; every cut takes about the same number.
pub fn crop_half_spaces(cloud: &Cloud, cuts: usize, share: f64, seed: u64) -> Kept {
    let mut rng = generator(seed, stream::CROP);
    let mut kept: Vec<u32> = (0..cloud.len() as u32).collect();
    for cut in 0..cuts {
        let mut normal = || -> f64 { rng.sample(StandardNormal) };
        let direction = DVec3::new(normal(), normal(), normal()).normalize_or(DVec3::X);
        let left = 1.0 - (1.0 - share) * (cut + 1) as f64 / cuts as f64;
        let wanted = (left * cloud.len() as f64).round() / kept.len().max(1) as f64;
        let part = crop_half_space(&cloud.selected(&kept), direction, wanted.min(1.0));
        kept = part.indices.iter().map(|&i| kept[i as usize]).collect();
    }
    Kept::new(cloud, kept)
}

/// Keeps the points that a scanner far away in `direction` sees: outward normal within `max_angle_deg` of the line of
/// sight, and no triangle of `mesh` in front.
///
/// # Panics
/// When the cloud has no normals.
pub fn visible_from(cloud: &Cloud, mesh: &TriangleMesh, direction: DVec3, max_angle_deg: f64) -> Kept {
    assert_eq!(
        cloud.normals.len(),
        cloud.len(),
        "visibility needs the normals of the cloud"
    );
    let d = direction.normalize();
    let screen = Screen::new(mesh, d);
    let least = max_angle_deg.to_radians().cos();
    // A sample of a smooth surface can lie behind the chord triangles of its mesh.
    let slack = 0.02 * mesh.bounds().diagonal();
    let kept = (0..cloud.len() as u32)
        .filter(|&i| cloud.normals[i as usize].dot(d) >= least)
        .filter(|&i| !screen.hidden(cloud.points[i as usize], slack))
        .collect();
    Kept::new(cloud, kept)
}

/// Removes the points within `radius` of `centre`: a missing part.
pub fn remove_ball(cloud: &Cloud, centre: DVec3, radius: f64) -> Kept {
    let outside = |i: &u32| cloud.points[*i as usize].distance(centre) > radius;
    Kept::new(cloud, (0..cloud.len() as u32).filter(outside).collect())
}

/// The triangles of a mesh whose three corners satisfy `keep`, compacted: an open mesh.
pub fn crop_mesh(mesh: &TriangleMesh, keep: impl Fn(DVec3) -> bool) -> TriangleMesh {
    let inside: Vec<bool> = mesh.points.iter().map(|&p| keep(p)).collect();
    let triangles = mesh
        .triangles
        .iter()
        .filter(|t| t.iter().all(|&v| inside[v as usize]))
        .copied()
        .collect();
    TriangleMesh {
        points: mesh.points.clone(),
        triangles,
    }
    .compacted()
}

/// A random direction, uniform on the sphere.
pub fn random_direction(seed: u64) -> DVec3 {
    let mut rng = generator(seed, stream::CROP + 100);
    let z = 2.0 * rng.random::<f64>() - 1.0;
    let angle = std::f64::consts::TAU * rng.random::<f64>();
    let rho = (1.0 - z * z).sqrt();
    DVec3::new(rho * angle.cos(), rho * angle.sin(), z)
}

/// Triangles binned in the plane across the line of sight.
struct Screen<'a> {
    mesh: &'a TriangleMesh,
    axes: [DVec3; 3],
    min: [f64; 2],
    inverse_cell: f64,
    size: [usize; 2],
    bins: Vec<Vec<u32>>,
}

impl<'a> Screen<'a> {
    fn new(mesh: &'a TriangleMesh, d: DVec3) -> Self {
        let (u, v) = d.any_orthonormal_pair();
        let flat: Vec<[f64; 2]> = mesh.points.iter().map(|p| [p.dot(u), p.dot(v)]).collect();
        let low = |k: usize| flat.iter().map(|q| q[k]).fold(f64::INFINITY, f64::min);
        let high = |k: usize| flat.iter().map(|q| q[k]).fold(f64::NEG_INFINITY, f64::max);
        let min = [low(0), low(1)];
        let cell = mesh.mean_edge_length().max(1e-12);
        let bin_count = |k: usize| ((high(k) - min[k]) / cell) as usize + 1;
        let size = [bin_count(0), bin_count(1)];
        let mut screen = Screen {
            mesh,
            axes: [u, v, d],
            min,
            inverse_cell: 1.0 / cell,
            size,
            bins: vec![Vec::new(); size[0] * size[1]],
        };
        for (t, tri) in mesh.triangles.iter().enumerate() {
            let corners = tri.map(|w| flat[w as usize]);
            let range = |k: usize| {
                let least = corners.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min);
                let most = corners.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max);
                (screen.bin(k, least), screen.bin(k, most))
            };
            let ((i0, i1), (j0, j1)) = (range(0), range(1));
            for j in j0..=j1 {
                for i in i0..=i1 {
                    screen.bins[j * size[0] + i].push(t as u32);
                }
            }
        }
        screen
    }

    fn bin(&self, axis: usize, x: f64) -> usize {
        (((x - self.min[axis]) * self.inverse_cell).max(0.0) as usize).min(self.size[axis] - 1)
    }

    /// Whether a triangle covers `p` more than `slack` mm in front of it.
    fn hidden(&self, p: DVec3, slack: f64) -> bool {
        let [u, v, d] = self.axes;
        let q = [p.dot(u), p.dot(v)];
        let bin = self.bin(1, q[1]) * self.size[0] + self.bin(0, q[0]);
        self.bins[bin].iter().any(|&t| {
            let [a, b, c] = self.mesh.corners(t as usize);
            let side = |s: DVec3, e: DVec3| {
                (e.dot(u) - s.dot(u)) * (q[1] - s.dot(v)) - (e.dot(v) - s.dot(v)) * (q[0] - s.dot(u))
            };
            let (wa, wb, wc) = (side(b, c), side(c, a), side(a, b));
            let covers = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
            let sum = wa + wb + wc;
            covers && sum != 0.0 && (wa * a.dot(d) + wb * b.dot(d) + wc * c.dot(d)) / sum > p.dot(d) + slack
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{sample_uniform, shapes};

    #[test]
    fn crops_keep_what_they_say() {
        let shape = shapes::sphere(1.0);
        let mesh = shape.mesh(5_000);
        let cloud = sample_uniform(&mesh, 6_000, 1);
        let (a, b) = (
            crop_half_space(&cloud, DVec3::Z, 2.0 / 3.0),
            crop_half_space(&cloud, -DVec3::Z, 2.0 / 3.0),
        );
        assert_eq!(a.indices.len(), 4_000);
        // On the sphere area is uniform in z: the cuts are at z = 1/3 and -1/3.
        assert!(a.cloud.points.iter().all(|p| p.z < 1.0 / 3.0 + 0.05));
        let both = a
            .indices
            .iter()
            .filter(|i| b.indices.binary_search(i).is_ok())
            .count();
        assert_eq!(both, 2_000);
        let several = crop_half_spaces(&cloud, 3, 0.4, 5);
        assert!((several.share - 0.4).abs() < 1e-3);
        assert_eq!(several, crop_half_spaces(&cloud, 3, 0.4, 5));
        let without = remove_ball(&cloud, DVec3::Z, 0.5);
        // A cap of chord c has area pi c^2.
        assert!((1.0 - without.share - 0.25 / 4.0).abs() < 0.01);
    }

    #[test]
    fn a_scanner_sees_one_side_and_shadows() {
        let ball = shapes::sphere(1.0).mesh(5_000);
        let cloud = sample_uniform(&ball, 5_000, 1);
        let seen = visible_from(&cloud, &ball, DVec3::X, 90.0);
        assert!((seen.share - 0.5).abs() < 0.02, "{}", seen.share);
        // A second ball in front hides everything behind its silhouette.
        let mut two = ball.clone();
        two.append(&ball.mapped(|p| p + 4.0 * DVec3::X));
        let shadowed = visible_from(&cloud, &two, DVec3::X, 90.0);
        assert!(shadowed.share < 0.02, "{}", shadowed.share);
        let open = crop_mesh(&ball, |p| p.x > 0.0);
        assert_eq!(open.topology().boundary_loops, 1);
    }
}
