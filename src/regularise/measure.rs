//! Coordinates enter here: lengths of the fine scaffold's elements, and the tolerance at each of them.

use super::parts::part_radii;
use crate::fine_scaffold::FineScaffold;
use crate::geometry::Length;
use glam::DVec3;
use rayon::prelude::*;

/// What the simplification needs to know of the geometry.
#[derive(Clone, Debug)]
pub(crate) struct Measure {
    /// Midpoint of each edge.
    pub edge_middle: Vec<DVec3>,
    /// Mean signed radius of an edge's ends.
    pub edge_radius: Vec<f64>,
    /// Mean of each facet's ring.
    pub facet_centre: Vec<DVec3>,
    /// Mean signed radius of a facet's ring.
    pub facet_radius: Vec<f64>,
    /// Area of each facet.
    pub facet_area: Vec<f64>,
    /// Tolerance at each place.
    pub tolerance: Tolerance,
}

/// The tolerance in mm: one number, or a multiple of the radius of the part of the solid that a place belongs to.
#[derive(Clone, Debug)]
pub(crate) struct Tolerance {
    everywhere_mm: f64,
    /// One value a vertex, mm; none when the tolerance is the same everywhere.
    at_vertex_mm: Vec<f64>,
}

impl Tolerance {
    /// Relative to the radius it is a share of [`part_radii`], but never below a spacing, under which there is only sampling.
    pub fn new(length: Length, fine: &FineScaffold) -> Self {
        let at_vertex_mm: Vec<f64> = match length {
            Length::LocalRadii(_) => part_radii(fine)
                .into_iter()
                .map(|radius| length.to_mm(fine.scale, radius).max(fine.scale.spacing_mm))
                .collect(),
            _ => Vec::new(),
        };
        let inside = at_vertex_mm.iter().zip(&fine.vertex_outside);
        let largest = inside
            .filter(|(_, outside)| !**outside)
            .map(|(t, _)| *t)
            .fold(0.0, f64::max);
        Self {
            everywhere_mm: if at_vertex_mm.is_empty() {
                length.to_mm(fine.scale, 0.0)
            } else {
                largest
            },
            at_vertex_mm,
        }
    }

    /// The largest there is, mm.
    pub fn largest(&self) -> f64 {
        self.everywhere_mm
    }

    /// At a vertex, mm.
    #[inline]
    pub fn at(&self, vertex: u32) -> f64 {
        if self.at_vertex_mm.is_empty() {
            self.everywhere_mm
        } else {
            self.at_vertex_mm[vertex as usize]
        }
    }

    /// The mean over some vertices, mm.
    pub fn over(&self, vertices: &[u32]) -> f64 {
        if self.at_vertex_mm.is_empty() || vertices.is_empty() {
            return self.everywhere_mm;
        }
        vertices.iter().map(|&v| self.at(v)).sum::<f64>() / vertices.len() as f64
    }

    /// The largest over the vertices of some facets, mm.
    pub fn of_facets(&self, fine: &FineScaffold, facets: &[u32]) -> f64 {
        if self.at_vertex_mm.is_empty() {
            return self.everywhere_mm;
        }
        let vertices = facets.iter().flat_map(|&f| fine.facet_vertices(f as usize));
        vertices.map(|&v| self.at(v)).fold(0.0, f64::max)
    }
}

impl Measure {
    pub fn new(fine: &FineScaffold, tolerance: Tolerance) -> Self {
        let edges: Vec<(DVec3, f64)> = fine
            .edge_vertices
            .par_iter()
            .map(|&[a, b]| {
                (
                    0.5 * (fine.vertex_position[a as usize] + fine.vertex_position[b as usize]),
                    0.5 * (fine.signed_radius(a as usize) + fine.signed_radius(b as usize)),
                )
            })
            .collect();
        let facets: Vec<(DVec3, f64, f64)> = (0..fine.num_facets())
            .into_par_iter()
            .map(|f| {
                let ring = fine.facet_vertices(f);
                let mut centre = DVec3::ZERO;
                let mut radius = 0.0;
                for &v in ring {
                    centre += fine.vertex_position[v as usize];
                    radius += fine.signed_radius(v as usize);
                }
                centre /= ring.len() as f64;
                let mut normal = DVec3::ZERO;
                for k in 0..ring.len() {
                    let a = fine.vertex_position[ring[k] as usize] - centre;
                    let b = fine.vertex_position[ring[(k + 1) % ring.len()] as usize] - centre;
                    normal += a.cross(b);
                }
                (centre, radius / ring.len() as f64, 0.5 * normal.length())
            })
            .collect();
        Self {
            edge_middle: edges.iter().map(|e| e.0).collect(),
            edge_radius: edges.iter().map(|e| e.1).collect(),
            facet_centre: facets.iter().map(|f| f.0).collect(),
            facet_radius: facets.iter().map(|f| f.1).collect(),
            facet_area: facets.iter().map(|f| f.2).collect(),
            tolerance,
        }
    }
}
