//! Faces turned to agree and outward.
//!
//! In: a mesh. Out: the same faces, some of them turned, and which.
//!
//! 1. Faces are turned to agree across every edge with exactly two; of every patch the larger part keeps its turn.
//! 2. Closed components are turned outward, or into cavities where they lie inside others: as the file has it relative to the
//!    outermost one about them, else solid and hollow in turn from outside in.
//!
//! Cost `O(n log n)`, and one winding number for each pair of closed components.

use crate::geometry::{TriangleMesh, WindingNumber};
use std::collections::HashMap;

/// Turns the faces of each patch (bounded by rims and by edges of three and more faces) to agree; returns which were turned.
pub(super) fn agree_patches(mesh: &mut TriangleMesh) -> Vec<bool> {
    let neighbours = across_edges(mesh);
    let mut turned = vec![false; mesh.triangles.len()];
    for part in &mesh.components() {
        agree(part, &neighbours, &mut turned);
    }
    for (t, _) in mesh
        .triangles
        .iter_mut()
        .zip(&turned)
        .filter(|(_, turned)| **turned)
    {
        t.swap(1, 2);
    }
    turned
}

/// What [`turn_outward`] did.
pub(super) struct Outward {
    /// Which faces it turned.
    pub turned: Vec<bool>,
    /// Components that cannot be oriented, left as they were.
    pub one_sided_components: usize,
}

/// Turns faces to agree, then closed components outward; `before` says which faces were turned already.
pub(super) fn turn_outward(mesh: &mut TriangleMesh, before: &[bool]) -> Outward {
    let parts = mesh.components();
    let neighbours = across_edges(mesh);
    let mut turned = vec![false; mesh.triangles.len()];
    let mut shells: Vec<Shell> = Vec::new();
    let mut one_sided_components = 0;
    for part in &parts {
        let agreement = agree(part, &neighbours, &mut turned);
        if agreement == Agreement::Impossible {
            one_sided_components += 1;
            continue;
        }
        for &t in part {
            if turned[t as usize] {
                mesh.triangles[t as usize].swap(1, 2);
            }
        }
        let piece = mesh.submesh(part);
        if piece.topology().watertight {
            shells.push(Shell {
                triangles: part.clone(),
                volume: piece.signed_volume(),
                given: agreement == Agreement::AsGiven && !part.iter().any(|&t| before[t as usize]),
                piece,
            });
        }
    }
    for (i, flip) in inward_shells(&shells).into_iter().enumerate() {
        if flip {
            for &t in &shells[i].triangles {
                mesh.triangles[t as usize].swap(1, 2);
                turned[t as usize] ^= true;
            }
        }
    }
    Outward {
        turned,
        one_sided_components,
    }
}

/// A closed component whose faces agree.
struct Shell {
    triangles: Vec<u32>,
    piece: TriangleMesh,
    volume: f64,
    /// The file gave it this orientation.
    given: bool,
}

/// Which shells must be turned over.
fn inward_shells(shells: &[Shell]) -> Vec<bool> {
    let windings: Vec<Option<WindingNumber>> = shells.iter().map(|s| WindingNumber::new(&s.piece)).collect();
    // For every shell those that enclose it, the largest last.
    let enclosing: Vec<Vec<usize>> = (0..shells.len())
        .map(|i| {
            let probe = shells[i].piece.points[0];
            let mut around: Vec<usize> = (0..shells.len())
                .filter(|&j| j != i && shells[j].volume.abs() > shells[i].volume.abs())
                .filter(|&j| windings[j].as_ref().is_some_and(|w| w.winding(probe).abs() > 0.5))
                .collect();
            around.sort_by(|&a, &b| {
                shells[a]
                    .volume
                    .abs()
                    .total_cmp(&shells[b].volume.abs())
                    .then(a.cmp(&b))
            });
            around
        })
        .collect();
    (0..shells.len())
        .map(|i| match enclosing[i].last() {
            None => shells[i].volume < 0.0,
            // The file's own turn, relative to that of the outermost shell about it.
            Some(&outermost) if shells[i].given && shells[outermost].given => shells[outermost].volume < 0.0,
            // No turn of its own: solid and hollow take turns from outside in.
            Some(_) => (shells[i].volume < 0.0) == enclosing[i].len().is_multiple_of(2),
        })
        .collect()
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Agreement {
    AsGiven,
    AfterTurning,
    Impossible,
}

/// A neighbour across an edge with two faces, and whether the two run along it the same way (so one must be turned).
#[derive(Clone, Copy)]
struct Across {
    triangle: u32,
    clash: bool,
}

/// The neighbours of every triangle across its edges with exactly two faces.
fn across_edges(mesh: &TriangleMesh) -> Vec<[Option<Across>; 3]> {
    let mut sides: Vec<(u32, u32, u32, bool)> = mesh
        .triangles
        .iter()
        .enumerate()
        .flat_map(|(i, &[a, b, c])| {
            [(a, b), (b, c), (c, a)].map(|(u, v)| (u.min(v), u.max(v), i as u32, u < v))
        })
        .collect();
    sides.sort_unstable();
    let mut out = vec![[None; 3]; mesh.triangles.len()];
    for run in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let &[(_, _, s, s_forward), (_, _, t, t_forward)] = run else {
            continue;
        };
        let clash = s_forward == t_forward;
        for (from, to) in [(s, t), (t, s)] {
            if let Some(free) = out[from as usize].iter_mut().find(|n| n.is_none()) {
                *free = Some(Across { triangle: to, clash });
            }
        }
    }
    out
}

/// Marks the faces of a component that must be turned; the largest group that agrees as given stays.
fn agree(part: &[u32], neighbours: &[[Option<Across>; 3]], turned: &mut [bool]) -> Agreement {
    let mut seen: HashMap<u32, ()> = HashMap::with_capacity(part.len());
    let mut possible = true;
    let mut any = false;
    // A component joined by points or by edges of three faces falls into several patches.
    for &seed in part {
        if seen.contains_key(&seed) {
            continue;
        }
        seen.insert(seed, ());
        let mut patch = vec![seed];
        let mut next = 0;
        while next < patch.len() {
            let t = patch[next];
            next += 1;
            for n in neighbours[t as usize].iter().flatten() {
                let wanted = turned[t as usize] ^ n.clash;
                if seen.insert(n.triangle, ()).is_none() {
                    turned[n.triangle as usize] = wanted;
                    patch.push(n.triangle);
                } else if turned[n.triangle as usize] != wanted {
                    possible = false;
                }
            }
        }
        let flips = patch.iter().filter(|&&t| turned[t as usize]).count();
        if 2 * flips > patch.len() {
            for &t in &patch {
                turned[t as usize] ^= true;
            }
        }
        any |= flips > 0;
    }
    if !possible {
        for &t in part {
            turned[t as usize] = false;
        }
        Agreement::Impossible
    } else if any {
        Agreement::AfterTurning
    } else {
        Agreement::AsGiven
    }
}
