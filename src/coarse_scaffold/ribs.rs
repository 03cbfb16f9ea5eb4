//! Ribs smoothed and fitted, and sheets drawn up to them.
//!
//! A rib of the fine scaffold follows the edges of polygons and ends where erosion thickness (ET) falls below a share of the
//! tolerance: its length and its place mean little. Near the border of a smooth shape's sheet ET grows with the square of the
//! distance `s` from the true rib (there the radius falls with slope one, and `s - (r(rib) - r)` is its second-order term), near
//! a sharp edge linearly. So a power `ET^(1/p)` is linear in `s`, and its zero is the rib:
//!
//! 1. each rib is smoothed, ends kept;
//! 2. around each of its points `ET^(1/p)` of the sheet's facets is fitted by a plane, for `p` of 1, 1.5 and 2; the
//!    power that leaves the least residual over the whole rib is taken;
//! 3. the point moves outward along the sheet to the zero of the fit, by no more than a bound, and not at all where the rib ends at
//!    an axial curve in the thick of the scaffold;
//! 4. the moved curve is smoothed again; its radius follows the slope of the radius along the way;
//! 5. the border of each sheet's mesh is moved to the fitted ribs and the vertices near it are relaxed, so that the mesh has
//!    neither steps nor fingers. The exact complex is kept beside it ([`super::FineLinks`]).
//!
//! Cost: `O(rib points x neighbours)`.

use super::attributes::smooth;
use super::hypergraph::{CurveKind, MedialPoint};
use super::network::Chain;
use crate::fine_scaffold::FineScaffold;
use crate::geometry::{LengthScale, Neighbours};
use crate::regularise::Regularised;
use glam::DVec3;
use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;

/// Powers tried: sharp edges, and smooth ridges seen at finite sampling.
const POWERS: [f64; 3] = [1.0, 1.5, 2.0];
/// Facets looked at are within this many spacings of the rib point.
const REACH: f64 = 5.0;
/// Facets below this ET, in tolerances, say more of the sampling than of the shape.
const LEAST: f64 = 0.1;

/// Ribs are smoothed over this many times the width of other curves: they follow the edges of polygons.
const RIB_WIDTH: f64 = 2.0;
/// A rib that ends where the scaffold is thick stays there; the fit fades out over this many tolerances towards such an end.
const FADE: f64 = 3.0;
/// Radius, in tolerances, above which the scaffold is thick at the end of a rib.
const THICK: f64 = 5.0;

/// A rib point moves by no more than this many tolerances: on an ellipsoid of axes 1 : 0.7 : 0.4 the rib left at 0.15 tolerances
/// of ET lies 1.3 tolerances of 1 % inside the true one.
const FURTHEST: f64 = 2.0;

/// What a facet of a sheet near a rib says.
struct Sample {
    position: DVec3,
    radius: f64,
    erosion: f64,
    area: f64,
}

/// Smooths and fits the rib polylines of all chains; other chains are left as they are. `closed[i]` tells loops without nodes.
pub(crate) fn fit_ribs(
    fine: &FineScaffold,
    regularised: &Regularised,
    chains: &[Chain],
    sheet_of_chain: &[Option<u32>],
    sheet_facets: &[Vec<u32>],
    polylines: &mut [Vec<MedialPoint>],
    free: &[bool],
    width_mm: f64,
) {
    let tau = regularised.tolerance_mm;
    let LengthScale { spacing_mm, .. } = fine.scale;
    let reach = (REACH * spacing_mm).max(2.0 * tau);
    let furthest = FURTHEST * tau;
    let samples: Vec<(Vec<Sample>, Neighbours)> = sheet_facets
        .par_iter()
        .map(|facets| {
            let own: Vec<Sample> = facets
                .iter()
                .map(|&f| sample(fine, regularised, f))
                .filter(|s| s.erosion.is_finite() && s.erosion > LEAST * tau)
                .collect();
            let tree = Neighbours::new(&own.iter().map(|s| s.position).collect::<Vec<_>>());
            (own, tree)
        })
        .collect();
    polylines.par_iter_mut().enumerate().for_each(|(i, line)| {
        let Some(sheet) = sheet_of_chain[i].filter(|_| chains[i].kind == CurveKind::Rib) else {
            return;
        };
        let width_mm = RIB_WIDTH * width_mm;
        smooth(line, free[i], width_mm);
        let fade = fade(line, &chains[i].vertices, free[i], regularised);
        let (own, tree) = &samples[sheet as usize];
        let fits: Vec<Vec<Option<Fit>>> = POWERS
            .iter()
            .map(|&p| {
                line.iter()
                    .map(|q| fit(own, tree, q.position, reach, p))
                    .collect()
            })
            .collect();
        let residual = |fits: &Vec<Option<Fit>>| fits.iter().flatten().map(|f| f.residual).sum::<f64>();
        let Some(best) = fits.iter().min_by(|a, b| residual(a).total_cmp(&residual(b))) else {
            return;
        };
        for ((q, f), fade) in line.iter_mut().zip(best).zip(&fade) {
            if let Some(f) = f {
                q.position += *fade * f.to_zero.clamp_length_max(furthest);
                q.radius = (q.radius + fade * f.radius_slope * f.to_zero.length().min(furthest)).max(0.0);
            }
        }
        smooth(line, free[i], width_mm);
    });
}

