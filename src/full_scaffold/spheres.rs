//! One tetrahedron at a time: its sphere, on which side of each facet the centre lies, which neighbours share the sphere.
//!
//! In: a triangulation. Out: [`TetGeometry`] for each finite tetrahedron. With `u, v, w` from the first corner to the others,
//! `m = |u|^2 v x w + |v|^2 w x u + |w|^2 u x v` and `det = u . v x w` the centre is `m / (2 det)` from that corner, its
//! barycentric coordinates are `m . (v x w) / (2 det^2)` and so on, and a point `q` (from that corner) lies inside the sphere
//! when `q . m > |q|^2 det`. All signs come from these shared quantities when they clear a forward error bound and from the
//! exact predicates when not: the barycentric coordinate of a vertex is positive exactly when the vertex lies outside the
//! smallest ball of the opposite facet (Leymarie & Kimia 2007, where this tells the four types of A1^3 shocks apart).
//! Cost: about 150 operations a tetrahedron.

use crate::delaunay::{Facet, INFINITE, Triangulation};
use crate::geometry::TetId;
use crate::geometry::circumsphere::{self, Sphere};
use crate::geometry::fixed::Grid;
use crate::geometry::predicates::{EPSILON, UNDERFLOW, insphere, tri_gabriel_perturbed};
use glam::DVec3;

/// Signs and sphere of one finite tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TetGeometry {
    /// The circumscribed sphere, in the frame of the predicates.
    pub sphere: Sphere,
    /// Bit `i`: vertex `i` lies outside the smallest ball of facet `i` (ties broken by coordinates).
    pub outside: u8,
    /// Bit `i`: the vertex beyond facet `i` lies exactly on the sphere. Unset for hull facets.
    pub cospherical: u8,
}

/// Relative rounding error of every quantity below, with room: none passes through more than 24 roundings, counting those
/// of the differences, of the lengths in the bound and of the bound itself.
const ERROR: f64 = 48.0 * EPSILON;

/// Geometry of a finite tetrahedron; `points` are those of the triangulation in the frame of the predicates,
/// `grid` is theirs.
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
    let mut cospherical = 0;
    for k in 0..4 {
        let facet = Facet { tet, index: k as u8 };
        let sign = if weights[k].abs() > ERROR * bounds[k] + UNDERFLOW {
            weights[k]
        } else {
            let [x, y, z] = t.facet_vertices(facet).map(|v| points[v.index()]);
            tri_gabriel_perturbed(x, y, z, corners[k])
        };
        outside |= u8::from(sign > 0.0) << k;
        let other = t.mirror(facet);
        let beyond = t.tet(other.tet)[other.index as usize];
        if beyond != INFINITE {
            let p = points[beyond.index()];
            let q = p - a;
            let qq = q.length_squared();
            let power = q.dot(m) - qq * det;
            if power.abs() <= ERROR * (qq.sqrt() * reach + qq * volume) + UNDERFLOW {
                let [a, b, c, d] = corners;
                let side = grid
                    .insphere(a, b, c, d, p)
                    .unwrap_or_else(|| insphere(a, b, c, d, p));
                cospherical |= u8::from(side == 0.0) << k;
            }
        }
    }
    TetGeometry {
        sphere: circumsphere::tetrahedron_from(corners, m, det, volume, lu + lv + lw),
        outside,
        cospherical,
    }
}
