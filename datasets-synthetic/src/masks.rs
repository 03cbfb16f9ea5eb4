//! Label masks with known truth: shapes and meshes on any voxel grid.
//!
//! **The voxel rule.** A voxel carries a label when its **centre** lies inside the solid. No partial volumes: a sphere of 16 voxels diameter
//! therefore has a staircase, and its voxel volume differs from the true one by a random-looking error of order `area^(1/2) voxel^(5/2)`; the truth kept beside a mask is
//! the true volume, not the count.
//!
//! A [`VoxelGrid`] maps voxel indices to LPS millimetres by `origin + direction (spacing * index)`: any anisotropy, any orientation. Masks are stored
//! with x fastest, as NIfTI does ([`crate::nifti`]).

use crate::implicit::Field;
use crate::mesh::{Bounds, TriangleMesh};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Where the voxels are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VoxelGrid {
    /// Voxels along each index.
    pub size: [usize; 3],
    /// Distance of neighbouring centres along each index, mm.
    pub spacing_mm: DVec3,
    /// Centre of voxel (0, 0, 0), LPS mm.
    pub origin_mm: DVec3,
    /// Orthonormal; columns are the directions of the indices in LPS.
    pub direction: DMat3,
}

/// Labels on a grid; 0 is background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelMask {
    /// Where the voxels are.
    pub grid: VoxelGrid,
    /// One label a voxel, x fastest, then y, then z.
    pub labels: Vec<u16>,
}

impl VoxelGrid {
    /// Axis-aligned grid of that spacing around a box, with `margin` voxels of air on every side. Voxel centres
    /// are at half-integer multiples of the spacing from the box's least corner.
    pub fn around(bounds: &Bounds, spacing_mm: DVec3, margin: usize) -> Self {
        let m = margin as f64;
        let count = (bounds.size() / spacing_mm).ceil();
        VoxelGrid {
            size: count.to_array().map(|c| c as usize + 2 * margin),
            spacing_mm,
            origin_mm: bounds.min + (0.5 - m) * spacing_mm,
            direction: DMat3::IDENTITY,
        }
    }

    /// The grid turned by `rotation` about its own centre: an oblique acquisition.
    pub fn turned(&self, rotation: DMat3) -> Self {
        let middle = DVec3::from_array(self.size.map(|n| 0.5 * (n as f64 - 1.0)));
        let centre = self.centre(middle);
        let direction = rotation * self.direction;
        VoxelGrid {
            origin_mm: centre - direction * (self.spacing_mm * middle),
            direction,
            ..*self
        }
    }

    /// Position of a (fractional) voxel index, LPS mm.
    pub fn centre(&self, index: DVec3) -> DVec3 {
        self.origin_mm + self.direction * (self.spacing_mm * index)
    }

    /// Volume of one voxel, mm^3.
    pub fn voxel_volume(&self) -> f64 {
        self.spacing_mm.x * self.spacing_mm.y * self.spacing_mm.z
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Whether the grid has no voxels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn position(&self, id: usize) -> DVec3 {
        let [nx, ny, _] = self.size;
        self.centre(DVec3::new(
            (id % nx) as f64,
            (id / nx % ny) as f64,
            (id / (nx * ny)) as f64,
        ))
    }
}

impl LabelMask {
    /// A mask without labels.
    pub fn empty(grid: VoxelGrid) -> Self {
        LabelMask {
            grid,
            labels: vec![0; grid.len()],
        }
    }

    /// Voxels that carry `label`.
    pub fn count(&self, label: u16) -> usize {
        self.labels.iter().filter(|&&l| l == label).count()
    }

    /// Volume of a label by counting voxels, mm^3.
    pub fn volume_mm3(&self, label: u16) -> f64 {
        self.count(label) as f64 * self.grid.voxel_volume()
    }

