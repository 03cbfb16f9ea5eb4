//! What is left between two shapes once the pose is taken away.
//!
//! In: both surfaces, `T_target_source`, and, where known, both coarse scaffolds with the corresponding sheets. Out: signed
//! distances at every vertex, volumes and areas, surface distances, and a line for every sheet of the target: what grew, what
//! thinned, what is longer or more bent there.
//!
//! 1. The source is moved (and turned inside out again when the pose mirrors).
//! 2. Distances: exact, from the vertices of each to the triangles of the other, signed when the other is closed: **positive
//!    where the source lies outside the target**, on both. Signs are those of the pseudonormals at the closest points; an evenly
//!    spread sample of them is compared with the winding number, and if one differs (the surface passes through itself, or one
//!    piece lies inside another) the winding number gives them all.
//! 3. Hausdorff distance, its 95th percentile and the mean surface distance from 10 000 points spread by area on each surface
//!    (and, for the largest, the vertices), so that uneven triangles do not weigh (Taha and Hanbury 2015 for the definitions).
//! 4. Regions: every vertex of the target belongs to a sheet (the one that hosts it, or the nearest medial points where that is not
//!    known). The volume gained over a region is the integral of the signed distance, to first order.
//!
//! Cost: `O((n + m) log)`.

use super::oriented::sample;
use super::shape::{RegistrationError, RegistrationShape};
use crate::coarse_scaffold::hypergraph::{CoarseScaffold, Host, Sheet};
use crate::geometry::{
    ClosestOnMesh, ClosestPoint, Neighbours, Pseudonormals, Rigid, SheetId, TriangleMesh, WindingNumber,
};
use crate::matching::Pair;
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Points spread on each surface for the statistics.
const SAMPLES: usize = 10_000;
/// Signs that are compared with the winding number, of each surface.
const CHECKED: usize = 512;

/// What happened at one sheet of the target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SheetDifference {
    /// Sheet of the target.
    pub target: SheetId,
    /// The sheet of the source that corresponds to it.
    pub source: Option<SheetId>,
    /// Area of the target's surface that belongs to the sheet, mm^2.
    pub surface_area: f64,
    /// Mean signed distance of the source there, mm; positive outside.
    pub mean: f64,
    /// Largest distance outward there, mm.
    pub max_outward: f64,
    /// Largest distance inward there, mm, as a positive number.
    pub max_inward: f64,
    /// Volume gained there, mm^3 (first order: the integral of the signed distance).
    pub volume: f64,
    /// Change of the mean thickness (twice the radius), percent of the target's.
    pub thickness_percent: Option<f64>,
    /// Change of the sheet's area, percent.
    pub area_percent: Option<f64>,
    /// Change of the sheet's largest deviation, percent: longer or shorter.
    pub length_percent: Option<f64>,
    /// Change of the sheet's smallest deviation, mm: more or less bent.
    pub bend: Option<f64>,
}

/// The difference of two shapes in one pose. Lengths in mm; positive distances: the source lies outside the target.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Volume of the target, mm^3; none when its surface is not closed.
    pub volume_target: Option<f64>,
    /// Volume of the source, mm^3; none when its surface is not closed.
    pub volume_source: Option<f64>,
    /// Change from target to source, percent of the target's.
    pub volume_change_percent: Option<f64>,
    /// Area of the target, mm^2.
    pub area_target: f64,
    /// Area of the source, mm^2.
    pub area_source: f64,
    /// Change from target to source, percent of the target's.
    pub area_change_percent: f64,
    /// Largest distance of any point of one surface to the other, mm.
    pub hausdorff: f64,
    /// The larger of both directions' 95th percentiles, mm.
    pub hd95: f64,
    /// Mean distance over both surfaces, mm.
    pub assd: f64,
    /// Root mean square distance over both surfaces, mm.
    pub rms: f64,
    /// A line for every sheet of the target; empty without a scaffold.
    pub per_sheet: Vec<SheetDifference>,
    /// Signed distance of every vertex of the moved source to the target, mm; unsigned where the target is not closed.
    #[serde(skip)]
    pub at_source: Vec<f64>,
    /// For every vertex of the target, how far the source lies outside (positive) or inside there, mm; unsigned where the
    /// source is not closed.
    #[serde(skip)]
    pub at_target: Vec<f64>,
}

/// Scaffolds of both shapes, each in its own frame, and which sheets correspond.
#[derive(Clone, Copy, Debug)]
pub struct SheetContext<'a> {
    /// Scaffold of the target.
    pub target: &'a CoarseScaffold,
    /// Scaffold of the source.
    pub source: &'a CoarseScaffold,
    /// Corresponding sheets.
    pub pairs: &'a [Pair<SheetId>],
}

