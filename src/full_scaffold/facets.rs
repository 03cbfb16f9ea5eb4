//! Facets: how the scaffold flows along the curve element dual to each, and whether that has no length.
//!
//! In: what each tetrahedron knows of itself ([`Signs`], obtuse angles). Out: [`Classified`]. A facet is owned by the tetrahedron of
//! smaller id, which asks the other for its sign. Steps: (1) the four facets of each tetrahedron, their answers as bits of one
//! number, so that nothing branches: which facets are owned and how they flow is as good as random; (2) bits of coinciding
//! spheres are told to the other sides. Cost: a look at two neighbours a tetrahedron, which are far away in memory.

use super::flow::CriticalCounts;
use super::spheres::{Signs, cospherical};
use crate::delaunay::counters::Counters;
use crate::delaunay::lanes::{Lanes, Task, with_lanes};
use crate::delaunay::{Facet, Triangulation};
use crate::geometry::fixed::Grid;
use crate::geometry::{TetId, VertexId};
use glam::DVec3;
use rayon::prelude::*;

/// Tetrahedra handled by one task at a time.
pub(super) const CHUNK: usize = 1 << 14;

/// What is known of facets.
pub(super) struct Classified {
    /// As in [`super::FullScaffold`], but bits of coinciding spheres only on the side of the owner.
    pub signs: Vec<u8>,
    /// As in [`super::FullScaffold`].
    pub flows: Vec<u8>,
    /// Tetrahedra that own a facet across which the spheres coincide.
    pub tied: Vec<u32>,
    /// [`super::spheres::Geometries::obtuse`] of owned facets.
    pub obtuse: Vec<u16>,
    /// For each vertex the number of owned facets with an obtuse angle that faces an edge of which it is the smaller end.
    pub facing: Counters,
    /// Numbers of sinks, curve sources and relays.
    pub counts: CriticalCounts,
}

/// Step 1.
pub(super) fn classify(
    t: &Triangulation,
    points: &[DVec3],
    grid: Grid,
    signs: &[Signs],
    mut obtuse: Vec<u16>,
) -> Classified {
    let n = signs.len();
    let (mut all_signs, mut flows) = (vec![0u8; n], vec![0u8; n]);
    let facing = Counters::new(t.points.len());
    let parts: Vec<(CriticalCounts, Vec<u32>)> = (
        all_signs.par_chunks_mut(CHUNK),
        flows.par_chunks_mut(CHUNK),
        obtuse.par_chunks_mut(CHUNK),
    )
        .into_par_iter()
        .enumerate()
        .map(|(chunk, (out, flows, codes))| {
            with_lanes(Facets {
                t,
                points,
                grid,
                signs,
                first: (chunk * CHUNK) as u32,
                out,
                flows,
                codes,
                facing: &facing,
            })
        })
        .collect();
    let sum = |f: fn(&CriticalCounts) -> u64| parts.iter().map(|(counts, _)| f(counts)).sum();
    let counts = CriticalCounts {
        sinks: sum(|c| c.sinks),
        curve_sources: sum(|c| c.curve_sources),
        relays: sum(|c| c.relays),
        ..CriticalCounts::default()
    };
    Classified {
        signs: all_signs,
        flows,
        tied: parts.into_iter().flat_map(|(_, tied)| tied).collect(),
        obtuse,
        facing,
        counts,
    }
}

/// Step 1 for consecutive tetrahedra, compiled for the processor at hand.
struct Facets<'a> {
    t: &'a Triangulation,
    points: &'a [DVec3],
    grid: Grid,
    signs: &'a [Signs],
    first: u32,
    out: &'a mut [u8],
    flows: &'a mut [u8],
    codes: &'a mut [u16],
    facing: &'a Counters,
}

