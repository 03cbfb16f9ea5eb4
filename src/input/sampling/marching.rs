//! The closed surface of a label: marching cubes that is a 2-manifold always.
//!
//! In: a label map. Out: a closed, outward oriented mesh in LPS mm through the middle of every grid edge that joins a voxel of
//! the label to one without (iso 1/2 of the binary mask). The grid is padded by one voxel, so that a structure that reaches
//! the edge of the image is closed there, and this is said.
//!
//! 1. In each cube of eight voxel centres the surface meets each face in segments. On a face whose diagonal corners agree
//!    (the ambiguous case) the voxels of the label are joined, so that thin oblique structures stay in one piece. Both cubes
//!    of a face decide alike, so the surface closes.
//! 2. The segments of a cube form rings; the rings are cut into triangles. A cut between two points of one face is not allowed
//!    unless it is a segment: the cube beyond could make the same cut and four triangles would meet there, the one way in which
//!    the classic tables give edges that are not manifold. Of the cuts allowed that is taken which encloses most, or least
//!    where more than half of the corners are inside: so neither convex nor hollow places are favoured, and the volumes are
//!    those of PyRadiomics' tables. Where no cut is left the ring gets a point in its middle.
//! 3. Rings are made for the 256 cases once, from rule 1, not copied from a table.
//!
//! Lorensen & Cline 1987; Duerst 1988 on the ambiguous faces. We keep our own because the crates give soups in `f32`
//! (mcubes, isosurface) or surfaces that touch themselves (surface nets). Cost `O(voxels of the label's box)`; memory two
//! slices of the box and the mesh.

use super::{SamplingError, smoothing};
use crate::{geometry::TriangleMesh, input::shape::LabelMap};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Which surface of a label map is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(default)]
pub struct LabelSurfaceSettings {
    /// The label; `None` takes all labels as one solid.
    pub label: Option<i32>,
    /// Smoothing passes; 0 gives the plain marching-cubes surface.
    pub smoothing_passes: u32,
}

/// The surface of a label.
#[derive(Clone, Debug, Default)]
pub struct LabelSurface {
    /// Closed, outward oriented, LPS mm.
    pub mesh: TriangleMesh,
    /// Voxels of the label.
    pub voxels: u64,
    /// The label reaches the edge of the image, where its surface was closed.
    pub touches_border: bool,
    /// Volume within the surface before smoothing, mm^3.
    pub volume_before_mm3: f64,
    /// Volume within the surface, mm^3.
    pub volume_mm3: f64,
    /// Farthest that smoothing moved a point along one axis, voxels.
    pub largest_move_vox: f64,
}

impl LabelSurface {
    /// What was done, in plain words.
    pub fn remarks(&self) -> Vec<String> {
        let mut out = vec![format!(
            "the surface of {} voxels has {} triangles",
            self.voxels,
            self.mesh.triangles.len()
        )];
        if self.touches_border {
            out.push("the structure reaches the edge of the image: its surface was closed there".into());
        }
        if self.largest_move_vox > 0.0 {
            out.push(format!(
                "voxel stairs were smoothed by at most {:.2} voxels, which changed the volume by {:+.2} %",
                self.largest_move_vox,
                100.0 * (self.volume_mm3 / self.volume_before_mm3 - 1.0)
            ));
        }
        out
    }
}

/// The closed surface of a label, or of all labels as one solid.
///
/// # Errors
/// [`SamplingError::NoLabel`] or [`SamplingError::NoLabels`] when there is no such voxel.
pub fn label_surface(map: &LabelMap, settings: &LabelSurfaceSettings) -> Result<LabelSurface, SamplingError> {
    let grid = Grid::crop(map, settings.label).ok_or(match settings.label {
        Some(label) => SamplingError::NoLabel { label },
        None => SamplingError::NoLabels,
    })?;
    let mut mesh = grid.surface();
    let plain = mesh.points.clone();
    let to_lps = |mesh: &TriangleMesh| TriangleMesh {
        points: mesh.points.iter().map(|&p| map.position(p)).collect(),
        triangles: mesh.triangles.clone(),
    };
    let mirrored = map.direction.determinant() < 0.0;
    let outward = |mut mesh: TriangleMesh| {
        if mirrored {
            mesh.flip();
        }
        mesh
    };
    let volume_before_mm3 = outward(to_lps(&mesh)).signed_volume();
    smoothing::smooth(&mut mesh, settings.smoothing_passes);
    let largest_move_vox = plain
        .iter()
        .zip(&mesh.points)
        .map(|(a, b)| (*a - *b).abs().max_element())
        .fold(0.0, f64::max);
    let mesh = outward(to_lps(&mesh));
    Ok(LabelSurface {
        volume_mm3: mesh.signed_volume(),
        mesh,
        voxels: grid.voxels,
        touches_border: grid.touches_border,
        volume_before_mm3,
        largest_move_vox,
    })
}