    /// Puts `label` wherever the centre of a voxel lies inside `field`; later calls win. O(voxels).
    pub fn fill(&mut self, field: &Field, label: u16) {
        self.fill_where(label, |p| field.value(p) < 0.0);
    }

    /// Puts `label` wherever `inside` holds at the centre of a voxel.
    pub fn fill_where(&mut self, label: u16, inside: impl Fn(DVec3) -> bool + Sync) {
        let grid = self.grid;
        self.labels.par_iter_mut().enumerate().for_each(|(id, l)| {
            if inside(grid.position(id)) {
                *l = label;
            }
        });
    }

    /// Puts `label` wherever the centre of a voxel lies inside a closed mesh (parity of crossings along the first index).
    ///
    /// Each row of voxels is a line; a triangle counts when the line passes through its projection along that line, with half-open edges (a
    /// line through an edge or a vertex counts once), so every line crosses a closed mesh an even number of times. O(triangles + rows + voxels).
    pub fn fill_mesh(&mut self, mesh: &TriangleMesh, label: u16) {
        let crossings = self.row_crossings(mesh);
        let nx = self.grid.size[0];
        for (row, mut at) in crossings.into_iter().enumerate() {
            at.sort_unstable_by(f64::total_cmp);
            for pair in at.chunks_exact(2) {
                // Centres strictly between entry and exit.
                let (first, last) = (pair[0].floor() + 1.0, pair[1].ceil() - 1.0);
                let (first, last) = (first.max(0.0), last.min(nx as f64 - 1.0));
                if first <= last {
                    self.labels[row * nx + first as usize..=row * nx + last as usize].fill(label);
                }
            }
        }
    }

    /// Where each row crosses the mesh, in voxels along the first index.
    fn row_crossings(&self, mesh: &TriangleMesh) -> Vec<Vec<f64>> {
        let [_, ny, nz] = self.grid.size;
        let back = self.grid.direction.transpose();
        let index: Vec<DVec3> = mesh
            .points
            .iter()
            .map(|&p| back * (p - self.grid.origin_mm) / self.grid.spacing_mm)
            .collect();
        let mut rows = vec![Vec::new(); ny * nz];
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| index[v as usize]);
            let clamp = |x: f64, n: usize| x.clamp(0.0, n as f64) as usize;
            let (y0, y1) = (a.y.min(b.y).min(c.y).ceil(), a.y.max(b.y).max(c.y).floor() + 1.0);
            let (z0, z1) = (a.z.min(b.z).min(c.z).ceil(), a.z.max(b.z).max(c.z).floor() + 1.0);
            for z in clamp(z0, nz)..clamp(z1, nz) {
                for y in clamp(y0, ny)..clamp(y1, ny) {
                    if let Some(x) = crossing([a, b, c], y as f64, z as f64) {
                        rows[z * ny + y].push(x);
                    }
                }
            }
        }
        rows
    }
}

/// Where the line (., y, z) crosses a triangle: winding of the projected edges, each half open in z.
fn crossing([a, b, c]: [DVec3; 3], y: f64, z: f64) -> Option<f64> {
    let mut winding = 0i32;
    for (p, q) in [(a, b), (b, c), (c, a)] {
        if (p.z <= z) != (q.z <= z) {
            // The same expression for both triangles of an edge, lower end first, so that they agree to the last bit.
            let (low, high) = if p.z <= q.z { (p, q) } else { (q, p) };
            let at = low.y + (z - low.z) / (high.z - low.z) * (high.y - low.y);
            if at > y {
                winding += if p.z <= z { 1 } else { -1 };
            }
        }
    }
    if winding == 0 {
        return None;
    }
    let normal = (b - a).cross(c - a);
    Some(a.x - ((y - a.y) * normal.y + (z - a.z) * normal.z) / normal.x)
}

