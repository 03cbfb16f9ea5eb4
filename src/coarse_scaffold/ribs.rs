//! Ribs smoothed and fitted, and sheets drawn up to them.
//!
//! A rib of the fine scaffold follows the edges of polygons and ends where erosion thickness (ET) falls below a share of the
//! tolerance: its length and its place mean little. Near the border of a smooth shape's sheet ET grows with the square of the
//! distance `s` from the true rib (there the radius falls with slope one, and `s - (r(rib) - r)` is its second-order term), near
//! a sharp edge linearly. So a power `ET^(1/p)` is linear in `s`, and its zero is the rib:
//!
//! 1. each rib is smoothed, ends kept, twice over so that bends do not shrink;
//! 2. around each of its points `ET^(1/p)` of the sheet's facets is fitted by a linear function on the sheet's tangent plane, for `p` of 1, 1.5
//!    and 2; the power that leaves the least residual over the whole rib is taken. (A linear function in space would do on a flat sheet only:
//!    on a cone ET is exactly linear along the axis, and the rib would move along the axis, off the cone.)
//!    Only facets up to where ET is highest count: beyond, on a bridge between two ribs, it falls again;
//! 3. the point moves outward along the sheet to the zero of the fit, by no more than a bound, and not at all where the rib ends at
//!    an axial curve in the thick of the scaffold;
//! 4. the moved curve is smoothed again; its radius follows the slope of the radius along the way;
//! 5. where a sheet is a strip narrower than that ([`super::breadth`]), all of this goes no further than its depth;
//! 6. the border of each sheet's mesh is moved to the fitted ribs and the vertices near it are relaxed, so that the mesh has
//!    neither steps nor fingers. The exact complex is kept beside it ([`super::FineLinks`]).
//!
//! Cost: `O(rib points x neighbours)`.

use super::attributes::smooth_in_place;
use super::hypergraph::{CurveKind, MedialPoint};
use super::network::Chain;
use crate::fine_scaffold::FineScaffold;
use crate::geometry::neighbours::Neighbour;
use crate::geometry::{LengthScale, Neighbours};
use crate::regularise::Regularised;
use glam::DVec3;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rayon::prelude::*;

/// Powers tried: sharp edges, and smooth ridges seen at finite sampling.
const POWERS: [f64; 3] = [1.0, 1.5, 2.0];
/// Facets looked at are within this many spacings of the rib point.
const REACH: f64 = 5.0;
/// And no further than to where ET is highest, since beyond it falls again towards another rib, but within this many spacings anyway.
const REACH_NARROW: f64 = 3.0;
/// High is this share of the highest ET in reach; on a sheet where it rises all the way, that is about as far off as this share of the reach.
const HIGH: f64 = 0.9;
/// In a strip no point moves further than this share of its depth.
const WITHIN: f64 = 0.5;
/// Facets at least that are fitted.
const FEWEST: usize = 8;
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
    /// Across the sheet: the direction between the facet's two generators.
    across: DVec3,
    erosion: f64,
    area: f64,
    tolerance: f64,
}

/// Smooths and fits the rib polylines of all chains; other chains are left as they are. `free[i]` tells loops without nodes;
/// `width` is the width of other curves' smoothing in tolerances; no point is smoothed or moved further than `depth_mm`, that of its sheet.
pub(crate) fn fit_ribs(
    fine: &FineScaffold,
    regularised: &Regularised,
    chains: &[Chain],
    sheet_of_chain: &[Option<u32>],
    sheet_facets: &[Vec<u32>],
    polylines: &mut [Vec<MedialPoint>],
    free: &[bool],
    depth_mm: &[Vec<f64>],
    width: f64,
) {
    let LengthScale { spacing_mm, .. } = fine.scale;
    let samples: Vec<(Vec<Sample>, Neighbours)> = sheet_facets
        .par_iter()
        .map(|facets| {
            let own: Vec<Sample> = facets
                .iter()
                .map(|&f| sample(fine, regularised, f))
                .filter(|s| s.erosion.is_finite() && s.erosion > LEAST * s.tolerance)
                .collect();
            let tree = Neighbours::new(&own.iter().map(|s| s.position).collect::<Vec<_>>());
            (own, tree)
        })
        .collect();
    polylines.par_iter_mut().enumerate().for_each(|(i, line)| {
        let Some(sheet) = sheet_of_chain[i].filter(|_| chains[i].kind == CurveKind::Rib) else {
            return;
        };
        let tau = regularised.tolerance_over(&chains[i].vertices);
        let furthest = FURTHEST * tau;
        let depth = &depth_mm[i];
        let broad = (REACH * spacing_mm).max(2.0 * tau);
        // The steps of polygons are smoothed away everywhere.
        let width_mm = |k: usize| (RIB_WIDTH * width * tau).min(depth[k].max(spacing_mm));
        smooth_in_place(line, free[i], width_mm);
        let fade = fade(line, &chains[i].vertices, free[i], regularised);
        let (own, tree) = &samples[sheet as usize];
        let around: Vec<(f64, Vec<Neighbour>, [DVec3; 2])> = line
            .iter()
            .map(|q| {
                let mut near = tree.within(q.position, broad);
                let reach = up_to_ridge(own, &near, broad).max((REACH_NARROW * spacing_mm).min(broad));
                near.truncate(near.partition_point(|n| n.distance2 <= reach * reach));
                let tangents = tangents(own, &near);
                (reach, near, tangents)
            })
            .collect();
        let fits: Vec<Vec<Option<Fit>>> = POWERS
            .iter()
            .map(|&p| {
                line.iter()
                    .zip(&around)
                    .map(|(q, (reach, near, tangents))| {
                        (near.len() >= FEWEST)
                            .then(|| fit(own, near, *tangents, q.position, *reach, p))
                            .flatten()
                    })
                    .collect()
            })
            .collect();
        let residual = |fits: &Vec<Option<Fit>>| fits.iter().flatten().map(|f| f.residual).sum::<f64>();
        let Some(best) = fits.iter().min_by(|a, b| residual(a).total_cmp(&residual(b))) else {
            return;
        };
        for (((q, f), fade), depth) in line.iter_mut().zip(best).zip(&fade).zip(depth) {
            if let Some(f) = f {
                let furthest = furthest.min(WITHIN * depth);
                q.position += *fade * f.to_zero.clamp_length_max(furthest);
                q.radius = (q.radius + fade * f.radius_slope * f.to_zero.length().min(furthest)).max(0.0);
            }
        }
        smooth_in_place(line, free[i], width_mm);
    });
}

