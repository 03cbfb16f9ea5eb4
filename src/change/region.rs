//! A lesion at one date: its voxels (when it comes from a mask) and its surfaces.
//!
//! In: a shape. Out: [`Region`]s, one a label, component or mesh. A mask gives two surfaces: plain marching cubes on the
//! binary mask (the definition of the Image Biomarker Standardisation Initiative, Zwanenburg et al. 2020) and a smooth one for
//! distances and growth: the mask blurred by a Gaussian, marching cubes with interpolation, then moved along its normals until
//! it encloses the volume of the counted voxels (blurring alone shrinks what is curved). A lesion of one or two voxels has no
//! smooth surface; the plain one is used instead and the region says so. Surfaces are closed and outward.

use super::marching_cubes::{Field, marching_cubes};
use super::{ChangeError, ChangeSettings, Pairing};
use crate::geometry::TriangleMesh;
use crate::input::shape::{Geometry, LabelMap, Shape};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Voxels of one lesion, cropped to their box.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Voxels along i, j, k.
    pub dims: [usize; 3],
    /// Whether each voxel belongs to the lesion; order as in [`LabelMap`].
    pub values: Vec<bool>,
    /// Voxel size, mm.
    pub spacing_mm: DVec3,
    /// Centre of voxel (0, 0, 0) of the crop, LPS mm.
    pub origin: DVec3,
    /// Unit directions of i, j, k as columns.
    pub direction: DMat3,
}

impl Mask {
    /// LPS mm position of (fractional) voxel indices of the crop.
    pub fn position(&self, index_vox: DVec3) -> DVec3 {
        self.origin + self.direction * (self.spacing_mm * index_vox)
    }

    /// Voxel indices, fractional, of a position.
    pub fn index(&self, position: DVec3) -> DVec3 {
        self.direction.inverse() * (position - self.origin) / self.spacing_mm
    }

    /// Volume of a voxel, mm^3.
    pub fn voxel_volume_mm3(&self) -> f64 {
        (self.spacing_mm.x * self.spacing_mm.y * self.spacing_mm.z * self.direction.determinant()).abs()
    }

    /// Whether the voxel belongs to the lesion; voxels beyond the crop do not.
    pub fn is_set(&self, i: i64, j: i64, k: i64) -> bool {
        let [nx, ny, nz] = self.dims.map(|n| n as i64);
        (0..nx).contains(&i)
            && (0..ny).contains(&j)
            && (0..nz).contains(&k)
            && self.values[(i + nx * (j + ny * k)) as usize]
    }

    /// Whether the voxel that holds a position belongs to the lesion.
    pub fn contains(&self, position: DVec3) -> bool {
        let v = self.index(position).round();
        self.is_set(v.x as i64, v.y as i64, v.z as i64)
    }

    /// Indices of the lesion's voxels.
    pub fn voxels(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let [nx, ny, _] = self.dims;
        let set = self.values.iter().enumerate().filter(|(_, v)| **v);
        set.map(move |(n, _)| [n % nx, n / nx % ny, n / nx / ny])
    }

    /// Number of voxels.
    pub fn count(&self) -> usize {
        self.values.iter().filter(|v| **v).count()
    }

