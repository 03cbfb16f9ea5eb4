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
mod filter;
mod insertion;
mod order;
mod parallel;
mod store;
pub mod triangulation;

pub use door::{DelaunayError, Generators, prepare};
pub use triangulation::{Facet, INFINITE, Triangulation};

use crate::geometry::predicates::{collinear, orient3d};
use door::Frame;
use filter::Filter;
use glam::DVec3;
use insertion::Inserter;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use store::Plain;

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
pub fn delaunay(points: &[DVec3], settings: &DelaunaySettings) -> Result<Triangulation, DelaunayError> {
    let points = door::distinct(points)?;
    let frame = Frame::of(&points)?;
    let bounds = crate::geometry::mesh::bounds(&points)
        .unwrap_or_default()
        .map(|p| frame.apply(p));
    let normalised: Cow<[DVec3]> = if frame.exponent == 0 {
        Cow::Borrowed(&points)
    } else {
        points.iter().map(|&p| frame.apply(p)).collect()
    };
    let order = order::insertion_order(&normalised, bounds);
    let inserted: Vec<DVec3> = order.indices.iter().map(|&i| normalised[i as usize]).collect();
    drop(normalised);
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
    let threads = match settings.threads {
        0 => rayon::current_num_threads(),
        n => n,
    };
    let store = insert_all(&inserted, Filter::new(bounds), &order.ends, first, threads);
    drop(inserted);
    Ok(canonical::canonical(
        points,
        &order.indices,
        store.vertices,
        store.neighbours,
        &store.free,
    ))
}

/// Points that one thread inserts before others join: until then they would be in each other's way.
const ALONE: u32 = 1024;

/// Slots a point: surfaces and uniform clouds need less than seven, torus-like ones a little more. More is not wrong, the
/// store grows; it is untouched memory.
const SLOTS_A_POINT: usize = 7;

/// Inserts all points, whose rounds end at `ends`, beginning with the tetrahedron `first`.
fn insert_all(points: &[DVec3], filter: Filter, ends: &[u32], first: [u32; 4], threads: usize) -> Plain {
    let n = points.len() as u32;
    let mut store = Plain::with_capacity(SLOTS_A_POINT * points.len() + 64);
    insertion::first_tetrahedron(&mut store, first);
    let mut last = 0;
    let mut alone = |store: &mut Plain, vertices: &mut dyn Iterator<Item = u32>| {
        let mut inserter = Inserter::new(points, filter, last);
        for v in vertices.filter(|v| !first.contains(v)) {
            let done = inserter.insert(store, v);
            debug_assert!(done, "nothing is in the way of one thread");
        }
        last = inserter.last();
    };
    if threads == 1 || n < 4 * ALONE {
        alone(&mut store, &mut (0..n));
        return store;
    }
    // The four points of the first tetrahedron are among the first unless the cloud is nearly flat.
    let begin = first.into_iter().max().map_or(0, |v| v + 1).max(ALONE);
    alone(&mut store, &mut (0..begin));
    let mut from = begin;
    let mut rounds = Vec::new();
    for &end in ends.iter().filter(|&&end| end > begin) {
        rounds.push(from..end);
        from = end;
    }
    let room = (SLOTS_A_POINT * points.len() + 64).max(store.vertices.len()) + 2048 * threads;
    let (mut store, given_up) = parallel::insert_rounds(store, points, filter, &rounds, threads, room);
    last = store.used().next().expect("tetrahedra were inserted");
    let mut inserter = Inserter::new(points, filter, last);
    for v in given_up {
        inserter.insert(&mut store, v);
    }
    store
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