/// How much of the fit counts at each point: 1 away from the ends and at thin ends, 0 at thick ones.
fn fade(line: &[MedialPoint], vertices: &[u32], closed: bool, regularised: &Regularised) -> Vec<f64> {
    let mut fade = vec![1.0; line.len()];
    if closed {
        return fade;
    }
    let mut from_end = |indices: &mut dyn Iterator<Item = usize>| {
        let (mut last, mut way, mut reach) = (None, 0.0, 0.0);
        for i in indices {
            let here = line[i].position;
            match last {
                None => {
                    let tau = regularised.tolerance_at(vertices[i]);
                    if line[i].radius <= THICK * tau {
                        return;
                    }
                    reach = FADE * tau;
                }
                Some(before) => way += here.distance(before),
            }
            if way >= reach {
                return;
            }
            fade[i] = fade[i].min(way / reach);
            last = Some(here);
        }
    };
    from_end(&mut (0..line.len()));
    from_end(&mut (0..line.len()).rev());
    fade
}

fn sample(fine: &FineScaffold, regularised: &Regularised, facet: u32) -> Sample {
    let ring = fine.facet_vertices(facet as usize);
    let n = ring.len() as f64;
    Sample {
        position: ring
            .iter()
            .map(|&v| fine.vertex_position[v as usize])
            .sum::<DVec3>()
            / n,
        radius: ring.iter().map(|&v| fine.vertex_radius[v as usize]).sum::<f64>() / n,
        erosion: regularised.erosion_mm[facet as usize],
        area: super::attributes::facet_area(fine, facet),
    }
}

/// A local fit of `ET^(1/p)`.
struct Fit {
    /// Way from the point to the zero of the fit.
    to_zero: DVec3,
    /// Change of radius along that way.
    radius_slope: f64,
    /// Squared residual relative to the spread of the values.
    residual: f64,
}

fn fit(samples: &[Sample], tree: &Neighbours, at: DVec3, reach: f64, power: f64) -> Option<Fit> {
    let near = tree.within(at, reach);
    if near.len() < 8 {
        return None;
    }
    let value = |s: &Sample| s.erosion.powf(1.0 / power);
    let weight = |s: &Sample| {
        let x = s.position.distance(at) / reach;
        s.area * (1.0 - x * x).max(0.0)
    };
    // Least squares of value and radius over 1, x, y, z; the sheet is thin across, so a little ridge keeps the
    // slope in its plane.
    let mut normal = Matrix4::<f64>::zeros();
    let (mut by_value, mut by_radius) = (Vector4::<f64>::zeros(), Vector4::<f64>::zeros());
    let (mut sum, mut mean, mut square) = (0.0, 0.0, 0.0);
    for n in &near {
        let s = &samples[n.index as usize];
        let d = (s.position - at) / reach;
        let row = Vector4::new(1.0, d.x, d.y, d.z);
        let w = weight(s);
        normal += row * row.transpose() * w;
        by_value += row * (w * value(s));
        by_radius += row * (w * s.radius);
        sum += w;
        mean += w * value(s);
        square += w * value(s) * value(s);
    }
    if sum <= 0.0 {
        return None;
    }
    for k in 1..4 {
        normal[(k, k)] += 1e-3 * sum;
    }
    let solve = normal.cholesky()?;
    let (a, b) = (solve.solve(&by_value), solve.solve(&by_radius));
    let slope = DVec3::new(a[1], a[2], a[3]) / reach;
    let steep = slope.length_squared();
    let spread = (square - mean * mean / sum).max(f64::MIN_POSITIVE);
    // The point must lie on the side where the values fall, and the fall must be more than noise.
    if steep * reach * reach * sum < 0.05 * spread || a[0] <= 0.0 {
        return None;
    }
    let to_zero = -slope * (a[0] / steep);
    let radius = DVec3::new(b[1], b[2], b[3]) / reach;
    let explained = a.dot(&by_value);
    Some(Fit {
        to_zero,
        radius_slope: radius.dot(to_zero.normalize_or_zero()).clamp(-1.0, 0.0),
        residual: ((square - explained) / spread).max(0.0),
    })
}