    /// The voxels of a map for which `keep` holds, cropped; `None` when there are none.
    fn crop(map: &LabelMap, keep: impl Fn(usize) -> bool) -> Option<Mask> {
        let [nx, ny, nz] = map.dims;
        let (mut lo, mut hi) = ([usize::MAX; 3], [0; 3]);
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    if keep(i + nx * (j + ny * k)) {
                        for (axis, x) in [i, j, k].into_iter().enumerate() {
                            lo[axis] = lo[axis].min(x);
                            hi[axis] = hi[axis].max(x);
                        }
                    }
                }
            }
        }
        if lo[0] == usize::MAX {
            return None;
        }
        let dims: [usize; 3] = std::array::from_fn(|a| hi[a] - lo[a] + 1);
        let mut values = Vec::with_capacity(dims.iter().product());
        for k in lo[2]..=hi[2] {
            for j in lo[1]..=hi[1] {
                values.extend((lo[0]..=hi[0]).map(|i| keep(i + nx * (j + ny * k))));
            }
        }
        let shift = DVec3::new(lo[0] as f64, lo[1] as f64, lo[2] as f64);
        Some(Mask {
            dims,
            values,
            spacing_mm: map.spacing_mm,
            origin: map.position(shift),
            direction: map.direction,
        })
    }

    /// The union of two masks of one grid.
    fn union(&self, other: &Mask) -> Mask {
        let far =
            |m: &Mask| m.position(DVec3::new(m.dims[0] as f64, m.dims[1] as f64, m.dims[2] as f64) - 1.0);
        let corner = |p: DVec3| self.index(p).round();
        let lo = corner(other.origin).min(DVec3::ZERO);
        let hi = corner(far(other)).max(corner(far(self)));
        let dims = (hi - lo + 1.0).to_array().map(|x| x as usize);
        let mut out = Mask {
            dims,
            values: vec![false; dims.iter().product()],
            origin: self.position(lo),
            ..self.clone()
        };
        for part in [self, other] {
            let shift = out.index(part.origin).round().to_array().map(|x| x as usize);
            for v in part.voxels() {
                let [i, j, k]: [usize; 3] = std::array::from_fn(|a| v[a] + shift[a]);
                out.values[i + dims[0] * (j + dims[1] * k)] = true;
            }
        }
        out
    }

    fn to_world(&self, mut mesh: TriangleMesh) -> TriangleMesh {
        for p in &mut mesh.points {
            *p = self.position(*p);
        }
        if self.direction.determinant() < 0.0 {
            mesh.flip();
        }
        mesh
    }

    /// Marching cubes at 0.5 on the binary mask, LPS mm.
    pub fn plain_surface(&self) -> TriangleMesh {
        let values = self.values.iter().map(|v| f32::from(u8::from(*v))).collect();
        let field = Field {
            dims: self.dims,
            values,
        };
        self.to_world(marching_cubes(&field))
    }

    /// The smooth surface, LPS mm, with the volume of the counted voxels; `None` when the lesion is too small or thin for the
    /// kernel: the blurred surface lost half the volume or had to be moved by more than half a voxel.
    pub fn smooth_surface(&self, sigma_vox: f64) -> Option<TriangleMesh> {
        let mut mesh = self.blurred_surface(sigma_vox);
        let volume = self.count() as f64 * self.voxel_volume_mm3();
        if mesh.signed_volume() < 0.5 * volume {
            return None;
        }
        let mut moved = 0.0;
        // The volume is a cubic in the displacement; Newton's steps along it converge to rounding in three.
        for _ in 0..4 {
            let step = (volume - mesh.signed_volume()) / mesh.area();
            moved += step;
            let normals = mesh.vertex_normals();
            for (p, n) in mesh.points.iter_mut().zip(normals) {
                *p += step * n;
            }
        }
        (moved.abs() <= 0.5 * self.voxel_volume_mm3().cbrt()).then_some(mesh)
    }

    /// The smooth surface at the widest of three kernels that keeps every part of the lesion; a thin lobe that the kernel wipes out
    /// would be shown as a change though both masks have it.
    fn surface_of_every_part(&self, sigma_vox: f64) -> Option<TriangleMesh> {
        [1.0, 0.75, 0.5]
            .into_iter()
            .map(|share| share * sigma_vox)
            .find(|&sigma| self.keeps_every_part(sigma))
            .and_then(|sigma| self.smooth_surface(sigma))
    }

    /// Whether every voxel has one within [`LOST_VOX`] that is inside the blurred surface.
    fn keeps_every_part(&self, sigma_vox: f64) -> bool {
        let (field, pad) = self.blurred(sigma_vox);
        let [nx, ny, _] = field.dims;
        let inside = |[i, j, k]: [usize; 3]| field.values[i + nx * (j + ny * k)] >= 0.5;
        let reach = || 0..=2 * LOST_VOX;
        self.voxels().all(|v| {
            let v = v.map(|x| x + pad);
            inside(v)
                || reach().any(|k| {
                    reach().any(|j| {
                        reach()
                            .any(|i| inside([v[0] + i - LOST_VOX, v[1] + j - LOST_VOX, v[2] + k - LOST_VOX]))
                    })
                })
        })
    }

    fn blurred_surface(&self, sigma_vox: f64) -> TriangleMesh {
        let (field, pad) = self.blurred(sigma_vox);
        let mut mesh = marching_cubes(&field);
        for p in &mut mesh.points {
            *p -= DVec3::splat(pad as f64);
        }
        self.to_world(mesh)
    }

    /// The blurred mask, and how many voxels wider its grid is on each side.
    fn blurred(&self, sigma_vox: f64) -> (Field, usize) {
        let pad = ((4.0 * sigma_vox).ceil() as usize + 1).max(LOST_VOX);
        let [nx, ny, _] = self.dims;
        let dims = self.dims.map(|n| n + 2 * pad);
        let mut values = vec![0f32; dims.iter().product()];
        for (n, _) in self.values.iter().enumerate().filter(|(_, v)| **v) {
            let (i, j, k) = (n % nx + pad, n / nx % ny + pad, n / nx / ny + pad);
            values[i + dims[0] * (j + dims[1] * k)] = 1.0;
        }
        let values = gaussian(&values, dims, sigma_vox);
        (Field { dims, values }, pad)
    }
}

