//! Which lesion of the baseline is which of the follow-up.
//!
//! In: the regions of both dates. Out: [`Group`]s: regions of both dates that belong together. By label: equal labels. By overlap:
//! the connected sets of the relation "share volume in the world frame"; one on each side is a pair, several mean that a lesion
//! split or lesions merged, none on a side that it is new or vanished. Groups come in order of their first baseline region, new
//! lesions last.

use super::Pairing;
use super::agreement::common_volume;
use super::region::Region;
use crate::geometry::mesh::DisjointSets;
use crate::geometry::winding::WindingNumber;

/// Regions of both dates, by index, that are one lesion.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Group {
    /// Indices into the regions of the baseline.
    pub baseline: Vec<usize>,
    /// Indices into the regions of the follow-up.
    pub followup: Vec<usize>,
}

/// Pairs the regions of two dates.
pub fn pair(baseline: &[Region], followup: &[Region], pairing: Pairing) -> Vec<Group> {
    let n = baseline.len();
    let mut sets = DisjointSets::new(n + followup.len());
    for (i, a) in baseline.iter().enumerate() {
        for (j, b) in followup.iter().enumerate() {
            let same = match pairing {
                Pairing::Label => a.label == b.label,
                Pairing::Overlap => overlap(a, b),
            };
            if same {
                sets.union(i as u32, (n + j) as u32);
            }
        }
    }
    let mut groups: Vec<Group> = Vec::new();
    let mut slot = vec![usize::MAX; n + followup.len()];
    for v in 0..n + followup.len() {
        let root = sets.find(v as u32) as usize;
        if slot[root] == usize::MAX {
            slot[root] = groups.len();
            groups.push(Group::default());
        }
        let group = &mut groups[slot[root]];
        if v < n {
            group.baseline.push(v);
        } else {
            group.followup.push(v - n);
        }
    }
    groups
}

/// Whether two regions share volume.
fn overlap(a: &Region, b: &Region) -> bool {
    if let (Some(a), Some(b)) = (&a.mask, &b.mask) {
        return common_volume(a, b) > 0.0 || common_volume(b, a) > 0.0;
    }
    // A vertex of one inside the other, either way round; surfaces that cross without that are thinner than their triangles.
    let meets = |from: &Region, to: &Region| {
        WindingNumber::new(&to.surface)
            .is_some_and(|w| w.is_inside_many(&from.surface.points).contains(&true))
    };
    meets(a, b) || meets(b, a)
}
