//! Delaunay: the canonical 3D Delaunay triangulation of the generators, by exact predicates.
//!
//! In: distinct finite points in lexicographic coordinate order. Out: [`Triangulation`], a function of the point *set*
//! alone: cospherical ties are broken by coordinates, tetrahedra are numbered canonically, so no order of insertion and no
//! thread count can be seen in the result.
//!
//! Steps, one file each: [`door`] checks, sorts (`sort`) and merges the points; `order` arranges them in randomised rounds along
//! a Hilbert curve; `insertion` and `star` add them one by one into a `store`, with `parallel` by several threads, by the exact
//! tests of `filter`, whose arithmetic is in `lanes`; `canonical` renumbers. Points that do not span space are no error:
//! [`Triangulation::dimension`] says so and there are no tetrahedra.

mod canonical;
pub(crate) mod counters;
pub mod door;
mod filter;
mod insertion;
pub(crate) mod lanes;
mod order;
mod parallel;
mod sort;
mod star;
mod store;
pub mod triangulation;

pub use door::{DelaunayError, Generators, prepare};
pub use triangulation::{Facet, INFINITE, Triangulation};

use crate::geometry::mesh;
use crate::geometry::predicates::{collinear, orient3d};
use door::Frame;
use filter::Filter;
use glam::DVec3;
use insertion::{Inserter, Memory};
use lanes::{Lanes, Site, Task, with_lanes};
use rayon::prelude::*;
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
    // Inside the pool from here on: its parallel steps are many, and each would hand over to it and wait.
    rayon::scope(|_| triangulate(points, settings))
}

fn triangulate(points: &[DVec3], settings: &DelaunaySettings) -> Result<Triangulation, DelaunayError> {
    let points = door::distinct(points)?;
    let frame = Frame::of(&points)?;
    let bounds = bounds(&points).map(|p| frame.apply(p));
    let normalised: Cow<[DVec3]> = if frame.exponent == 0 {
        Cow::Borrowed(&points)
    } else {
        points.iter().map(|&p| frame.apply(p)).collect()
    };
    let order = order::insertion_order(&normalised, bounds);
    let longest = (bounds[1] - bounds[0]).max_position();
    // In memory that goes back to the system before the renumbering.
    let mut sites = canonical::room(normalised.len());
    let mut indices = canonical::room(normalised.len());
    sites.par_extend(order.par_iter().map(|i| {
        let p = normalised[i as usize];
        Site::new(p, p[longest])
    }));
    indices.par_extend(order.par_iter());
    let ends = order.into_ends();
    drop(normalised);
    let first = match first_simplex(&sites) {
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
    }
    .min(parallel::MOST_THREADS);
    let store = insert_all(&sites, Filter::new(bounds), &ends, first, threads);
    drop(sites);
    Ok(canonical::canonical(
        points,
        indices,
        store.vertices,
        store.neighbours,
    ))
}

/// The box of points.
fn bounds(points: &[DVec3]) -> [DVec3; 2] {
    let parts = points.par_chunks(1 << 14).filter_map(mesh::bounds);
    parts
        .reduce_with(|[a, b], [lo, hi]| [a.min(lo), b.max(hi)])
        .unwrap_or_default()
}

/// Rounds that end before this many points are left to one thread: in these, threads would be in each other's way.
const ALONE: u32 = 16384;

/// Slots a point: surfaces and uniform clouds need less than seven, torus-like ones a little more. More is not wrong, the
/// store grows; it is untouched memory.
const SLOTS_A_POINT: usize = 7;

/// Inserts all points, whose rounds end at `ends`, beginning with the tetrahedron `first`.
fn insert_all(sites: &[Site], filter: Filter, ends: &[u32], first: [u32; 4], threads: usize) -> Plain {
    let n = sites.len() as u32;
    let mut store = Plain::with_capacity(SLOTS_A_POINT * sites.len() + 64);
    insertion::first_tetrahedron(&mut store, first);
    let alone = |store: &mut Plain, vertices: &mut dyn Iterator<Item = u32>| {
        with_lanes(Alone {
            memory: &mut Memory::new(sites.len(), store.any().expect("a tetrahedron was made")),
            store,
            sites,
            filter,
            vertices,
        });
    };
    let mut others = |v: &u32| !first.contains(v);
    if threads == 1 || n < ALONE {
        alone(&mut store, &mut (0..n).filter(&mut others));
        return store;
    }
    // The four points of the first tetrahedron are among the first unless the cloud is nearly flat.
    let first_rounds = ends.iter().copied().take_while(|&end| end < ALONE);
    let begin = first
        .into_iter()
        .map(|v| v + 1)
        .chain(first_rounds)
        .fold(0, u32::max);
    alone(&mut store, &mut (0..begin).filter(&mut others));
    let mut from = begin;
    let mut rounds = Vec::new();
    for &end in ends.iter().filter(|&&end| end > begin) {
        rounds.push(from..end);
        from = end;
    }
    let room = (SLOTS_A_POINT * sites.len() + 64).max(store.vertices.len()) + 2048 * threads;
    let (mut store, left) = parallel::insert_rounds(store, sites, filter, &rounds, threads, room);
    alone(&mut store, &mut left.into_iter());
    store
}

/// Insertion by one thread.
struct Alone<'a> {
    store: &'a mut Plain,
    memory: &'a mut Memory,
    sites: &'a [Site],
    filter: Filter,
    vertices: &'a mut dyn Iterator<Item = u32>,
}

impl Task for Alone<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let mut inserter = Inserter {
            sites: self.sites,
            filter: self.filter,
            lanes,
            memory: self.memory,
        };
        for v in self.vertices {
            let done = inserter.insert(self.store, v);
            debug_assert!(done, "nothing is in the way of one thread");
        }
    }
}

/// What the points span.
enum Simplex {
    /// A positively oriented tetrahedron.
    Tetrahedron([u32; 4]),
    /// Less than space.
    Flat(u8),
}

/// The first affinely independent points, exactly.
fn first_simplex(sites: &[Site]) -> Simplex {
    let points = |i: usize| sites[i].point();
    if sites.len() < 2 {
        return Simplex::Flat(0);
    }
    let Some(c) = (2..sites.len()).find(|&i| !collinear(points(0), points(1), points(i))) else {
        return Simplex::Flat(1);
    };
    let side = |i: usize| orient3d(points(0), points(1), points(c), points(i));
    match (2..sites.len()).find(|&i| side(i) != 0.0) {
        Some(d) if side(d) > 0.0 => Simplex::Tetrahedron([0, 1, c as u32, d as u32]),
        Some(d) => Simplex::Tetrahedron([1, 0, c as u32, d as u32]),
        None => Simplex::Flat(2),
    }
}
