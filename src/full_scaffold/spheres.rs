//! One tetrahedron at a time: its sphere, on which side of each facet the centre lies, which angles are not acute.
//!
//! In: a triangulation. Out: [`Sphere`], [`Signs`] and obtuse angles of each finite tetrahedron. With `u, v, w` from the first corner to the others,
//! `m = |u|^2 v x w + |v|^2 w x u + |w|^2 u x v` and `det = u . v x w` the centre is `m / (2 det)` from that corner, its
//! barycentric coordinates are `m . (v x w) / (2 det^2)` and so on, and a point `q` (from that corner) lies inside the sphere
//! when `q . m > |q|^2 det`. The angles of the four facets come from the six products of `u, v, w`. All signs come from these
//! shared quantities when they clear a forward error bound and from the exact predicates when not: the barycentric coordinate
//! of a vertex is positive exactly when the vertex lies outside the smallest ball of the opposite facet (Leymarie & Kimia
//! 2007, where this tells the four types of A1^3 shocks apart). Nothing here looks at a neighbour, which would be far away in
//! memory: whether two spheres coincide is asked later, and only when their radii agree in their leading bits. Cost: about 120
//! operations a tetrahedron, four tetrahedra at a time.

use super::four::{Four, FourVectors};
use crate::delaunay::lanes::{Lanes, Task};
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::TetId;
use crate::geometry::circumsphere::{self, Sphere};
use crate::geometry::fixed::Grid;
use crate::geometry::predicates::{
    EPSILON, UNDERFLOW, edge_gabriel_perturbed, exact_on_lattice, insphere, tri_gabriel_perturbed,
};
use glam::DVec3;
use std::ops::{Add, Sub};

/// Relative rounding error of every quantity below, with room: none passes through more than 24 roundings, counting those
/// of the differences, of the lengths in the bound and of the bound itself.
const ERROR: f64 = 48.0 * EPSILON;

/// Geometry of the tetrahedra `first..first + spheres.len()`, in order, for [`crate::delaunay::lanes::with_lanes`]: four at a
/// time, and one at a time what their plain arithmetic leaves open. The same as [`one_geometry`] for each.
pub(super) struct Geometries<'a> {
    pub t: &'a Triangulation,
    /// Points of the triangulation in the frame of the predicates.
    pub points: &'a [DVec3],
    pub first: u32,
    /// Circumscribed spheres, in the frame of the predicates.
    pub spheres: &'a mut [Sphere],
    pub signs: &'a mut [Signs],
    /// For each facet four bits, one more than the place of the vertex with an angle that is not acute, or 0.
    pub obtuse: &'a mut [u16],
}

/// What a neighbour is asked for, in as few bits as will do, because neighbours are far away in memory: bit `i`, vertex `i` lies
/// outside the smallest ball of facet `i` (ties broken by coordinates); from bit 4, leading bits of the radius, wrapped around.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Signs(u16);

impl Signs {
    /// Values that the bits of a radius take; the next one stands for radii that overflowed.
    const RADII: u32 = 4095;

    fn new(radius: f64, outside: u8) -> Self {
        let leading = (radius.to_bits() >> 32) as u32;
        let wrapped = if radius.is_finite() {
            leading % Self::RADII
        } else {
            Self::RADII
        };
        Self((wrapped << 4) as u16 | u16::from(outside))
    }

    /// The four signs.
    #[inline(always)]
    pub(super) fn outside(self) -> u8 {
        self.0 as u8 & 15
    }

    /// Whether two spheres may be the same. Radii are right to `6e-11` (see [`circumsphere`]) unless they overflow, and the
    /// leading bits have steps of `2^-20`, so those of equal spheres differ by one at most.
    #[inline(always)]
    pub(super) fn may_coincide(self, other: Self) -> bool {
        let (a, b) = (u32::from(self.0 >> 4), u32::from(other.0 >> 4));
        let apart = a.abs_diff(b);
        (apart <= 1) | (apart == Self::RADII - 1) | (a.max(b) == Self::RADII)
    }
}

impl Task for Geometries<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            t,
            points,
            mut first,
            spheres,
            signs,
            obtuse,
        } = self;
        let fours = spheres
            .chunks_mut(4)
            .zip(signs.chunks_mut(4))
            .zip(obtuse.chunks_mut(4));
        for ((spheres, signs), obtuse) in fours {
            if let (Ok(spheres), Ok(signs), Ok(obtuse)) = (
                spheres.try_into(),
                <&mut [Signs; 4]>::try_from(&mut *signs),
                <&mut [u16; 4]>::try_from(&mut *obtuse),
            ) {
                four_geometries(lanes, t, points, first, spheres, signs, obtuse);
            } else {
                for k in 0..spheres.len() {
                    (spheres[k], signs[k], obtuse[k]) = one_geometry(t, points, TetId(first + k as u32));
                }
            }
            first += 4;
        }
    }
}

