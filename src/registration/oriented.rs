//! A surface as registration sees it: oriented points in a unit of its own, its border, and nearest-place queries.
//!
//! In: a [`RegistrationShape`]. Out: a [`View`], in which lengths are shares of a common unit (the larger diagonal of the two
//! shapes) and the origin is the shape's own centroid, so that every constant of the search is a plain number.
//!
//! * A mesh is sampled by area (systematic sampling along the triangles, so that samples spread evenly); normals are those of
//!   the vertices, interpolated; the border is what lies within two spacings of an edge with one triangle.
//! * A cloud without normals is de-noised ([`super::denoise`]); with normals it is taken as it is. Its border is found from the
//!   directions to the neighbours.
//!
//! The diagonal is that of the box along the principal axes: it does not change when the shape turns.

use super::denoise;
use super::exact::{ExactSurface, PointTree};
use super::nearest_grid::NearestGrid;
use super::shape::{RegistrationShape, Surface};
use crate::geometry::TriangleMesh;
use crate::matching::moments::{Moments, moments};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Edge of the cells of nearest points, in units.
const CELL: f64 = 0.02;
/// How far round the shape nearest points are known, in units.
const MARGIN: f64 = 0.25;
/// Most raw points that take part in de-noising: more do not improve 4 000 wanted ones and cost time.
const MOST_RAW: usize = 20_000;
/// Most vertices kept for the largest distance.
const MOST_VERTICES: usize = 5_000;

/// One surface, prepared.
pub(crate) struct View {
    /// Samples in random order: any prefix is a fair sample of the surface.
    pub(crate) points: Vec<DVec3>,
    pub(crate) normals: Vec<DVec3>,
    /// Share of the noise's variance that is left in each sample.
    pub(crate) left: Vec<f64>,
    /// Median of those.
    pub(crate) usual_left: f64,
    /// Samples at the border of what was seen.
    pub(crate) border: Vec<bool>,
    pub(crate) spacing: f64,
    pub(crate) grid: NearestGrid,
    pub(crate) tree: PointTree,
    pub(crate) exact: ExactSurface,
    pub(crate) moments: Moments,
    /// The mesh's own vertices (no more than [`MOST_VERTICES`]), for the largest distance.
    pub(crate) vertices: Vec<DVec3>,
    /// No border was found.
    pub(crate) closed: bool,
    /// Noise of a raw cloud, in units.
    pub(crate) noise: f64,
    /// Place of the view's origin in the shape's frame, mm.
    pub(crate) centre: DVec3,
    /// Handedness was changed.
    pub(crate) mirrored: bool,
    /// Size of this copy as a factor of the shape's own.
    pub(crate) size: f64,
}

/// Diagonal of the box along the principal axes, mm.
pub(crate) fn diagonal(points: &[DVec3]) -> f64 {
    let turned = moments(points).axes.transpose();
    let local: Vec<DVec3> = points.iter().map(|&p| turned * p).collect();
    crate::geometry::mesh::bounds(&local).map_or(0.0, |[low, high]| (high - low).length())
}

impl View {
    /// Prepares a shape; `unit_mm` is the length that becomes 1.
    pub(crate) fn new(shape: &RegistrationShape, unit_mm: f64, samples: usize, seed: u64) -> Self {
        let points = shape.points();
        let centre = points.iter().copied().sum::<DVec3>() / points.len() as f64;
        let local: Vec<DVec3> = points.iter().map(|&p| (p - centre) / unit_mm).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        match shape.surface {
            Surface::Mesh(mesh) => {
                let mesh = TriangleMesh {
                    points: local,
                    triangles: mesh.triangles.clone(),
                };
                Self::of_mesh(mesh, samples, centre, &mut rng)
            }
            Surface::Cloud { normals, .. } => Self::of_cloud(local, normals, samples, centre, &mut rng),
        }
    }

