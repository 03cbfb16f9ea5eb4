//! Flow types of curve elements and counts of critical points.

use serde::{Deserialize, Serialize};

/// Flow on the curve element (A1^3) dual to a Delaunay triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum FlowType {
    /// Gabriel and acute: a curve source (A1^3-2) at the circumcentre; two arcs leave it.
    Source,
    /// Gabriel and not acute: a relay (A1^3-3); flow enters from the sheets of the short edges and leaves both ways.
    Relay,
    /// Not Gabriel, acute: one arc from the nearer vertex to the farther.
    PassingAcute,
    /// Not Gabriel, not acute: one arc from the nearer vertex to the farther.
    PassingObtuse,
}

/// Numbers of critical points of the radius function and their alternating sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CriticalCounts {
    /// Generators (minima).
    pub generators: u64,
    /// Sheet sources (A1^2-2): Gabriel edges.
    pub sheet_sources: u64,
    /// Curve sources (A1^3-2): Gabriel, acute triangles.
    pub curve_sources: u64,
    /// Relays (A1^3-3).
    pub relays: u64,
    /// Sinks (A1^4): tetrahedra that hold their circumcentre.
    pub sinks: u64,
    /// `generators - sheet_sources + curve_sources - sinks`; 1 for every finite point set.
    pub morse: i64,
}