impl Task for Facets<'_> {
    type Output = (CriticalCounts, Vec<u32>);

    #[inline(always)]
    fn run<L: Lanes>(self, _lanes: L) -> Self::Output {
        let Self {
            t,
            signs,
            facing,
            first,
            out,
            flows,
            codes,
            ..
        } = self;
        let ties_of = |tet, maybe| really_tied(t, self.points, self.grid, tet, maybe);
        let mut counts = CriticalCounts::default();
        let mut tied = Vec::new();
        let finite = t.num_finite() as u32;
        let tets = out.iter_mut().zip(flows).zip(codes);
        for (((out, flow), codes), tet) in tets.zip(first..) {
            let own = signs[tet as usize];
            let across = t.neighbours[tet as usize];
            // Bit `i`: facet `i` is owned; the vertex beyond it lies outside its smallest ball; may lie on the sphere.
            let [mut owned, mut beyond_outside, mut ties] = [0u8; 3];
            for i in 0..4 {
                let (other, index) = (across[i] >> 2, across[i] & 3);
                let is_owned = tet < other;
                let asked = is_owned & (other < finite);
                // What is far away is only looked at when it is wanted.
                let beyond = signs[if asked { other } else { tet } as usize];
                owned |= u8::from(is_owned) << i;
                beyond_outside |= ((beyond.outside() >> index | u8::from(!asked)) & 1) << i;
                ties |= u8::from(asked & own.may_coincide(beyond)) << i;
            }
            if ties != 0 {
                ties = ties_of(TetId(tet), ties);
                if ties != 0 {
                    tied.push(tet);
                }
            }
            let obtuse = any_of_four(*codes);
            let gabriel = own.outside() & beyond_outside;
            *codes &= NIBBLES[usize::from(owned)];
            *flow = TWICE[usize::from(owned & obtuse)] | TWICE[usize::from(owned & !gabriel)] << 1;
            *out = own.outside() | ties << 4;
            counts.sinks += u64::from(own.outside() == 15);
            counts.curve_sources += u64::from((owned & gabriel & !obtuse).count_ones());
            counts.relays += u64::from((owned & gabriel & obtuse).count_ones());
            // Vertices come in order, but for the last two: so the canonical numbering has it.
            let [a, b, c, d] = t.vertices[tet as usize];
            let smaller = LOW[usize::from(*codes & 255)] + HIGH[usize::from(*codes >> 8)];
            for (v, shift) in [(a, 0), (b, 8), (c.min(d), 16)] {
                facing.add(v.index(), smaller >> shift & 255);
            }
        }
        (counts, tied)
    }
}

/// The facets among the given ones across which two spheres coincide, exactly.
#[cold]
#[inline(never)]
fn really_tied(t: &Triangulation, points: &[DVec3], grid: Grid, tet: TetId, maybe: u8) -> u8 {
    let at = |v: VertexId| points[v.index()];
    let corners = t.tet(tet).map(at);
    (0..4u8)
        .filter(|index| maybe >> index & 1 == 1)
        .filter(|&index| {
            let other = t.mirror(Facet { tet, index });
            cospherical(grid, corners, at(t.tet(other.tet)[other.index as usize]))
        })
        .fold(0, |ties, index| ties | 1 << index)
}

/// Bit `i`: group `i` of four bits, none of which is above 4, is not zero.
#[inline(always)]
fn any_of_four(codes: u16) -> u8 {
    let any = (codes | codes >> 1 | codes >> 2) & 0x1111;
    ((any | any >> 3 | any >> 6 | any >> 9) & 15) as u8
}

/// Four bits as groups of four.
const NIBBLES: [u16; 16] = {
    let mut table = [0; 16];
    let mut bits = 0;
    while bits < 16 {
        let mut k = 0;
        while k < 4 {
            table[bits] |= (bits as u16 >> k & 1) * (15 << (4 * k));
            k += 1;
        }
        bits += 1;
    }
    table
};

/// Four bits as every other bit.
const TWICE: [u8; 16] = {
    let mut table = [0; 16];
    let mut bits = 0;
    while bits < 16 {
        let mut k = 0;
        while k < 4 {
            table[bits] |= (bits as u8 >> k & 1) << (2 * k);
            k += 1;
        }
        bits += 1;
    }
    table
};

/// For the obtuse angles of facets 0 and 1, how many face an edge whose smaller end is the first vertex, from bit 8 on the
/// second, from bit 16 on one of the last two.
const LOW: [u32; 256] = smaller_ends(0);
/// The same for facets 2 and 3.
const HIGH: [u32; 256] = smaller_ends(2);

const fn smaller_ends(facet: usize) -> [u32; 256] {
    let mut table = [0; 256];
    let mut codes = 0;
    while codes < 256 {
        let mut k = 0;
        while k < 2 {
            let code = codes >> (4 * k) & 15;
            if code != 0 && code <= 4 {
                // The edge has neither the vertex opposite the facet nor the one with the angle.
                let (without, nor) = (facet + k, code - 1);
                let smaller = if without != 0 && nor != 0 {
                    0
                } else if without != 1 && nor != 1 {
                    1
                } else {
                    2
                };
                table[codes] += 1 << (8 * smaller);
            }
            k += 1;
        }
        codes += 1;
    }
    table
}

/// Step 2: copies the bits of coinciding spheres from the owners of facets to the other sides. Few clouds have any.
pub(super) fn tell_both_sides(t: &Triangulation, classified: &mut Classified) {
    let signs = &mut classified.signs;
    for tet in classified.tied.iter().copied().map(TetId) {
        // Bits of facets that others own may have come from them.
        for facet in (0..4u8).map(|index| Facet { tet, index }) {
            let other = t.mirror(facet);
            if facet < other && signs[tet.index()] >> (4 + facet.index) & 1 == 1 {
                signs[other.tet.index()] |= 16 << other.index;
            }
        }
    }
}
