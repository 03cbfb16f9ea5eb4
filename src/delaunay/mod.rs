//! Delaunay: the canonical 3D Delaunay triangulation of the generators, by exact predicates.
//!
//! In: distinct finite points in lexicographic coordinate order. Out: [`Triangulation`], a function of the point *set*
//! alone: cospherical ties are broken by coordinates, tetrahedra are numbered canonically, so no order of insertion and no
//! thread count can be seen in the result.
//!
//! Steps, one file each: [`door`] checks, sorts and merges the points; `order` arranges them in randomised rounds along a
//! Hilbert curve; `insertion` adds them one by one; `canonical` renumbers. Points that do not span space are no error:
//! [`Triangulation::dimension`] says so and there are no tetrahedra.

mod canonical;
pub mod door;
mod insertion;
mod order;
pub mod triangulation;

pub use door::{DelaunayError, Generators, prepare};
pub use triangulation::{Facet, INFINITE, Triangulation};

use crate::geometry::predicates::{collinear, orient3d};
use door::Frame;
use glam::DVec3;
use insertion::Builder;
use serde::{Deserialize, Serialize};

/// Settings of [`delaunay`]. They change the time, never the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct DelaunaySettings {
    /// Threads that insert points; 0 takes as many as the current rayon pool has.
    pub threads: usize,
}

/// The canonical Delaunay triangulation of points in any order; equal points count once (see [`prepare`] for the map).
///
/// # Errors
/// [`DelaunayError`] when a coordinate is not finite or the magnitudes are too far apart for exact tests.
///
/// # Complexity
/// Expected `O(n log n)` for points spread evenly or on surfaces.
///
/// # Example
/// ```
/// # use glam::DVec3;
/// # use medial_scaffold::delaunay::{delaunay, DelaunaySettings};
/// let corners: Vec<DVec3> = (0..8).map(|i| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64)).collect();
/// let t = delaunay(&corners, &DelaunaySettings::default())?;
/// assert_eq!((t.dimension, t.num_finite()), (3, 6));
/// # Ok::<(), medial_scaffold::delaunay::DelaunayError>(())
/// ```
pub fn delaunay(points: &[DVec3], _settings: &DelaunaySettings) -> Result<Triangulation, DelaunayError> {
    let points = door::distinct(points)?;
    let frame = Frame::of(&points)?;
    let normalised: Vec<DVec3> = points.iter().map(|&p| frame.apply(p)).collect();
    let bounds = crate::geometry::mesh::bounds(&normalised).unwrap_or_default();
    let order = order::insertion_order(&normalised, bounds);
    let inserted: Vec<DVec3> = order.iter().map(|&i| normalised[i as usize]).collect();
    let first = match first_simplex(&inserted) {
        Simplex::Tetrahedron(first) => first,
        Simplex::Flat(dimension) => {
            return Ok(Triangulation {
                points,
                dimension,
                ..Triangulation::default()
            });
        }
    };
    let mut builder = Builder::new(&inserted, first);
    for v in (0..inserted.len() as u32).filter(|v| !first.contains(v)) {
        builder.insert(v);
    }
    let Builder {
        vertices,
        neighbours,
        free,
        ..
    } = builder;
    Ok(canonical::canonical(points, &order, vertices, neighbours, &free))
}

/// What the points span.
enum Simplex {
    /// A positively oriented tetrahedron.
    Tetrahedron([u32; 4]),
    /// Less than space.
    Flat(u8),
}

/// The first affinely independent points, exactly.
fn first_simplex(points: &[DVec3]) -> Simplex {
    if points.len() < 2 {
        return Simplex::Flat(0);
    }
    let Some(c) = (2..points.len()).find(|&i| !collinear(points[0], points[1], points[i])) else {
        return Simplex::Flat(1);
    };
    let side = |i: usize| orient3d(points[0], points[1], points[c], points[i]);
    match (2..points.len()).find(|&i| side(i) != 0.0) {
        Some(d) if side(d) > 0.0 => Simplex::Tetrahedron([0, 1, c as u32, d as u32]),
        Some(d) => Simplex::Tetrahedron([1, 0, c as u32, d as u32]),
        None => Simplex::Flat(2),
    }
}
