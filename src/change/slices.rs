//! Axial slices of a lesion: outlines, convex hulls, the longest diameter and the one across it.
//!
//! In: a [`Region`]. Out: one [`Slice`] a plane, as line segments in plane coordinates in mm. A mask is cut where its slices
//! are (the k axis of the file): its outline is the marching-squares outline of the binary slice. A mesh is cut by planes of
//! constant z (foot to head) a two-hundredth of its height apart, at most 1 mm.

use super::region::{Mask, Region};
use crate::geometry::TriangleMesh;

/// A segment of an outline, mm.
pub type Segment = [[f64; 2]; 2];

/// One axial slice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Slice {
    /// The outline, unordered.
    pub outline: Vec<Segment>,
}

/// The two diameters of a lesion in the axial plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxialDiameters {
    /// The longest distance between two outline points of one slice, mm.
    pub longest_mm: f64,
    /// The widest extent across it, in the same slice, mm.
    pub perpendicular_mm: f64,
}

/// All slices of a region that meet it.
pub fn axial_slices(region: &Region) -> Vec<Slice> {
    match &region.mask {
        Some(mask) => (0..mask.dims[2]).map(|k| mask_slice(mask, k as i64)).collect(),
        None => mesh_slices(&region.surface),
    }
}

/// Marching squares at half a voxel; diagonal neighbours stay apart, as in space.
fn mask_slice(mask: &Mask, k: i64) -> Slice {
    let [nx, ny, _] = mask.dims.map(|n| n as i64);
    let (sx, sy) = (mask.spacing_mm.x, mask.spacing_mm.y);
    let mut outline = Vec::new();
    for j in -1..ny {
        for i in -1..nx {
            // Corners counter-clockwise, and the middles of the edges that follow them.
            let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(a, b)| mask.is_set(a, b, k));
            let (x, y) = (i as f64, j as f64);
            let middles = [[x + 0.5, y], [x + 1.0, y + 0.5], [x + 0.5, y + 1.0], [x, y + 0.5]]
                .map(|[a, b]| [a * sx, b * sy]);
            for a in 0..4 {
                if !corners[a] && corners[(a + 1) % 4] {
                    let leaving = (a + 1..a + 4)
                        .find(|b| corners[b % 4] && !corners[(b + 1) % 4])
                        .expect("what enters the lesion leaves it again");
                    outline.push([middles[a], middles[leaving % 4]]);
                }
            }
        }
    }
    Slice { outline }
}

fn mesh_slices(mesh: &TriangleMesh) -> Vec<Slice> {
    let Some([lo, hi]) = mesh.bounds() else {
        return Vec::new();
    };
    let count = 200.max((hi.z - lo.z).ceil() as usize);
    let step = (hi.z - lo.z) / count as f64;
    let mut slices = vec![Slice::default(); count];
    for t in &mesh.triangles {
        let p = t.map(|i| mesh.points[i as usize]);
        let (bottom, top) = (p[0].z.min(p[1].z).min(p[2].z), p[0].z.max(p[1].z).max(p[2].z));
        let first = ((bottom - lo.z) / step - 0.5).ceil().max(0.0) as usize;
        for (n, slice) in slices.iter_mut().enumerate().skip(first) {
            let z = lo.z + (n as f64 + 0.5) * step;
            if z >= top {
                break;
            }
            let mut ends = Vec::with_capacity(2);
            for (a, b) in [(p[0], p[1]), (p[1], p[2]), (p[2], p[0])] {
                if (a.z <= z) != (b.z <= z) {
                    let q = a.lerp(b, (z - a.z) / (b.z - a.z));
                    ends.push([q.x, q.y]);
                }
            }
            if let [a, b] = ends[..] {
                slice.outline.push([a, b]);
            }
        }
    }
    slices
}

