//! One tetrahedron at a time: its sphere, on which side of each facet the centre lies, which neighbours share the sphere, which
//! angles are not acute.
//!
//! In: a triangulation. Out: [`TetGeometry`] for each finite tetrahedron. With `u, v, w` from the first corner to the others,
//! `m = |u|^2 v x w + |v|^2 w x u + |w|^2 u x v` and `det = u . v x w` the centre is `m / (2 det)` from that corner, its
//! barycentric coordinates are `m . (v x w) / (2 det^2)` and so on, and a point `q` (from that corner) lies inside the sphere
//! when `q . m > |q|^2 det`. The angles of the four facets come from the six products of `u, v, w`. All signs come from these
//! shared quantities when they clear a forward error bound and from the exact predicates when not: the barycentric coordinate
//! of a vertex is positive exactly when the vertex lies outside the smallest ball of the opposite facet (Leymarie & Kimia
//! 2007, where this tells the four types of A1^3 shocks apart). What belongs to a facet is found on one side of it, that of
//! the tetrahedron of smaller id, which owns it. Cost: about 150 operations a tetrahedron, four tetrahedra at a time.

use super::four::{Four, FourVectors};
use crate::delaunay::lanes::{Lanes, Task};
use crate::delaunay::{Facet, INFINITE, Triangulation};
use crate::geometry::TetId;
use crate::geometry::circumsphere::{self, Sphere};
use crate::geometry::fixed::Grid;
use crate::geometry::predicates::{
    EPSILON, UNDERFLOW, edge_gabriel_perturbed, insphere, tri_gabriel_perturbed,
};
use glam::DVec3;
use std::ops::{Add, Sub};

/// Signs and sphere of one finite tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TetGeometry {
    /// The circumscribed sphere, in the frame of the predicates.
    pub sphere: Sphere,
    /// Bit `i`: vertex `i` lies outside the smallest ball of facet `i` (ties broken by coordinates).
    pub outside: u8,
    /// Bit `i`: the facet is owned and the vertex beyond it lies exactly on the sphere. Unset for hull facets.
    pub cospherical: u8,
    /// Four bits for each owned facet: one more than the place of the vertex with an angle that is not acute, or 0.
    pub obtuse: u16,
}

/// Relative rounding error of every quantity below, with room: none passes through more than 24 roundings, counting those
/// of the differences, of the lengths in the bound and of the bound itself.
const ERROR: f64 = 48.0 * EPSILON;

/// Geometry of the tetrahedra `first..first + spheres.len()`, in order, for [`crate::delaunay::lanes::with_lanes`]: four at a time, and one at a time what
/// their plain arithmetic leaves open. The same as [`tet_geometry`] for each.
pub(super) struct Geometries<'a> {
    pub t: &'a Triangulation,
    pub points: &'a [DVec3],
    pub grid: Grid,
    pub first: u32,
    pub spheres: &'a mut [Sphere],
    pub signs: &'a mut [Signs],
}

/// What is found for one tetrahedron besides its sphere.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Signs {
    /// [`TetGeometry::outside`] and, from bit 4, [`TetGeometry::cospherical`].
    pub signs: u8,
    /// [`TetGeometry::obtuse`].
    pub obtuse: u16,
}

impl Task for Geometries<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _lanes: L) {
        let Self {
            t,
            points,
            grid,
            mut first,
            spheres,
            signs,
        } = self;
        for (spheres, signs) in spheres.chunks_mut(4).zip(signs.chunks_mut(4)) {
            if let (Ok(spheres), Ok(signs)) = (spheres.try_into(), <&mut [Signs; 4]>::try_from(&mut *signs)) {
                four_geometries(t, points, grid, first, spheres, signs);
            } else {
                for k in 0..spheres.len() {
                    (spheres[k], signs[k]) = one_geometry(t, points, grid, TetId(first + k as u32));
                }
            }
            first += 4;
        }
    }
}