/// The label's bounding box, padded by one voxel.
struct Grid {
    /// Voxel of the map at (0, 0, 0) of the box; -1 when the pad lies outside the image.
    corner: [i64; 3],
    dims: [usize; 3],
    inside: Vec<bool>,
    voxels: u64,
    touches_border: bool,
}

impl Grid {
    fn crop(map: &LabelMap, label: Option<i32>) -> Option<Self> {
        let wanted = |v: i32| label.map_or(v != 0, |l| v == l);
        let [nx, ny, nz] = map.dims;
        let (mut lo, mut hi) = ([usize::MAX; 3], [0usize; 3]);
        let mut voxels = 0u64;
        for (row, values) in map.values.chunks_exact(nx).enumerate() {
            let Some(first) = values.iter().position(|&v| wanted(v)) else {
                continue;
            };
            let last = values.iter().rposition(|&v| wanted(v)).unwrap_or(first);
            voxels += values[first..=last].iter().filter(|&&v| wanted(v)).count() as u64;
            for (axis, (a, b)) in [(first, last), (row % ny, row % ny), (row / ny, row / ny)]
                .into_iter()
                .enumerate()
            {
                lo[axis] = lo[axis].min(a);
                hi[axis] = hi[axis].max(b);
            }
        }
        if voxels == 0 {
            return None;
        }
        let dims = [0, 1, 2].map(|a| hi[a] - lo[a] + 3);
        let mut inside = vec![false; dims.iter().product()];
        for k in lo[2]..=hi[2] {
            for j in lo[1]..=hi[1] {
                let from = nx * (j + ny * k);
                let to = 1 + dims[0] * ((j - lo[1] + 1) + dims[1] * (k - lo[2] + 1));
                for i in lo[0]..=hi[0] {
                    inside[to + i - lo[0]] = wanted(map.values[from + i]);
                }
            }
        }
        Some(Self {
            corner: lo.map(|l| l as i64 - 1),
            dims,
            inside,
            voxels,
            touches_border: lo.contains(&0) || hi[0] + 1 == nx || hi[1] + 1 == ny || hi[2] + 1 == nz,
        })
    }

    /// The surface in voxel coordinates of the map, outward oriented there.
    fn surface(&self) -> TriangleMesh {
        let cases = cases();
        let [nx, ny, nz] = self.dims;
        let mut mesh = TriangleMesh::default();
        let mut edges = SliceEdges::new(nx * ny);
        for k in 0..nz - 1 {
            for j in 0..ny - 1 {
                for i in 0..nx - 1 {
                    let case = (0..8).fold(0, |m, c| m | usize::from(self.at(i, j, k, c)) << c);
                    for ring in &cases[case] {
                        self.add_ring(ring, [i, j, k], &mut edges, &mut mesh);
                    }
                }
            }
            edges.advance();
        }
        mesh
    }

    fn at(&self, i: usize, j: usize, k: usize, corner: usize) -> bool {
        let [nx, ny, _] = self.dims;
        self.inside[(i + (corner & 1)) + nx * ((j + (corner >> 1 & 1)) + ny * (k + (corner >> 2)))]
    }

    fn add_ring(&self, ring: &Ring, cube: [usize; 3], edges: &mut SliceEdges, mesh: &mut TriangleMesh) {
        let base = DVec3::new(
            (self.corner[0] + cube[0] as i64) as f64,
            (self.corner[1] + cube[1] as i64) as f64,
            (self.corner[2] + cube[2] as i64) as f64,
        );
        let mut ids: Vec<u32> = ring
            .edges
            .iter()
            .map(|&e| {
                let slot = edges.slot(e, cube, self.dims[0]);
                if *slot == NONE {
                    *slot = mesh.points.len() as u32;
                    mesh.points.push(base + edge_middle(e));
                }
                *slot
            })
            .collect();
        if ring.middle {
            let mean = ids.iter().map(|&v| mesh.points[v as usize]).sum::<DVec3>() / ids.len() as f64;
            ids.push(mesh.points.len() as u32);
            mesh.points.push(mean);
        }
        mesh.triangles
            .extend(ring.triangles.iter().map(|t| t.map(|i| ids[i as usize])));
    }
}