/// The longest axial diameter of all slices and the extent across it.
pub fn longest_axial(slices: &[Slice]) -> AxialDiameters {
    let mut best = AxialDiameters::default();
    for slice in slices.iter().filter(|s| !s.outline.is_empty()) {
        let points: Vec<[f64; 2]> = slice.outline.iter().flatten().copied().collect();
        let corners: Vec<[f64; 2]> = hull(&points).into_iter().map(|i| points[i]).collect();
        let mut ends = [[0.0; 2]; 2];
        let mut longest = -1.0;
        for (i, a) in corners.iter().enumerate() {
            for b in &corners[i + 1..] {
                let d = (a[0] - b[0]).hypot(a[1] - b[1]);
                if d > longest {
                    (longest, ends) = (d, [*a, *b]);
                }
            }
        }
        if longest > best.longest_mm {
            best = AxialDiameters {
                longest_mm: longest,
                perpendicular_mm: widest_across(&slice.outline, ends, longest),
            };
        }
    }
    best
}

/// The widest extent of an outline along lines perpendicular to a diameter. Between outline points the extent changes linearly,
/// so only lines through outline points are tried, on either side of each.
fn widest_across(outline: &[Segment], ends: [[f64; 2]; 2], length: f64) -> f64 {
    let along = [
        (ends[1][0] - ends[0][0]) / length,
        (ends[1][1] - ends[0][1]) / length,
    ];
    // Each segment as (t, s) at its ends: t along the diameter, s across; t ascending.
    let mut turned: Vec<Segment> = outline
        .iter()
        .map(|segment| {
            let mut s = segment.map(|p| {
                [
                    p[0] * along[0] + p[1] * along[1],
                    p[1] * along[0] - p[0] * along[1],
                ]
            });
            if s[0][0] > s[1][0] {
                s.swap(0, 1);
            }
            s
        })
        .collect();
    turned.sort_by(|a, b| a[0][0].total_cmp(&b[0][0]));
    let mut stops: Vec<f64> = turned.iter().flat_map(|s| [s[0][0], s[1][0]]).collect();
    stops.sort_by(f64::total_cmp);
    stops.dedup();
    let mut widest = 0f64;
    for t in stops {
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for s in turned
            .iter()
            .take_while(|s| s[0][0] <= t)
            .filter(|s| s[1][0] >= t)
        {
            let span = s[1][0] - s[0][0];
            if span > 0.0 {
                let y = s[0][1] + (t - s[0][0]) / span * (s[1][1] - s[0][1]);
                (lo, hi) = (lo.min(y), hi.max(y));
            } else {
                (lo, hi) = (lo.min(s[0][1].min(s[1][1])), hi.max(s[0][1].max(s[1][1])));
            }
        }
        widest = widest.max(hi - lo);
    }
    widest
}

/// Indices of the corners of the convex hull of points in the plane, counter-clockwise (monotone chain, Andrew 1979). Points on
/// hull edges are left out.
pub fn hull(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        (points[a][0].total_cmp(&points[b][0])).then(points[a][1].total_cmp(&points[b][1]))
    });
    order.dedup_by(|a, b| points[*a] == points[*b]);
    if order.len() < 3 {
        return order;
    }
    let turn = |o: usize, a: usize, b: usize| {
        let (o, a, b) = (points[o], points[a], points[b]);
        (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
    };
    let half = |order: &mut dyn Iterator<Item = usize>| {
        let mut chain: Vec<usize> = Vec::new();
        for p in order {
            while chain.len() > 1 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut out = half(&mut order.iter().copied());
    out.extend(half(&mut order.iter().rev().copied()));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_of_a_grid_is_its_corners() {
        let points: Vec<[f64; 2]> = (0..20).map(|i| [(i % 5) as f64, (i / 5) as f64]).collect();
        let mut corners = hull(&points);
        corners.sort_unstable();
        assert_eq!(corners, vec![0, 4, 15, 19]);
    }

    #[test]
    fn an_ellipse_has_its_own_diameters() {
        let n = 400;
        let at = |i: usize| {
            let a = std::f64::consts::TAU * i as f64 / n as f64;
            let (x, y) = (10.0 * a.cos(), 6.0 * a.sin());
            [0.8 * x - 0.6 * y + 3.0, 0.6 * x + 0.8 * y]
        };
        let outline = (0..n).map(|i| [at(i), at((i + 1) % n)]).collect();
        let d = longest_axial(&[Slice { outline }]);
        assert!((d.longest_mm - 20.0).abs() < 1e-9, "{d:?}");
        assert!((d.perpendicular_mm - 12.0).abs() < 1e-3, "{d:?}");
    }
}
