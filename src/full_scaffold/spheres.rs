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
//! the tetrahedron of smaller id, which owns it. Cost: about 150 operations a tetrahedron.

use crate::delaunay::{Facet, INFINITE, Triangulation};
use crate::geometry::TetId;
use crate::geometry::circumsphere::{self, Sphere};
use crate::geometry::fixed::Grid;
use crate::geometry::predicates::{
    EPSILON, UNDERFLOW, edge_gabriel_perturbed, insphere, tri_gabriel_perturbed,
};
use glam::DVec3;

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
    TetGeometry {
        sphere: circumsphere::tetrahedron_from(corners, m, det, volume, lu + lv + lw),
        outside,
        cospherical,
        obtuse: obtuse(corners, [u, v, w], [uu, vv, ww]) & mask,
    }
}

/// [`TetGeometry::obtuse`] for all four facets. With `S` the sum of the three squares every cosine term below is a sum of
/// magnitudes of at most `2 S`, each term with fewer than ten roundings, so `ERROR * S` bounds its error.
#[inline(always)]
fn obtuse(corners: [DVec3; 4], [u, v, w]: [DVec3; 3], [uu, vv, ww]: [f64; 3]) -> u16 {
    let (uv, vw, wu) = (u.dot(v), v.dot(w), w.dot(u));
    // At the three vertices of each facet, in order of their places.
    let cosines = [
        [
            (uu - uv) + (vw - wu),
            (vv - vw) + (wu - uv),
            (ww - wu) + (uv - vw),
        ],
        [vw, vv - vw, ww - vw],
        [wu, uu - wu, ww - wu],
        [uv, uu - uv, vv - uv],
    ];
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