#[inline(always)]
fn four_geometries(
    t: &Triangulation,
    points: &[DVec3],
    grid: Grid,
    first: u32,
    spheres: &mut [Sphere; 4],
    signs: &mut [Signs; 4],
) {
    // Loops over indices: closures would not be compiled for the wider instructions.
    let mut corners = [[DVec3::ZERO; 4]; 4];
    for k in 0..4 {
        let v = t.tet(TetId(first + k as u32));
        for i in 0..4 {
            corners[k][i] = points[v[i].index()];
        }
    }
    let corner = |i: usize| FourVectors::new([corners[0][i], corners[1][i], corners[2][i], corners[3][i]]);
    let a = corner(0);
    let [u, v, w] = [corner(1).sub(a), corner(2).sub(a), corner(3).sub(a)];
    let (uu, vv, ww) = (u.dot(u), v.dot(v), w.dot(w));
    let (vw, wu, uv) = (v.cross(w), w.cross(u), u.cross(v));
    let det = u.dot(vw);
    let m = vw.scale(uu).add(wu.scale(vv)).add(uv.scale(ww));
    let [lu, lv, lw] = [uu.sqrt(), vv.sqrt(), ww.sqrt()];
    let volume = lu * lv * lw;
    let lengths = lu + lv + lw;
    let reach = volume * lengths;
    let [b, c, d] = [m.dot(vw), m.dot(wu), m.dot(uv)];
    let weights = [Four::all(2.0) * det * det - (b + c + d), b, c, d];
    let faces = [lv * lw, lw * lu, lu * lv];
    let bounds = [
        Four::all(4.0) * volume * volume + reach * (faces[0] + faces[1] + faces[2]),
        reach * faces[0],
        reach * faces[1],
        reach * faces[2],
    ];
    let (error, underflow, zero) = (Four::all(ERROR), Four::all(UNDERFLOW), Four::all(0.0));
    // Bit k: everything about tetrahedron k is certain.
    let mut certain = 15;
    let mut outside = [0u8; 4];
    for i in 0..4 {
        certain &= weights[i].abs().larger(error * bounds[i] + underflow);
        let bits = weights[i].larger(zero);
        for k in 0..4 {
            outside[k] |= (bits >> k & 1) << i;
        }
    }
    let mut obtuse = [0u16; 4];
    let bound = error * (uu + vv + ww) + underflow;
    let cosines = cosines([uu, vv, ww], [u.dot(v), v.dot(w), w.dot(u)]);
    for (i, (cosines, places)) in cosines.into_iter().zip(PLACES).enumerate() {
        let [x, y, z] = cosines;
        certain &= x.abs().min(y.abs()).min(z.abs()).larger(bound);
        for (cosine, place) in cosines.into_iter().zip(places) {
            let bits = u16::from(zero.larger(cosine));
            for k in 0..4 {
                obtuse[k] |= ((bits >> k & 1) * (place + 1)) << (4 * i);
            }
        }
    }
    let (offset, well) = offsets(m, det, volume, lengths);
    certain &= well;
    let centre = a.add(offset);
    let radius = offset.dot(offset).sqrt();
    for k in 0..4 {
        let tet = TetId(first + k as u32);
        if certain >> k & 1 == 0 {
            (spheres[k], signs[k]) = one_geometry(t, points, grid, tet);
            continue;
        }
        let shared = [m.get(k), DVec3::new(det.0[k], reach.0[k], volume.0[k])];
        let (cospherical, owned) = cospherical(t, points, grid, tet, corners[k], shared, lu.0[k]);
        spheres[k] = Sphere {
            centre: centre.get(k),
            radius: radius.0[k],
        };
        signs[k] = Signs {
            signs: outside[k] | cospherical << 4,
            obtuse: obtuse[k] & owned,
        };
    }
}

/// The offsets of four centres from their first corners as [`circumsphere::tetrahedron_from`] has them, and which of them
/// it would leave to the exact solve (their bits are clear).
#[inline(always)]
fn offsets(m: FourVectors, det: Four, volume: Four, lengths: Four) -> (FourVectors, u8) {
    let least = Four::all(circumsphere::WELL_CONDITIONED) * volume;
    let reach = least * lengths;
    let well = det.abs().larger(least) & m.dot(m).larger(reach * reach);
    (m.scale(Four::all(0.5).over(det)), well)
}

/// [`tet_geometry`] as it is kept.
#[cold]
#[inline(never)]
fn one_geometry(t: &Triangulation, points: &[DVec3], grid: Grid, tet: TetId) -> (Sphere, Signs) {
    let g = tet_geometry(t, points, grid, tet);
    let signs = Signs {
        signs: g.outside | g.cospherical << 4,
        obtuse: g.obtuse,
    };
    (g.sphere, signs)
}

/// Geometry of a finite tetrahedron; `points` are those of the triangulation in the frame of the predicates,
/// `grid` is theirs.
#[inline(always)]
pub(super) fn tet_geometry(t: &Triangulation, points: &[DVec3], grid: Grid, tet: TetId) -> TetGeometry {
    let ids = t.tet(tet);
    let corners = ids.map(|v| points[v.index()]);
    let a = corners[0];
    let [u, v, w] = [corners[1] - a, corners[2] - a, corners[3] - a];
    let (uu, vv, ww) = (u.length_squared(), v.length_squared(), w.length_squared());
    let (vw, wu, uv) = (v.cross(w), w.cross(u), u.cross(v));
    let det = u.dot(vw);
    let m = uu * vw + vv * wu + ww * uv;
    // Lengths bound every product from above (Cauchy-Schwarz, also for the sums of magnitudes up to the factor in ERROR).
    let [lu, lv, lw] = [uu.sqrt(), vv.sqrt(), ww.sqrt()];
    let volume = lu * lv * lw;
    let reach = volume * (lu + lv + lw);
    let [b, c, d] = [m.dot(vw), m.dot(wu), m.dot(uv)];
    let weights = [2.0 * det * det - (b + c + d), b, c, d];
    let faces = [lv * lw, lw * lu, lu * lv];
    let bounds = [
        4.0 * volume * volume + reach * (faces[0] + faces[1] + faces[2]),
        reach * faces[0],
        reach * faces[1],
        reach * faces[2],
    ];
    let mut outside = 0;
    for k in 0..4 {
        let sign = if weights[k].abs() > ERROR * bounds[k] + UNDERFLOW {
            weights[k]
        } else {
            let facet = Facet { tet, index: k as u8 };
            let [x, y, z] = t.facet_vertices(facet).map(|v| points[v.index()]);
            tri_gabriel_perturbed(x, y, z, corners[k])
        };
        outside |= u8::from(sign > 0.0) << k;
    }

    let (cospherical, owned) = cospherical(
        t,
        points,
        grid,
        tet,
        corners,
        [m, DVec3::new(det, reach, volume)],
        lu,
    );
    TetGeometry {
        sphere: circumsphere::tetrahedron_from(corners, m, det, volume, lu + lv + lw),
        outside,
        cospherical,
        obtuse: obtuse(corners, [u, v, w], [uu, vv, ww]) & owned,
    }
}