#[inline(always)]
fn four_geometries<L: Lanes>(
    lanes: L,
    t: &Triangulation,
    points: &[DVec3],
    first: u32,
    spheres: &mut [Sphere; 4],
    signs: &mut [Signs; 4],
    obtuse_out: &mut [u16; 4],
) {
    // Loops over indices: closures would not be compiled for the wider instructions.
    let mut corners = [[DVec3::ZERO; 4]; 4];
    for k in 0..4 {
        let v = t.tet(TetId(first + k as u32));
        for i in 0..4 {
            corners[k][i] = points[v[i].index()];
        }
    }
    let corner = |i: usize| {
        FourVectors::new(
            lanes,
            [corners[0][i], corners[1][i], corners[2][i], corners[3][i]],
        )
    };
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
    let weights = [Four::all(lanes, 2.0) * det * det - (b + c + d), b, c, d];
    let faces = [lv * lw, lw * lu, lu * lv];
    let bounds = [
        Four::all(lanes, 4.0) * volume * volume + reach * (faces[0] + faces[1] + faces[2]),
        reach * faces[0],
        reach * faces[1],
        reach * faces[2],
    ];
    let (error, underflow, zero) = (
        Four::all(lanes, ERROR),
        Four::all(lanes, UNDERFLOW),
        Four::all(lanes, 0.0),
    );
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
    let (offset, well) = offsets(lanes, m, det, volume, lengths);
    certain &= well;
    let centre = a.add(offset);
    let radius = offset.dot(offset).sqrt().array();
    let [x, y, z] = [centre.x, centre.y, centre.z].map(Four::array);
    for k in 0..4 {
        let tet = TetId(first + k as u32);
        if certain >> k & 1 == 0 {
            (spheres[k], signs[k], obtuse_out[k]) = one_geometry(t, points, tet);
            continue;
        }
        spheres[k] = Sphere {
            centre: DVec3::new(x[k], y[k], z[k]),
            radius: radius[k],
        };
        signs[k] = Signs::new(radius[k], outside[k]);
        obtuse_out[k] = obtuse[k];
    }
}

/// The offsets of four centres from their first corners as [`circumsphere::tetrahedron_from`] has them, and which of them
/// it would leave to the exact solve (their bits are clear).
#[inline(always)]
fn offsets<L: Lanes>(
    lanes: L,
    m: FourVectors<L>,
    det: Four<L>,
    volume: Four<L>,
    lengths: Four<L>,
) -> (FourVectors<L>, u8) {
    let least = Four::all(lanes, circumsphere::WELL_CONDITIONED) * volume;
    let reach = least * lengths;
    let well = det.abs().larger(least) & m.dot(m).larger(reach * reach);
    (m.scale(Four::all(lanes, 0.5) / det), well)
}

/// Geometry of one finite tetrahedron.
#[cold]
#[inline(never)]
fn one_geometry(t: &Triangulation, points: &[DVec3], tet: TetId) -> (Sphere, Signs, u16) {
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

    let sphere = circumsphere::tetrahedron_from(corners, m, det, volume, lu + lv + lw);
    let obtuse = obtuse(corners, [u, v, w], [uu, vv, ww]);
    (sphere, Signs::new(sphere.radius, outside), obtuse)
}

/// Whether a point lies on the sphere through four others, exactly; `grid` is theirs.
pub(super) fn cospherical(grid: Grid, corners: [DVec3; 4], p: DVec3) -> bool {
    let [a, b, c, d] = corners;
    let [u, v, w, q] = [b - a, c - a, d - a, p - a];
    let (uu, vv, ww, qq) = (
        u.length_squared(),
        v.length_squared(),
        w.length_squared(),
        q.length_squared(),
    );
    let vw = v.cross(w);
    let m = uu * vw + vv * w.cross(u) + ww * u.cross(v);
    let [lu, lv, lw, lq] = [uu.sqrt(), vv.sqrt(), ww.sqrt(), qq.sqrt()];
    let volume = lu * lv * lw;
    let power = q.dot(m) - qq * u.dot(vw);
    let bound = ERROR * volume * (lq * (lu + lv + lw) + qq) + UNDERFLOW;
    if power.abs() > bound {
        return false;
    }
    // Of degree five, with fewer than 2^7 terms.
    if exact_on_lattice(&[(b, a, u), (c, a, v), (d, a, w), (p, a, q)], 9) {
        return power == 0.0;
    }
    grid.insphere(a, b, c, d, p)
        .unwrap_or_else(|| insphere(a, b, c, d, p))
        == 0.0
}

/// [`Geometries::obtuse`] for all four facets. With `S` the sum of the three squares every cosine term below is a sum of
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
