//! Coordinates enter here: lengths of the fine scaffold's elements, and the tolerance at each of them.

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
    /// Tolerance by the radius it is used at.
    pub tolerance: Tolerance,
}

/// The tolerance in mm: one number, or a multiple of the local radius.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    length: Length,
    scale: crate::geometry::LengthScale,
}

impl Tolerance {
    pub fn new(length: Length, fine: &FineScaffold) -> Self {
        Self {
            length,
            scale: fine.scale,
        }
    }

    /// Tolerance at a medial point of the given radius, mm; relative to the radius it is never below a spacing, under which
    /// there is only sampling.
    #[inline]
    pub fn at(&self, radius_mm: f64) -> f64 {
        let tau = self.length.to_mm(self.scale, radius_mm.abs());
        match self.length {
            Length::LocalRadii(_) => tau.max(self.scale.spacing_mm),
            _ => tau,
        }
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
