//! Where the scaffold of the outside ends.
//!
//! In: a domain that reaches to the hull: the exterior, or both sides of an open surface joined. Out: the same with fewer
//! tetrahedra.
//!
//! The medial axis of the outside reaches to infinity, and the hull cuts it where it happens to: in the flat tetrahedra between a
//! shallow dent and the hull, balls grow without bound and say where the hull is, not how the shape is. On a hand of 10 000 points
//! their centres lie up to 10^14 diagonals away, and hundreds of pockets of a few tetrahedra each hang about the shape.
//!
//! 1. From the hull inwards, tetrahedra go whose ball is larger than a quarter of the diagonal (0.4 about an open surface), or touches the shape within a
//!    small part of itself only: the longest edge less than a fifth of its diameter (an object angle of 23 degrees). The first is an alpha shape
//!    (Edelsbrunner and Muecke, ACM Transactions on Graphics 13, 1994); the second leaves out dents less than about a
//!    twentieth as deep as wide. What no such ball reaches from outside stays, whatever its size.
//! 2. Pockets go whose mean depth, volume over the area of their lids, is below a thousandth of the diagonal.
//!
//! Which part of the outside has a scaffold is thereby a choice, and its Betti numbers are those of what is left. Cost `O(t)`.

use super::build::Side;
use super::domain::Domain;
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::mesh::{DisjointSets, bounds};
use crate::geometry::{TetId, circumsphere};

/// Radius of the largest ball about an open surface, in diagonals of the generators' box: more than the third that the ball of a hemisphere has.
const LARGEST_JOINED_DIAG: f64 = 0.4;

/// The same outside a solid. With less, strips of tetrahedra along valleys are left, whose scaffold zigzags; with more, centres scatter with the sampling.
const LARGEST_EXTERIOR_DIAG: f64 = 0.25;

/// Least length of a tetrahedron's longest edge, in diameters of its ball.
const LEAST_SPREAD: f64 = 0.2;

/// Mean depth below which a pocket is left out, in diagonals. On a hand and a face of 10 000 points the pockets under the hull are at most 0.05 %
/// deep, but for the one that counts, 0.9 % and 4 %.
const SHALLOWEST_POCKET_DIAG: f64 = 0.001;

/// Takes tetrahedra out of the domain.
pub(super) fn carve(triangulation: &Triangulation, domain: &mut Domain) {
    let diagonal_mm = bounds(&triangulation.points).map_or(0.0, |[lo, hi]| (hi - lo).length());
    let largest_diag = match domain.side() {
        Side::Joined => LARGEST_JOINED_DIAG,
        Side::Interior | Side::Exterior => LARGEST_EXTERIOR_DIAG,
    };
    roll_from_outside(triangulation, domain, largest_diag * diagonal_mm);
    leave_out_pockets(triangulation, domain, SHALLOWEST_POCKET_DIAG * diagonal_mm);
}

/// Takes out, from the hull inwards, what a large ball reaches.
fn roll_from_outside(triangulation: &Triangulation, domain: &mut Domain, limit_mm: f64) {
    let goes = |tet: TetId| {
        let corners = triangulation.corners(tet);
        let radius_mm = circumsphere::tetrahedron(corners).radius;
        let longest_mm = (1..4)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| corners[i].distance(corners[j]))
            .fold(0.0, f64::max);
        // A tetrahedron too flat for a radius has the largest of all.
        radius_mm.is_nan() || radius_mm > limit_mm || longest_mm < LEAST_SPREAD * 2.0 * radius_mm
    };
    let under_hull =
        |tet: TetId| (0..4).any(|index| !triangulation.is_finite(triangulation.neighbour(tet, index)));
    let mut front: Vec<TetId> = triangulation
        .finite_tets()
        .filter(|&tet| domain.has(tet) && under_hull(tet) && goes(tet))
        .collect();
    while let Some(tet) = front.pop() {
        if !domain.has(tet) {
            continue;
        }
        let around = (0..4u8).filter_map(|index| domain.beyond(triangulation, Facet { tet, index }));
        front.extend(around.map(|mirror| mirror.tet).filter(|&next| goes(next)));
        domain.drop(tet);
    }
}

/// A component of the domain.
#[derive(Clone, Copy, Debug, Default)]
struct Pocket {
    volume_mm3: f64,
    lid_mm2: f64,
}

fn leave_out_pockets(triangulation: &Triangulation, domain: &mut Domain, shallow_mm: f64) {
    let tets: Vec<TetId> = triangulation.finite_tets().filter(|&t| domain.has(t)).collect();
    let mut parts = DisjointSets::new(triangulation.num_finite());
    for &tet in &tets {
        for index in 0..4u8 {
            if let Some(next) = domain.beyond(triangulation, Facet { tet, index }) {
                parts.union(tet.0, next.tet.0);
            }
        }
    }
    let mut pockets = vec![Pocket::default(); triangulation.num_finite()];
    for &tet in &tets {
        let pocket = &mut pockets[parts.find(tet.0) as usize];
        let [a, b, c, d] = triangulation.corners(tet);
        pocket.volume_mm3 += (b - a).cross(c - a).dot(d - a).abs() / 6.0;
        for index in 0..4u8 {
            let facet = Facet { tet, index };
            if !domain.is_wall(facet) && domain.beyond(triangulation, facet).is_none() {
                let [a, b, c] = triangulation
                    .facet_vertices(facet)
                    .map(|v| triangulation.points[v.index()]);
                pocket.lid_mm2 += 0.5 * (b - a).cross(c - a).length();
            }
        }
    }
    for &tet in &tets {
        let pocket = pockets[parts.find(tet.0) as usize];
        if pocket.volume_mm3 < shallow_mm * pocket.lid_mm2 {
            domain.drop(tet);
        }
    }
}