/// No point yet.
const NONE: u32 = u32::MAX;

/// Points on the grid edges of the two slices in work: along x and y in each, along z between them.
struct SliceEdges {
    x: [Vec<u32>; 2],
    y: [Vec<u32>; 2],
    z: Vec<u32>,
}

impl SliceEdges {
    fn new(n: usize) -> Self {
        let empty = || vec![NONE; n];
        Self {
            x: [empty(), empty()],
            y: [empty(), empty()],
            z: empty(),
        }
    }

    /// The upper slice becomes the lower one.
    fn advance(&mut self) {
        for planes in [&mut self.x, &mut self.y] {
            planes.swap(0, 1);
            planes[1].fill(NONE);
        }
        self.z.fill(NONE);
    }

    fn slot(&mut self, edge: u8, [i, j, _]: [usize; 3], nx: usize) -> &mut u32 {
        let (axis, c) = edge_base(edge);
        let at = (i + (c & 1)) + nx * (j + (c >> 1 & 1));
        match axis {
            0 => &mut self.x[c >> 2][at],
            1 => &mut self.y[c >> 2][at],
            _ => &mut self.z[at],
        }
    }
}

/// A ring of a case: the cube edges it passes, cut into triangles by position in the ring; position `edges.len()` is the
/// point in the middle, when there is one.
struct Ring {
    edges: Vec<u8>,
    triangles: Vec<[u8; 3]>,
    middle: bool,
}

/// Corners are numbered `x + 2 y + 4 z`. Edge `4 axis + r` runs along an axis from the r-th corner whose bit of that axis is 0.
fn edge_base(edge: u8) -> (usize, usize) {
    let (axis, r) = (edge as usize / 4, edge as usize % 4);
    let low = r & ((1 << axis) - 1);
    let high = (r >> axis) << (axis + 1);
    (axis, low | high)
}

fn edge_between(a: usize, b: usize) -> u8 {
    let axis = (a ^ b).trailing_zeros() as usize;
    let c = a & b;
    let low = c & ((1 << axis) - 1);
    let high = (c >> (axis + 1)) << axis;
    (4 * axis + (low | high)) as u8
}

fn edge_middle(edge: u8) -> DVec3 {
    let (axis, c) = edge_base(edge);
    let mut p = DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64);
    p[axis] += 0.5;
    p
}

/// Corners of the six faces, counter-clockwise seen from outside the cube.
const FACES: [[usize; 4]; 6] = [
    [0, 4, 6, 2],
    [1, 3, 7, 5],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 5, 7, 6],
];

/// Whether two edges lie on one face.
fn share_face(a: u8, b: u8) -> bool {
    let on = |face: &[usize; 4], e: u8| (0..4).any(|i| edge_between(face[i], face[(i + 1) % 4]) == e);
    FACES.iter().any(|f| on(f, a) && on(f, b))
}

/// The rings of all 256 cases; bit `c` of a case is set when corner `c` is inside.
fn cases() -> Vec<Vec<Ring>> {
    (0..256usize)
        .map(|case| {
            // With four inside the complement has four too, and the choice is free.
            let sign = if case.count_ones() <= 4 { 1.0 } else { -1.0 };
            rings(case)
                .into_iter()
                .map(|ring| Ring::cut(ring, sign))
                .collect()
        })
        .collect()
}

/// The rings of one case as lists of cube edges, outward oriented.
fn rings(case: usize) -> Vec<Vec<u8>> {
    let inside = |c: usize| case >> c & 1 == 1;
    // On every face, counter-clockwise from outside, a run of outside corners begins where the inside is left and ends where it
    // is entered again; the segment cuts it off, from where it ends to where it begins. The face beyond sees it the other
    // way round.
    let mut next = [NONE as u8; 12];
    for face in &FACES {
        for i in 0..4 {
            let (a, b) = (face[i], face[(i + 1) % 4]);
            if inside(a) && !inside(b) {
                let mut j = (i + 1) % 4;
                while !inside(face[(j + 1) % 4]) {
                    j = (j + 1) % 4;
                }
                next[edge_between(face[j], face[(j + 1) % 4]) as usize] = edge_between(a, b);
            }
        }
    }
    let mut out = Vec::new();
    for start in 0..12u8 {
        let mut ring = Vec::new();
        let mut e = start;
        while next[e as usize] != NONE as u8 {
            ring.push(e);
            e = std::mem::replace(&mut next[e as usize], NONE as u8);
        }
        if !ring.is_empty() {
            out.push(ring);
        }
    }
    out
}