/// [`TetGeometry::cospherical`], and the mask of the owned facets in [`TetGeometry::obtuse`]; `m` and the numbers after it
/// (`det`, `reach`, `volume`) and `lu` as in [`tet_geometry`].
#[inline(always)]
fn cospherical(
    t: &Triangulation,
    points: &[DVec3],
    grid: Grid,
    tet: TetId,
    corners: [DVec3; 4],
    [m, numbers]: [DVec3; 2],
    lu: f64,
) -> (u8, u16) {
    let a = corners[0];
    let [det, reach, volume] = numbers.to_array();
    // Lists grow without branches: which facets are owned cannot be foreseen.
    let mut owned = [0u8; 5];
    let mut count = 0;
    for index in 0..4u8 {
        let facet = Facet { tet, index };
        owned[count] = index;
        count += usize::from(facet < t.mirror(facet));
    }
    let mut cospherical = 0;
    // sqrt(qq) <= (qq / lu + lu) / 2 spares a root.
    let (half, inverse) = (0.5 * lu, 0.5 / lu);
    let mut mask = 0u16;
    for &index in &owned[..count] {
        mask |= 15 << (4 * index);
        let other = t.mirror(Facet { tet, index });
        let beyond = t.tet(other.tet)[other.index as usize];
        if beyond == INFINITE {
            continue;
        }
        let p = points[beyond.index()];
        let q = p - a;
        let qq = q.length_squared();
        let power = q.dot(m) - qq * det;
        if power.abs() <= ERROR * ((qq * inverse + half) * reach + qq * volume) + UNDERFLOW {
            let [a, b, c, d] = corners;
            let side = grid
                .insphere(a, b, c, d, p)
                .unwrap_or_else(|| insphere(a, b, c, d, p));
            cospherical |= u8::from(side == 0.0) << index;
        }
    }
    (cospherical, mask)
}

/// [`TetGeometry::obtuse`] for all four facets. With `S` the sum of the three squares every cosine term below is a sum of
/// magnitudes of at most `2 S`, each term with fewer than ten roundings, so `ERROR * S` bounds its error.
#[inline(always)]
fn obtuse(corners: [DVec3; 4], [u, v, w]: [DVec3; 3], [uu, vv, ww]: [f64; 3]) -> u16 {
    let cosines = cosines([uu, vv, ww], [u.dot(v), v.dot(w), w.dot(u)]);
    let bound = ERROR * (uu + vv + ww) + UNDERFLOW;
    let mut out = 0;
    for (index, (cosines, places)) in cosines.iter().zip(PLACES).enumerate() {
        let [x, y, z] = *cosines;
        let code = if x.abs().min(y.abs()).min(z.abs()) > bound {
            // Two angles are always acute.
            let at = |c: f64, place: u16| u16::from(c < 0.0) * (place + 1);
            at(x, places[0]) + at(y, places[1]) + at(z, places[2])
        } else {
            exactly_obtuse(corners, places)
        };
        out |= code << (4 * index);
    }
    out
}

/// Products of the two edges at the three vertices of each facet, in order of their places, from `u.u, v.v, w.w` and
/// `u.v, v.w, w.u`.
#[inline(always)]
fn cosines<T>([uu, vv, ww]: [T; 3], [uv, vw, wu]: [T; 3]) -> [[T; 3]; 4]
where
    T: Copy + Add<Output = T> + Sub<Output = T>,
{
    [
        [
            (uu - uv) + (vw - wu),
            (vv - vw) + (wu - uv),
            (ww - wu) + (uv - vw),
        ],
        [vw, vv - vw, ww - vw],
        [wu, uu - wu, ww - wu],
        [uv, uu - uv, vv - uv],
    ]
}

/// Places of the vertices of each facet.
const PLACES: [[u16; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

#[cold]
#[inline(never)]
fn exactly_obtuse(corners: [DVec3; 4], places: [u16; 3]) -> u16 {
    let corner = |i: usize| corners[places[i % 3] as usize];
    (0..3)
        .find(|&i| edge_gabriel_perturbed(corner(i + 1), corner(i + 2), corner(i)) < 0.0)
        .map_or(0, |i| places[i] + 1)
}