/// A part is lost when its voxels lie farther than this from the blurred surface's inside, along an axis: tips are rounded by less.
const LOST_VOX: usize = 2;

/// Separable Gaussian filter; values beyond the grid are 0.
fn gaussian(values: &[f32], dims: [usize; 3], sigma_vox: f64) -> Vec<f32> {
    let reach = (4.0 * sigma_vox).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|x| (-0.5 * (x as f64 / sigma_vox).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let weights: Vec<f32> = weights.iter().map(|w| (w / sum) as f32).collect();
    let strides = [1, dims[0], dims[0] * dims[1]];
    let mut from = values.to_vec();
    let mut to = vec![0f32; values.len()];
    for axis in 0..3 {
        let (n, stride) = (dims[axis] as i64, strides[axis]);
        for (v, out) in to.iter_mut().enumerate() {
            let x = (v / stride % dims[axis]) as i64;
            let mut total = 0.0;
            for d in (-reach).max(-x)..=reach.min(n - 1 - x) {
                let at = (v as i64 + d * stride as i64) as usize;
                total += weights[(d + reach) as usize] * from[at];
            }
            *out = total;
        }
        std::mem::swap(&mut from, &mut to);
    }
    from
}

/// Which surface serves for distances and growth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SurfaceKind {
    /// The smoothed mask.
    Smooth,
    /// Plain marching cubes: the lesion is too small or thin to be smoothed.
    Plain,
    /// The mesh as given.
    Mesh,
}

/// A lesion at one date.
#[derive(Clone, Debug)]
pub struct Region {
    /// Label in the file, or the number of the component; 1 for a mesh.
    pub label: i32,
    /// Voxels; `None` for a mesh.
    pub mask: Option<Mask>,
    /// The surface that mesh volume and area are defined on.
    pub plain: TriangleMesh,
    /// The surface for distances and growth.
    pub surface: TriangleMesh,
    /// What `surface` is.
    pub surface_kind: SurfaceKind,
}

impl Region {
    fn from_mask(label: i32, mask: Mask, settings: &ChangeSettings) -> Region {
        let plain = mask.plain_surface();
        let (surface, surface_kind) = match mask.surface_of_every_part(settings.smoothing_vox) {
            Some(smooth) => (smooth, SurfaceKind::Smooth),
            None => (plain.clone(), SurfaceKind::Plain),
        };
        Region {
            label,
            mask: Some(mask),
            plain,
            surface,
            surface_kind,
        }
    }

    /// One region for lesions of the same date, e.g. the pieces of a lesion that split. Masks must be of one grid.
    pub(super) fn union(parts: &[&Region], settings: &ChangeSettings) -> Region {
        let label = parts.iter().map(|r| r.label).min().unwrap_or(0);
        let mut masks = parts.iter().filter_map(|r| r.mask.as_ref());
        match (parts, masks.next()) {
            ([one], _) => (*one).clone(),
            (_, Some(first)) => {
                let mask = masks.fold(first.clone(), |a, b| a.union(b));
                Region::from_mask(label, mask, settings)
            }
            (_, None) => {
                let mut surface = TriangleMesh::default();
                for r in parts {
                    let base = surface.points.len() as u32;
                    surface.points.extend_from_slice(&r.surface.points);
                    let moved = r.surface.triangles.iter().map(|t| t.map(|i| i + base));
                    surface.triangles.extend(moved);
                }
                Region {
                    label,
                    mask: None,
                    plain: surface.clone(),
                    surface,
                    surface_kind: SurfaceKind::Mesh,
                }
            }
        }
    }
}

/// The lesions of a shape, by ascending label.
///
/// # Errors
/// A cloud, an open or unoriented mesh, a map without the wanted label or without any.
pub fn regions(shape: &Shape, settings: &ChangeSettings) -> Result<Vec<Region>, ChangeError> {
    match &shape.geometry {
        Geometry::Cloud(_) => Err(ChangeError::NotSolid {
            name: shape.name.clone(),
        }),
        Geometry::Mesh(mesh) => mesh_regions(&shape.name, mesh, settings),
        Geometry::Labels(map) => label_regions(&shape.name, map, settings),
    }
}