impl Ring {
    fn cut(edges: Vec<u8>, sign: f64) -> Self {
        let n = edges.len() as u8;
        match best_cut(&edges, sign, 0, n - 1) {
            Some(cut) => Self {
                edges,
                triangles: cut.triangles,
                middle: false,
            },
            None => Self {
                triangles: (0..n).map(|i| [i, (i + 1) % n, n]).collect(),
                edges,
                middle: true,
            },
        }
    }
}

/// Triangles of a part of a ring and the volume they enclose with the cube's first corner.
#[derive(Default)]
struct Cut {
    triangles: Vec<[u8; 3]>,
    volume: f64,
}

/// Of all allowed ways to cut the part of a ring between positions `a` and `b` the one that encloses most (`sign` 1) or least
/// (`sign` -1); `None` when there is none.
fn best_cut(ring: &[u8], sign: f64, a: u8, b: u8) -> Option<Cut> {
    if b - a < 2 {
        return Some(Cut::default());
    }
    let n = ring.len() as u8;
    let allowed = |i: u8, j: u8| {
        j - i == 1 || (i == 0 && j == n - 1) || !share_face(ring[i as usize], ring[j as usize])
    };
    let at = |i: u8| edge_middle(ring[i as usize]);
    let mut best: Option<Cut> = None;
    for m in a + 1..b {
        if !(allowed(a, m) && allowed(m, b)) {
            continue;
        }
        let (Some(mut cut), Some(other)) = (best_cut(ring, sign, a, m), best_cut(ring, sign, m, b)) else {
            continue;
        };
        cut.triangles.extend(other.triangles);
        cut.triangles.push([a, m, b]);
        cut.volume += other.volume + sign * at(a).dot(at(m).cross(at(b))) / 6.0;
        if best.as_ref().is_none_or(|known| cut.volume > known.volume) {
            best = Some(cut);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn map(dims: [usize; 3], inside: impl Fn(usize, usize, usize) -> bool) -> LabelMap {
        let mut values = Vec::new();
        for k in 0..dims[2] {
            for j in 0..dims[1] {
                for i in 0..dims[0] {
                    values.push(i32::from(inside(i, j, k)));
                }
            }
        }
        LabelMap {
            dims,
            values,
            spacing_mm: DVec3::ONE,
            origin: DVec3::ZERO,
            direction: DMat3::IDENTITY,
        }
    }

    #[test]
    fn edges_are_numbered_back_and_forth() {
        for e in 0..12 {
            let (axis, c) = edge_base(e);
            assert_eq!(edge_between(c, c | 1 << axis), e);
            assert_eq!(edge_between(c | 1 << axis, c), e);
        }
    }

    /// Every neighbourhood of voxels: random masks hold all pairs of neighbouring cases many times over.
    #[test]
    fn random_masks_give_closed_oriented_manifolds() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        for case in 0..300 {
            let share = 0.05 + 0.9 * (case as f64 / 300.0);
            let mask: Vec<bool> = (0..6 * 6 * 6).map(|_| rng.random::<f64>() < share).collect();
            if !mask.contains(&true) {
                continue;
            }
            let map = map([6, 6, 6], |i, j, k| mask[i + 6 * (j + 6 * k)]);
            let surface = label_surface(&map, &LabelSurfaceSettings::default()).expect("some voxels");
            let t = surface.mesh.topology();
            assert!(t.watertight && t.oriented, "mask {case}: {t:?}");
            assert_eq!(t.nonmanifold_vertices, 0, "mask {case}");
            assert!(surface.volume_mm3 > 0.0);
        }
    }

    #[test]
    fn a_single_voxel_is_an_octahedron_and_a_full_block_loses_its_corners() {
        let one = label_surface(&map([1, 1, 1], |_, _, _| true), &LabelSurfaceSettings::default())
            .expect("a voxel");
        assert!((one.volume_mm3 - 1.0 / 6.0).abs() < 1e-12);
        assert!(one.touches_border);
        // A block of n^3 voxels: edges are cut by prisms of 1/8 section, corners by what is left.
        let n = 5.0f64;
        let block =
            label_surface(&map([5, 5, 5], |_, _, _| true), &LabelSurfaceSettings::default()).expect("voxels");
        let (full, edge, corner) = (n.powi(3), 12.0 * (n - 1.0) / 8.0, 8.0 * (1.0 / 8.0 - 1.0 / 48.0));
        assert!(
            (block.volume_mm3 - (full - edge - corner)).abs() < 1e-9,
            "{}",
            block.volume_mm3
        );
        assert_eq!(block.mesh.topology().euler, 2);
    }

    #[test]
    fn ambiguous_faces_join_the_label_and_opposite_corners_do_not() {
        let diagonal = label_surface(
            &map([2, 2, 1], |i, j, _| i == j),
            &LabelSurfaceSettings::default(),
        )
        .expect("voxels");
        assert_eq!(diagonal.mesh.topology().components, 1);
        let corner = label_surface(
            &map([2, 2, 2], |i, j, k| i == j && j == k),
            &LabelSurfaceSettings::default(),
        )
        .expect("voxels");
        assert_eq!(corner.mesh.topology().components, 2);
    }

    #[test]
    fn mirrored_grids_and_smoothing_keep_the_surface_outward() {
        let ball = |i: usize, j: usize, k: usize| {
            let d = DVec3::new(i as f64, j as f64, k as f64) - 9.5;
            d.length() <= 8.0
        };
        let mut map = map([20, 20, 20], ball);
        map.spacing_mm = DVec3::new(0.5, 0.5, 2.0);
        map.direction = DMat3::from_cols(-DVec3::X, DVec3::Z, DVec3::Y);
        map.direction.x_axis = DVec3::X;
        assert!(map.direction.determinant() < 0.0);
        let settings = LabelSurfaceSettings {
            label: Some(1),
            smoothing_passes: 60,
        };
        let surface = label_surface(&map, &settings).expect("voxels");
        let t = surface.mesh.topology();
        assert!(t.watertight && t.oriented && t.euler == 2 && surface.volume_mm3 > 0.0);
        assert!(surface.largest_move_vox <= smoothing::HALF_VOXEL + 1e-12);
        let truth = surface.voxels as f64 * map.voxel_volume_mm3();
        assert!(
            (surface.volume_mm3 / truth - 1.0).abs() < 0.015,
            "{} against {truth}",
            surface.volume_mm3
        );
        assert!((surface.volume_mm3 / surface.volume_before_mm3 - 1.0).abs() < 0.02);
        assert_eq!(
            label_surface(
                &map,
                &LabelSurfaceSettings {
                    label: Some(3),
                    smoothing_passes: 0
                }
            )
            .err(),
            Some(SamplingError::NoLabel { label: 3 })
        );
    }

    /// Balls at eight offsets from the grid: smoothing takes stairs off and keeps the volume.
    #[test]
    fn smoothing_takes_the_stairs_off_balls_and_keeps_their_volume() {
        for (diameter, slice_vox, stairs, volume) in [
            (16, 1.0, 0.08, 0.002),
            (32, 1.0, 0.07, 0.002),
            (32, 3.0, 0.27, 0.003),
        ] {
            let radius = 0.5 * f64::from(diameter);
            let (mut square, mut points, mut ratio) = (0.0, 0, 0.0);
            for corner in 0..8 {
                let offset = |axis: u32| if corner >> axis & 1 == 1 { 0.37 } else { 0.11 };
                let n = diameter as usize + 4;
                let centre = DVec3::new(offset(0), offset(1), offset(2)) + 0.5 * n as f64;
                let map = {
                    let mut m = map([n, n, (n as f64 / slice_vox) as usize + 1], |i, j, k| {
                        DVec3::new(i as f64, j as f64, slice_vox * k as f64).distance(centre) <= radius
                    });
                    m.spacing_mm.z = slice_vox;
                    m
                };
                let settings = LabelSurfaceSettings {
                    label: Some(1),
                    smoothing_passes: 60,
                };
                let surface = label_surface(&map, &settings).expect("voxels");
                for p in &surface.mesh.points {
                    square +=
                        (p.distance(map.position(centre / DVec3::new(1.0, 1.0, slice_vox))) - radius).powi(2);
                    points += 1;
                }
                let truth = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
                ratio += surface.volume_mm3 / truth / 8.0;
            }
            let rms = (square / f64::from(points)).sqrt();
            println!(
                "{diameter} voxels, slices of {slice_vox}: stairs {rms:.3} voxels rms, volume {:+.2} %",
                100.0 * (ratio - 1.0)
            );
            assert!(rms < stairs && (ratio - 1.0).abs() < volume, "{rms} {ratio}");
        }
    }
}