    fn of_mesh(mut mesh: TriangleMesh, samples: usize, centre: DVec3, rng: &mut ChaCha8Rng) -> Self {
        mesh.triangles.retain(|t| {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            (b - a).cross(c - a).length() > 0.0
        });
        let vertex_normals = mesh.vertex_normals();
        let sampled = sample(&mesh, &vertex_normals, samples, rng);
        let outward: f64 = if mesh.topology().watertight {
            mesh.signed_volume()
        } else {
            let centroid = moments(&sampled.0).centroid;
            sampled
                .0
                .iter()
                .zip(&sampled.1)
                .map(|(p, n)| n.dot(*p - centroid))
                .sum()
        };
        let sign = if outward < 0.0 { -1.0 } else { 1.0 };
        let (points, mut normals) = sampled;
        normals.iter_mut().for_each(|n| *n *= sign);
        let spacing = (mesh.area() / points.len() as f64).sqrt();
        let edges = border_samples(&mesh, spacing);
        let border = match PointTree::new(&edges) {
            Some(tree) if !edges.is_empty() => points
                .iter()
                .map(|&p| edges[tree.nearest(p)].distance(p) < (2.0 * spacing).max(0.03))
                .collect(),
            _ => vec![false; points.len()],
        };
        let face_normals = mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| mesh.points[i as usize]);
                (b - a).cross(c - a).normalize() * sign
            })
            .collect();
        let step = mesh.points.len().div_ceil(MOST_VERTICES).max(1);
        let vertices = mesh.points.iter().copied().step_by(step).collect();
        let exact = ExactSurface::of_mesh(&mesh, face_normals);
        let left = vec![1.0; points.len()];
        Self::assemble(
            points, normals, left, border, spacing, exact, vertices, 0.0, centre,
        )
    }

    fn of_cloud(
        raw: Vec<DVec3>,
        normals: Option<&[DVec3]>,
        samples: usize,
        centre: DVec3,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let order = shuffled(raw.len(), rng);
        let wanted = &order[..samples.min(raw.len())];
        let (points, normals, left, noise) = match normals {
            Some(given) => {
                let points = wanted.iter().map(|&i| raw[i as usize]).collect();
                let normals = wanted.iter().map(|&i| given[i as usize].normalize()).collect();
                (points, normals, vec![1.0; wanted.len()], 0.0)
            }
            None => {
                let some: Vec<DVec3> = order.iter().take(MOST_RAW).map(|&i| raw[i as usize]).collect();
                let wanted: Vec<u32> = (0..wanted.len() as u32).collect();
                let clean = denoise::denoise(&some, &wanted);
                (clean.points, clean.normals, clean.left, clean.noise)
            }
        };
        let spacing = denoise::spacing(&points);
        let border = denoise::border(&points, &normals, spacing, 0.03);
        Self::assemble(
            points,
            normals,
            left,
            border,
            spacing,
            None,
            Vec::new(),
            noise,
            centre,
        )
    }

    fn assemble(
        points: Vec<DVec3>,
        normals: Vec<DVec3>,
        left: Vec<f64>,
        border: Vec<bool>,
        spacing: f64,
        exact: Option<ExactSurface>,
        vertices: Vec<DVec3>,
        noise: f64,
        centre: DVec3,
    ) -> Self {
        let tree = || PointTree::new(&points).expect("the shape was checked: finite, non-empty points");
        let discs = || ExactSurface::of_discs(&points, &normals, spacing).expect("as above");
        let exact = exact.unwrap_or_else(discs);
        let seen = border.iter().filter(|b| **b).count();
        Self {
            grid: NearestGrid::new(&points, CELL, MARGIN),
            tree: tree(),
            moments: moments(&points),
            closed: (seen as f64) < 0.01 * points.len() as f64,
            points,
            normals,
            usual_left: median(&left),
            left,
            border,
            spacing,
            exact,
            vertices,
            noise,
            centre,
            mirrored: false,
            size: 1.0,
        }
    }

    /// The mirror image, `x -> -x` in the view's own frame.
    pub(crate) fn mirror_image(&self) -> Self {
        let flip = |p: &DVec3| DVec3::new(-p.x, p.y, p.z);
        let points: Vec<DVec3> = self.points.iter().map(flip).collect();
        let normals: Vec<DVec3> = self.normals.iter().map(flip).collect();
        let vertices = self.vertices.iter().map(flip).collect();
        let mut image = Self::assemble(
            points,
            normals,
            self.left.clone(),
            self.border.clone(),
            self.spacing,
            Some(self.exact.mirror_image()),
            vertices,
            self.noise,
            self.centre,
        );
        image.mirrored = !self.mirrored;
        image
    }

    /// The same surface enlarged by `factor` about its centroid.
    pub(crate) fn resized(&self, factor: f64) -> Self {
        let grown = |points: &[DVec3]| points.iter().map(|p| *p * factor).collect::<Vec<_>>();
        let mut copy = Self::assemble(
            grown(&self.points),
            self.normals.clone(),
            self.left.clone(),
            self.border.clone(),
            self.spacing * factor,
            Some(self.exact.resized(factor)),
            grown(&self.vertices),
            self.noise * factor,
            self.centre,
        );
        copy.mirrored = self.mirrored;
        copy.size = self.size * factor;
        copy
    }

    /// The same surface with the other face outside.
    pub(crate) fn turned(&self) -> Self {
        let mut turned = Self::assemble(
            self.points.clone(),
            self.normals.iter().map(|n| -*n).collect(),
            self.left.clone(),
            self.border.clone(),
            self.spacing,
            Some(self.exact.clone()),
            self.vertices.clone(),
            self.noise,
            self.centre,
        );
        turned.mirrored = self.mirrored;
        turned
    }

    /// Root mean square distance of the samples from their centroid.
    pub(crate) fn gyration(&self) -> f64 {
        self.moments.deviations.length()
    }

    /// Area of the surface in units squared, from the samples.
    pub(crate) fn area(&self) -> f64 {
        self.points.len() as f64 * self.spacing * self.spacing
    }
}

fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A random order of `0..n`.
pub(crate) fn shuffled(n: usize, rng: &mut ChaCha8Rng) -> Vec<u32> {
    let mut order: Vec<u32> = (0..n as u32).collect();
    for i in (1..n).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    order
}

/// Points spread by area with their normals, in random order.
pub(crate) fn sample(
    mesh: &TriangleMesh,
    vertex_normals: &[DVec3],
    count: usize,
    rng: &mut ChaCha8Rng,
) -> (Vec<DVec3>, Vec<DVec3>) {
    let mut sums = Vec::with_capacity(mesh.triangles.len());
    let mut total = 0.0;
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.points[i as usize]);
        total += 0.5 * (b - a).cross(c - a).length();
        sums.push(total);
    }
    let mut drawn: Vec<(DVec3, DVec3)> = Vec::with_capacity(count);
    let mut face = 0;
    for k in 0..count {
        let mark = (k as f64 + rng.random::<f64>()) / count as f64 * total;
        while face + 1 < sums.len() && sums[face] < mark {
            face += 1;
        }
        let t = mesh.triangles[face];
        let (mut u, mut v) = (rng.random::<f64>(), rng.random::<f64>());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let mix = |values: &[DVec3]| {
            let [a, b, c] = t.map(|i| values[i as usize]);
            a * (1.0 - u - v) + b * u + c * v
        };
        let [a, b, c] = t.map(|i| mesh.points[i as usize]);
        let flat = (b - a).cross(c - a).normalize_or(DVec3::Z);
        let smooth = mix(vertex_normals).normalize_or_zero();
        // At a sharp edge the mean of the sides says nothing of either.
        let normal = if smooth.dot(flat) > 0.5 { smooth } else { flat };
        drawn.push((mix(&mesh.points), normal));
    }
    let order = shuffled(count, rng);
    order.iter().map(|&i| drawn[i as usize]).unzip()
}

/// Points along the edges that have one triangle, half a spacing apart.
fn border_samples(mesh: &TriangleMesh, spacing: f64) -> Vec<DVec3> {
    let mut edges: Vec<(u32, u32)> = mesh
        .triangles
        .iter()
        .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect();
    edges.sort_unstable();
    let mut out = Vec::new();
    for run in edges.chunk_by(|a, b| a == b).filter(|run| run.len() == 1) {
        let (a, b) = (mesh.points[run[0].0 as usize], mesh.points[run[0].1 as usize]);
        let pieces = (a.distance(b) / (0.5 * spacing)).ceil().clamp(1.0, 1000.0) as usize;
        out.extend((0..pieces).map(|k| a.lerp(b, k as f64 / pieces as f64)));
    }
    out
}