fn mesh_regions(
    name: &str,
    mesh: &TriangleMesh,
    settings: &ChangeSettings,
) -> Result<Vec<Region>, ChangeError> {
    let topology = mesh.topology();
    if !topology.watertight || !topology.oriented {
        return Err(ChangeError::OpenMesh {
            name: name.to_owned(),
            boundary_edges: topology.boundary_edges,
            nonmanifold_edges: topology.nonmanifold_edges,
            oriented: topology.oriented,
        });
    }
    let mut mesh = mesh.clone();
    if mesh.signed_volume() < 0.0 {
        mesh.flip();
    }
    let parts: Vec<TriangleMesh> = match settings.pairing {
        Pairing::Label => vec![mesh],
        Pairing::Overlap => mesh.components().iter().map(|c| mesh.submesh(c)).collect(),
    };
    let region = |(i, surface): (usize, TriangleMesh)| Region {
        label: i as i32 + 1,
        mask: None,
        plain: surface.clone(),
        surface,
        surface_kind: SurfaceKind::Mesh,
    };
    Ok(parts.into_iter().enumerate().map(region).collect())
}

fn label_regions(name: &str, map: &LabelMap, settings: &ChangeSettings) -> Result<Vec<Region>, ChangeError> {
    let mut labels: Vec<i32> = map.label_counts().into_iter().map(|c| c.label).collect();
    labels.retain(|l| !settings.ignored_labels.contains(l));
    if labels.is_empty() {
        return Err(ChangeError::Empty {
            name: name.to_owned(),
        });
    }
    if let Some(wanted) = settings.label {
        if !labels.contains(&wanted) {
            return Err(ChangeError::NoLabel {
                name: name.to_owned(),
                label: wanted,
                found: labels,
            });
        }
        labels = vec![wanted];
    }
    if settings.pairing == Pairing::Label {
        let mask = |l: &i32| Some((*l, Mask::crop(map, |v| map.values[v] == *l)?));
        let masks: Vec<(i32, Mask)> = labels.iter().filter_map(mask).collect();
        return Ok(masks
            .into_iter()
            .map(|(l, m)| Region::from_mask(l, m, settings))
            .collect());
    }
    let ids = components(map, |v| labels.contains(&v));
    let count = ids.iter().copied().max().unwrap_or(0);
    let regions = (1..=count).filter_map(|c| {
        let mask = Mask::crop(map, |v| ids[v] == c)?;
        (mask.count() >= settings.least_voxels).then(|| Region::from_mask(c as i32, mask, settings))
    });
    Ok(regions.collect())
}

/// Components by 26-neighbourhood, numbered from 1 in order of their first voxel; 0 elsewhere.
fn components(map: &LabelMap, keep: impl Fn(i32) -> bool) -> Vec<u32> {
    let [nx, ny, nz] = map.dims.map(|n| n as i64);
    let mut ids = vec![0u32; map.values.len()];
    let mut count = 0;
    for start in 0..map.values.len() {
        if ids[start] != 0 || !keep(map.values[start]) {
            continue;
        }
        count += 1;
        ids[start] = count;
        let mut stack = vec![start as i64];
        while let Some(v) = stack.pop() {
            let (i, j, k) = (v % nx, v / nx % ny, v / nx / ny);
            for n in 0..27 {
                let (a, b, c) = (i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1);
                if a < 0 || b < 0 || c < 0 || a >= nx || b >= ny || c >= nz {
                    continue;
                }
                let w = a + nx * (b + ny * c);
                if ids[w as usize] == 0 && keep(map.values[w as usize]) {
                    ids[w as usize] = count;
                    stack.push(w);
                }
            }
        }
    }
    ids
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    /// A lobe two voxels across on a ball is wiped out by the wide kernel; the surface must still show it.
    #[test]
    fn a_thin_lobe_is_not_lost_to_smoothing() {
        let dims = [24, 24, 40];
        let mut values = vec![false; dims.iter().product()];
        for k in 0..dims[2] {
            for j in 0..dims[1] {
                for i in 0..dims[0] {
                    let ball = DVec3::new(i as f64, j as f64, k as f64).distance(DVec3::splat(11.5)) < 9.0;
                    let lobe = (11..13).contains(&i) && (11..13).contains(&j) && (12..32).contains(&k);
                    values[i + dims[0] * (j + dims[1] * k)] = ball || lobe;
                }
            }
        }
        let mask = Mask {
            dims,
            values,
            spacing_mm: DVec3::ONE,
            origin: DVec3::ZERO,
            direction: DMat3::IDENTITY,
        };
        let top = |mesh: &TriangleMesh| mesh.points.iter().map(|p| p.z).fold(f64::MIN, f64::max);
        let wide = mask.smooth_surface(1.2).expect("the ball is large");
        assert!(top(&wide) < 26.0, "{}", top(&wide));
        let region = Region::from_mask(1, mask, &ChangeSettings::default());
        assert!(top(&region.surface) > 29.0, "{}", top(&region.surface));
    }
}