/// Measures what is left between two surfaces.
///
/// # Errors
/// [`RegistrationError`] when a mesh is empty, not finite or without area.
#[allow(
    non_snake_case,
    reason = "frames are written as they are read: target from source"
)]
pub fn difference(
    target: &TriangleMesh,
    source: &TriangleMesh,
    T_target_source: &Rigid,
    sheets: Option<SheetContext>,
) -> Result<Difference, RegistrationError> {
    RegistrationShape::mesh(target).validate("target")?;
    RegistrationShape::mesh(source).validate("source")?;
    let moved = moved(source, T_target_source);
    let (on_target, on_source) = rayon::join(|| Distance::new(target), || Distance::new(&moved));
    let at_source = on_target.signed(&moved.points);
    // Where the target's vertex lies inside the source, the source lies outside the target.
    let at_target: Vec<f64> = on_source
        .signed(&target.points)
        .into_iter()
        .map(|d| if on_source.closed { -d } else { d })
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let target_samples = sample(target, &target.vertex_normals(), SAMPLES, &mut rng).0;
    let source_samples = sample(&moved, &moved.vertex_normals(), SAMPLES, &mut rng).0;
    let there = on_target.plain(&source_samples);
    let back = on_source.plain(&target_samples);
    let largest = |d: &[f64]| d.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let hausdorff = [&there, &back, &at_source, &at_target]
        .map(|d| largest(d))
        .into_iter()
        .fold(0.0, f64::max);
    let all = || there.iter().chain(&back);
    let count = (there.len() + back.len()) as f64;
    let volume = |mesh: &TriangleMesh, d: &Distance| d.closed.then(|| mesh.signed_volume().abs());
    let (volume_target, volume_source) = (volume(target, &on_target), volume(&moved, &on_source));
    let (area_target, area_source) = (target.area(), moved.area());
    let per_sheet = sheets.map_or_else(Vec::new, |context| per_sheet(target, &at_target, context));
    Ok(Difference {
        volume_change_percent: volume_target.zip(volume_source).map(|(t, s)| percent(t, s)),
        volume_target,
        volume_source,
        area_target,
        area_source,
        area_change_percent: percent(area_target, area_source),
        hausdorff,
        hd95: percentile_95(&there).max(percentile_95(&back)),
        assd: all().sum::<f64>() / count,
        rms: (all().map(|d| d * d).sum::<f64>() / count).sqrt(),
        per_sheet,
        at_source,
        at_target,
    })
}

/// The mesh in the target's frame, outward again when the pose mirrors.
fn moved(mesh: &TriangleMesh, pose: &Rigid) -> TriangleMesh {
    let mut out = mesh.clone();
    out.points.iter_mut().for_each(|p| *p = pose.apply(*p));
    if pose.is_mirrored() {
        out.flip();
    }
    out
}

/// Distance to one surface.
struct Distance {
    index: ClosestOnMesh,
    inside: Option<Inside>,
    closed: bool,
}

/// Inside or outside of a closed surface.
struct Inside {
    winding: WindingNumber,
    /// The triangles face inward.
    inward: bool,
    normals: Option<Pseudonormals>,
}

impl Distance {
    fn new(mesh: &TriangleMesh) -> Self {
        let closed = mesh.topology().watertight;
        let (index, inside) = rayon::join(
            || ClosestOnMesh::new(mesh).expect("the mesh was checked to have area"),
            || closed.then(|| Inside::new(mesh)).flatten(),
        );
        Self {
            index,
            inside,
            closed,
        }
    }

    fn plain(&self, points: &[DVec3]) -> Vec<f64> {
        points
            .par_iter()
            .map(|&p| self.index.closest(p).distance2.sqrt())
            .collect()
    }

    fn signed(&self, points: &[DVec3]) -> Vec<f64> {
        let Some(inside) = &self.inside else {
            return self.plain(points);
        };
        let found: Vec<ClosestPoint> = points.par_iter().map(|&p| self.index.closest(p)).collect();
        let inside = inside.of(points, &found);
        found
            .iter()
            .zip(inside)
            .map(|(f, inside)| {
                let d = f.distance2.sqrt();
                if inside { -d } else { d }
            })
            .collect()
    }
}