/// How far ET rises from a point, mm, at most `reach`: on a bridge between two ribs it is half the bridge's width.
fn up_to_ridge(samples: &[Sample], near: &[Neighbour], reach: f64) -> f64 {
    let erosion = |n: &Neighbour| samples[n.index as usize].erosion;
    let highest = near.iter().map(erosion).fold(0.0, f64::max);
    let first = near.iter().find(|n| erosion(n) >= HIGH * highest);
    first.map_or(reach, |n| (n.distance2.sqrt() / HIGH).min(reach))
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
        across: {
            let [a, b] = fine.facet_generators[facet as usize].map(|g| fine.generator_position[g.index()]);
            (b - a).normalize_or_zero()
        },
        area: super::attributes::facet_area(fine, facet),
        tolerance: regularised.tolerance_over(ring),
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

/// The tangent plane of a sheet near a point: two directions across which none of the facets' generators lie, as far as that goes.
fn tangents(samples: &[Sample], near: &[Neighbour]) -> [DVec3; 2] {
    let mut across = Matrix3::<f64>::zeros();
    for n in near {
        let s = &samples[n.index as usize];
        let v: Vector3<f64> = s.across.into();
        across += v * v.transpose() * (s.area / (1e-12 + n.distance2).sqrt());
    }
    let eigen = SymmetricEigen::new(across);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
    [order[0], order[1]].map(|k| {
        let c = eigen.eigenvectors.column(k);
        DVec3::new(c[0], c[1], c[2])
    })
}

fn fit(
    samples: &[Sample],
    near: &[Neighbour],
    tangents: [DVec3; 2],
    at: DVec3,
    reach: f64,
    power: f64,
) -> Option<Fit> {
    let value = |s: &Sample| s.erosion.powf(1.0 / power);
    let weight = |s: &Sample| {
        let x = s.position.distance(at) / reach;
        s.area * (1.0 - x * x).max(0.0)
    };
    // Least squares of value and radius over 1 and the two directions of the plane.
    let mut normal = Matrix3::<f64>::zeros();
    let (mut by_value, mut by_radius) = (Vector3::<f64>::zeros(), Vector3::<f64>::zeros());
    let (mut sum, mut mean, mut square) = (0.0, 0.0, 0.0);
    for n in near {
        let s = &samples[n.index as usize];
        let d = (s.position - at) / reach;
        let row = Vector3::new(1.0, d.dot(tangents[0]), d.dot(tangents[1]));
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
    // A little ridge, for a sheet that is but a strip here.
    for k in 1..3 {
        normal[(k, k)] += 1e-3 * sum;
    }
    let solve = normal.cholesky()?;
    let (a, b) = (solve.solve(&by_value), solve.solve(&by_radius));
    let in_space = |x: &Vector3<f64>| (x[1] * tangents[0] + x[2] * tangents[1]) / reach;
    let slope = in_space(&a);
    let steep = slope.length_squared();
    let spread = (square - mean * mean / sum).max(f64::MIN_POSITIVE);
    // The point must lie on the side where the values fall, and the fall must be more than noise.
    if steep * reach * reach * sum < 0.05 * spread || a[0] <= 0.0 {
        return None;
    }
    let to_zero = -slope * (a[0] / steep);
    let explained = a.dot(&by_value);
    Some(Fit {
        to_zero,
        radius_slope: in_space(&b).dot(to_zero.normalize_or_zero()).clamp(-1.0, 0.0),
        residual: ((square - explained) / spread).max(0.0),
    })
}
