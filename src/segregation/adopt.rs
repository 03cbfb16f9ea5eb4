//! Points just off the surface are taken onto it.
//!
//! In: manifold labels and local spacing. Out: labels of the same topology with fewer points strictly inside or outside.
//! A point whose whole star has one label, one of whose tetrahedra has its opposite facet on the surface, joins by flipping
//! that tetrahedron: one triangle becomes three, one vertex more, the Euler number is unchanged and the surface stays a
//! manifold. Only when the point is within half a spacing of that facet; the nearest such facet is used.

use super::stars::{StarBuffer, Stars};
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::{TetId, VertexId};

/// Height over the facet, in local spacings, up to which a point is taken in.
const REACH: f64 = 0.5;

/// Which points lie on no surface triangle.
pub fn points_off(triangulation: &Triangulation, inside: &[bool]) -> Vec<bool> {
    let mut off = vec![true; triangulation.points.len()];
    for facet in super::labels::boundary_facets(triangulation, inside) {
        for v in triangulation.facet_vertices(facet) {
            off[v.index()] = false;
        }
    }
    off
}

/// Takes near points in; returns how many.
pub fn adopt_points(triangulation: &Triangulation, spacing_mm: &[f64], inside: &mut [bool]) -> usize {
    let off: Vec<VertexId> = points_off(triangulation, inside)
        .iter()
        .enumerate()
        .filter(|(_, off)| **off)
        .map(|(v, _)| VertexId::from_index(v))
        .collect();
    if off.is_empty() {
        return 0;
    }
    let stars = Stars::new(triangulation);
    let mut star = StarBuffer::default();
    let mut adopted = 0;
    for v in off {
        stars.collect(triangulation, v, &mut star);
        // An earlier flip may have brought it onto the surface already.
        let label = star.tets.first().is_some_and(|t| inside[t.index()]);
        if star.tets.iter().any(|t| inside[t.index()] != label) {
            continue;
        }
        let nearest = star
            .tets
            .iter()
            .filter_map(|&tet| candidate(triangulation, inside, tet, v))
            .min_by(|a, b| a.height_mm.total_cmp(&b.height_mm).then(a.tet.cmp(&b.tet)));
        if let Some(c) = nearest
            && c.height_mm <= REACH * spacing_mm[v.index()]
        {
            inside[c.tet.index()] = !inside[c.tet.index()];
            adopted += 1;
        }
    }
    adopted
}

struct Candidate {
    tet: TetId,
    height_mm: f64,
}

/// A finite tetrahedron at `v` whose facet opposite `v`, and no other, is on the surface.
fn candidate(triangulation: &Triangulation, inside: &[bool], tet: TetId, v: VertexId) -> Option<Candidate> {
    if !triangulation.is_finite(tet) {
        return None;
    }
    let place = triangulation.tet(tet).iter().position(|w| *w == v)?;
    let label = inside[tet.index()];
    if inside[triangulation.neighbour(tet, place).index()] == label {
        return None;
    }
    let [a, b, c] = triangulation
        .facet_vertices(Facet {
            tet,
            index: place as u8,
        })
        .map(|w| triangulation.points[w.index()]);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    Some(Candidate {
        tet,
        height_mm: (triangulation.points[v.index()] - a).dot(normal).abs(),
    })
}