/// A ball of that many voxels diameter (isotropic 1 mm voxels stretched to `spacing_mm`), its centre off the grid by an
/// irrational shift, labelled 1. The diameter is measured along the first index.
pub fn sphere_mask(diameter_vox: f64, spacing_mm: DVec3) -> LabelMask {
    let radius = 0.5 * diameter_vox * spacing_mm.x;
    let centre = spacing_mm * DVec3::new(0.217, 0.371, 0.139);
    let bounds = Bounds {
        min: centre - radius,
        max: centre + radius,
    };
    let mut mask = LabelMask::empty(VoxelGrid::around(&bounds, spacing_mm, 2));
    // The grid starts at the ball's own corner: shift the ball instead, so that no symmetry is left.
    let shifted = centre + 0.31 * spacing_mm * DVec3::new(0.5, -0.7, 0.3);
    mask.fill(
        &Field::Ball {
            centre: shifted,
            radius,
        },
        1,
    );
    mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bones, rigid, shapes};

    #[test]
    fn counts_tend_to_the_volume() {
        for (diameter, tolerance) in [
            (4.0, 0.12),
            (8.0, 0.05),
            (16.0, 0.02),
            (32.0, 0.006),
            (64.0, 0.002),
        ] {
            for spacing in [DVec3::ONE, DVec3::new(0.7, 0.7, 0.7)] {
                let mask = sphere_mask(diameter, spacing);
                let truth = std::f64::consts::PI / 6.0 * (diameter * spacing.x).powi(3);
                let error = mask.volume_mm3(1) / truth - 1.0;
                assert!(error.abs() < tolerance, "{diameter} voxels: {error}");
            }
        }
        let anisotropic = sphere_mask(40.0, DVec3::new(1.0, 1.0, 5.0));
        let truth = std::f64::consts::PI / 6.0 * 64_000.0;
        assert!((anisotropic.volume_mm3(1) / truth - 1.0).abs() < 0.01);
    }

    /// The two ways of filling agree on every voxel whose centre is not within the chord error of the surface.
    #[test]
    fn mesh_and_field_fill_the_same_voxels() {
        for shape in [
            shapes::hollow_sphere(6.0, 3.0),
            bones::hamate_like(0),
            shapes::l_block(9.0, 4.0, 3.0),
        ] {
            let mesh = shape.mesh(20_000);
            let field = shape.field().expect("a solid");
            let grid = VoxelGrid::around(&shape.bounds(), DVec3::new(0.4, 0.5, 0.7), 2);
            for grid in [grid, grid.turned(rigid::random_rotation(3))] {
                let (mut by_field, mut by_mesh) = (LabelMask::empty(grid), LabelMask::empty(grid));
                by_field.fill(field, 3);
                by_mesh.fill_mesh(&mesh, 3);
                let wrong = (0..grid.len())
                    .filter(|&i| by_field.labels[i] != by_mesh.labels[i])
                    .filter(|&i| field.value(grid.position(i)).abs() > 0.02)
                    .count();
                assert_eq!(wrong, 0, "{}", shape.name);
                let share = by_mesh.volume_mm3(3) / mesh.volume();
                // Faces parallel to the grid gain or lose a layer of voxels.
                let layer = if shape.name == "l_block" { 0.12 } else { 0.02 };
                assert!((share - 1.0).abs() < layer, "{}: {share}", shape.name);
            }
        }
    }

    #[test]
    fn lines_through_vertices_and_edges_count_once() {
        // Integer coordinates: every row passes through vertices and edges.
        let mesh = shapes::box_shape(6.0, 4.0, 8.0).mesh(400);
        let grid = VoxelGrid {
            size: [16, 12, 14],
            spacing_mm: DVec3::ONE,
            origin_mm: DVec3::new(-7.5, -6.0, -7.0),
            direction: DMat3::IDENTITY,
        };
        let mut mask = LabelMask::empty(grid);
        mask.fill_mesh(&mesh, 1);
        // Centres at -2.5 .. 2.5 along x; along y and z the faces themselves count on one side only.
        assert_eq!(mask.count(1), 6 * 4 * 8);
    }
}