impl Inside {
    fn new(mesh: &TriangleMesh) -> Option<Self> {
        let inward = mesh.signed_volume() < 0.0;
        let mut outward = Cow::Borrowed(mesh);
        if inward {
            outward.to_mut().flip();
        }
        Some(Self {
            winding: WindingNumber::new(&outward)?,
            inward,
            normals: Pseudonormals::new(mesh),
        })
    }

    /// Which points are inside, given their closest points.
    fn of(&self, points: &[DVec3], closest: &[ClosestPoint]) -> Vec<bool> {
        if let Some(normals) = &self.normals {
            let by_normals: Vec<bool> = points
                .par_iter()
                .zip(closest)
                .map(|(&p, c)| normals.is_inside(p, c) != self.inward)
                .collect();
            let step = points.len().div_ceil(CHECKED).max(1);
            let agree = (0..points.len())
                .into_par_iter()
                .step_by(step)
                // On the surface itself a sign means nothing.
                .filter(|&i| closest[i].distance2 > 1e-18 * points[i].length_squared())
                .all(|i| self.winding.is_inside(points[i]) == by_normals[i]);
            if agree {
                return by_normals;
            }
        }
        self.winding.is_inside_many(points)
    }
}

fn percent(from: f64, to: f64) -> f64 {
    100.0 * (to - from) / from
}

fn percentile_95(d: &[f64]) -> f64 {
    let mut d = d.to_vec();
    let k = ((d.len() - 1) as f64 * 0.95).round() as usize;
    *d.select_nth_unstable_by(k, f64::total_cmp).1
}

fn per_sheet(target: &TriangleMesh, at_target: &[f64], context: SheetContext) -> Vec<SheetDifference> {
    let region = regions(target, context.target);
    let mut share = vec![0.0; target.points.len()];
    for t in &target.triangles {
        let [a, b, c] = t.map(|i| target.points[i as usize]);
        let third = (b - a).cross(c - a).length() / 6.0;
        t.iter().for_each(|&i| share[i as usize] += third);
    }
    let line = |sheet: &Sheet| {
        let pair = context.pairs.iter().find(|p| p.target == sheet.id);
        let other = pair.and_then(|p| context.source.sheets.get(p.source.index()));
        let mut out = SheetDifference {
            target: sheet.id,
            source: pair.map(|p| p.source),
            surface_area: 0.0,
            mean: 0.0,
            max_outward: 0.0,
            max_inward: 0.0,
            volume: 0.0,
            thickness_percent: other.map(|o| percent(sheet.mean_radius, o.mean_radius)),
            area_percent: other.map(|o| percent(sheet.area, o.area)),
            length_percent: other.map(|o| percent(sheet.moments.deviations[0], o.moments.deviations[0])),
            bend: other.map(|o| o.moments.deviations[2] - sheet.moments.deviations[2]),
        };
        for v in (0..at_target.len()).filter(|&v| region[v] == Some(sheet.id)) {
            out.surface_area += share[v];
            out.volume += share[v] * at_target[v];
            out.max_outward = out.max_outward.max(at_target[v]);
            out.max_inward = out.max_inward.max(-at_target[v]);
        }
        if out.surface_area > 0.0 {
            out.mean = out.volume / out.surface_area;
        }
        out
    };
    context.target.sheets.iter().map(line).collect()
}

/// The sheet every vertex belongs to: that of its generator when the mesh's points are the generators, else that of the medial
/// point whose ball it is nearest to.
fn regions(mesh: &TriangleMesh, scaffold: &CoarseScaffold) -> Vec<Option<SheetId>> {
    let hosts = &scaffold.fine.generator_host;
    if hosts.len() == mesh.points.len() {
        let sheet = |h: &Host| if let Host::Sheet(s) = h { Some(*s) } else { None };
        return hosts.iter().map(sheet).collect();
    }
    let mut places = Vec::new();
    let mut owner = Vec::new();
    for sheet in &scaffold.sheets {
        for m in &sheet.mesh.vertices {
            places.push((m.position, m.radius));
            owner.push(sheet.id);
        }
    }
    if places.is_empty() {
        return vec![None; mesh.points.len()];
    }
    let positions: Vec<DVec3> = places.iter().map(|p| p.0).collect();
    let tree = Neighbours::new(&positions);
    mesh.points
        .par_iter()
        .map(|&p| {
            let gap = |i: u32| {
                let (c, r) = places[i as usize];
                (c.distance(p) - r).abs()
            };
            let near = tree.knn(p, 64);
            let best = near.iter().min_by(|a, b| gap(a.index).total_cmp(&gap(b.index)));
            best.map(|n| owner[n.index as usize])
        })
        .collect()
}
