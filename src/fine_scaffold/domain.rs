//! The open part of space whose scaffold is made: which tetrahedra belong to it, and which triangles shut them off from each other.
//!
//! In: the triangulation, the segregation, the side. Out: [`Domain`].
//!
//! * Interior: the tetrahedra inside.
//! * Exterior: those of the hull that are not.
//! * Joined, for an open surface, which has no inside: the whole hull. One gets from one side of the surface to the other round its
//!   rims and through its holes, so the two scaffolds are one.
//!
//! The facets of the surface are walls. Towards infinity the axis of the outside has no end; `carve` ends it.
//!
//! The dual of the simplices that lie in no wall and not on the boundary is a deformation retract of the domain, whatever the walls: a
//! complex less a closed subcomplex retracts to the dual of the rest (Munkres, Elements of Algebraic Topology, section 70). Cost
//! `O(tetrahedra)` and a hash table of the surface's triangles.

use super::build::{FineScaffoldError, Side};
use super::carve::carve;
use crate::delaunay::triangulation::INFINITE;
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::{TetId, VertexId};
use crate::segregation::Segregation;
use std::collections::HashSet;

/// An open union of tetrahedra, less walls.
#[derive(Clone, Debug)]
pub struct Domain {
    side: Side,
    of_side: Vec<bool>,
    /// One bit a facet of the surface; empty for the interior, where every facet that leads out is one.
    walls: Vec<u8>,
}

impl Domain {
    /// The domain of one side.
    ///
    /// # Errors
    /// [`FineScaffoldError`]: an open surface asked for one side, labels of another triangulation, surface triangles that are not
    /// in the triangulation.
    ///
    /// # Complexity
    /// `O(tetrahedra)`.
    pub fn new(
        triangulation: &Triangulation,
        segregation: &Segregation,
        side: Side,
    ) -> Result<Self, FineScaffoldError> {
        if side == Side::Joined {
            return Self::joined(triangulation, segregation);
        }
        if segregation.inside.is_empty() && triangulation.num_tets() > 0 {
            return Err(FineScaffoldError::Open);
        }
        if segregation.inside.len() != triangulation.num_tets() {
            return Err(FineScaffoldError::Labels {
                labels: segregation.inside.len(),
                tets: triangulation.num_tets(),
            });
        }
        if side == Side::Interior {
            return Ok(Self {
                side,
                of_side: segregation.inside.clone(),
                walls: Vec::new(),
            });
        }
        let inside = |tet: TetId| segregation.is_inside(tet);
        let walls = walls_where(triangulation, |facet| {
            inside(facet.tet) != inside(triangulation.mirror(facet).tet)
        });
        Ok(Self::outside(triangulation, side, walls, |tet| !inside(tet)))
    }

    fn joined(triangulation: &Triangulation, segregation: &Segregation) -> Result<Self, FineScaffoldError> {
        let surface: HashSet<[VertexId; 3]> = segregation.triangles.iter().map(|&t| sorted(t)).collect();
        let mut found = 0;
        let walls = walls_where(triangulation, |facet| {
            let is_wall = surface.contains(&sorted(triangulation.facet_vertices(facet)));
            found += usize::from(is_wall);
            is_wall
        });
        if found + segregation.loose < surface.len() {
            return Err(FineScaffoldError::Surface {
                missing: surface.len() - found,
                triangles: surface.len(),
            });
        }
        Ok(Self::outside(triangulation, Side::Joined, walls, |_| true))
    }

    /// The part of the hull that `has` says, carved.
    fn outside(
        triangulation: &Triangulation,
        side: Side,
        walls: Vec<u8>,
        has: impl Fn(TetId) -> bool,
    ) -> Self {
        let of_side = triangulation
            .tets()
            .map(|tet| triangulation.is_finite(tet) && has(tet))
            .collect();
        let mut domain = Self { side, of_side, walls };
        carve(triangulation, &mut domain);
        domain
    }

    /// The side.
    pub fn side(&self) -> Side {
        self.side
    }

    /// Whether a tetrahedron is of the domain.
    #[inline]
    pub fn has(&self, tet: TetId) -> bool {
        self.of_side[tet.index()]
    }

    /// Whether a facet is a wall.
    #[inline]
    pub fn is_wall(&self, facet: Facet) -> bool {
        self.walls
            .get(facet.tet.index())
            .is_some_and(|bits| bits >> facet.index & 1 == 1)
    }

    /// The tetrahedron that one gets to through a facet of a tetrahedron of the domain, if any.
    #[inline]
    pub fn beyond(&self, triangulation: &Triangulation, facet: Facet) -> Option<Facet> {
        let mirror = triangulation.mirror(facet);
        (self.has(mirror.tet) && !self.is_wall(facet)).then_some(mirror)
    }

    /// Whether a facet is of the surface.
    pub fn on_surface(&self, triangulation: &Triangulation, facet: Facet) -> bool {
        match self.side {
            Side::Interior => self.has(facet.tet) != self.has(triangulation.mirror(facet).tet),
            Side::Exterior | Side::Joined => self.is_wall(facet),
        }
    }

    /// The generators on the boundary of the domain or on a wall: those that some tetrahedron or wall takes out of its interior.
    pub fn bounding_generators(&self, triangulation: &Triangulation) -> Vec<bool> {
        let mut bounding = vec![false; triangulation.points.len()];
        for t in triangulation.tets() {
            for (place, v) in triangulation.tet(t).into_iter().enumerate() {
                let on_wall =
                    || (0..4u8).any(|index| index as usize != place && self.is_wall(Facet { tet: t, index }));
                if v != INFINITE && (!self.has(t) || on_wall()) {
                    bounding[v.index()] = true;
                }
            }
        }
        bounding
    }

    /// Takes a tetrahedron out.
    pub(super) fn drop(&mut self, tet: TetId) {
        self.of_side[tet.index()] = false;
    }
}

/// One bit for each side of each facet that is a wall.
fn walls_where(triangulation: &Triangulation, mut is_wall: impl FnMut(Facet) -> bool) -> Vec<u8> {
    let mut walls = vec![0u8; triangulation.num_tets()];
    for facet in triangulation.facets() {
        if is_wall(facet) {
            let mirror = triangulation.mirror(facet);
            walls[facet.tet.index()] |= 1 << facet.index;
            walls[mirror.tet.index()] |= 1 << mirror.index;
        }
    }
    walls
}

fn sorted(mut triangle: [VertexId; 3]) -> [VertexId; 3] {
    triangle.sort_unstable();
    triangle
}
