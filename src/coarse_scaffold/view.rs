//! The same scaffold at a coarser tolerance, from the persistences alone.
//!
//! In: a coarse scaffold. Out: the graph of what is at least as persistent as the tolerance: nothing is burnt or collapsed
//! again, so views are cheap, and nested: what a coarse view shows, every finer one shows too.
//!
//! 1. sheets below the tolerance go; of a part of the scaffold that would vanish, the most persistent sheet (or wire) stays; what hangs on
//!    wires that go goes with them;
//! 2. axial curves, wires and seams below it go; of the three sheets at an axial curve that went, the two of highest erosion thickness become
//!    one and the third is one with them only where nothing else holds it; what a sheet that went stood for (volume, generators)
//!    falls to the sheet it hung on by its most persistent curve;
//! 3. seams with one sheet on both sides go: they part nothing any more;
//! 4. nodes that no curve ends at go; where just two curves of one kind are left, they become one; so do two axial curves of two
//!    shared sheets where only ribs and seams end beside them: whether a curve runs through there or in two pieces is decided below the
//!    tolerance of a view, and differs from sampling to sampling.
//!
//! Cost: `O(elements log elements)`.

use super::attributes::{boundaries, principal};
use super::build::{node_kind, node_persistence};
use super::dissolve::{join_curves, join_facing};
use super::hypergraph::{CoarseScaffold, Curve, CurveKind, FineLinks, Node, NodeKind, Sheet};
use super::natural::natural_tolerances;
use crate::geometry::mesh::DisjointSets;
use crate::geometry::{CurveId, NodeId, SheetId};
use glam::DVec3;
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

impl CoarseScaffold {
    /// The graph at a tolerance no finer than its own; see [the module](super::view). A finer tolerance returns it unchanged.
    pub fn view(&self, tolerance_mm: f64) -> CoarseScaffold {
        if tolerance_mm <= self.tolerance_mm {
            return self.clone();
        }
        let (keep_sheet, keep_curve) = self.kept(tolerance_mm);
        let mut merged = self.joined(&keep_sheet, &keep_curve);
        let (mut sheets, sheet_of) = self.merged_sheets(&keep_sheet, &mut merged);
        let mut curves: Vec<Curve> = self
            .curves
            .iter()
            .zip(&keep_curve)
            .filter(|(c, keep)| **keep && !is_idle(c, &sheet_of))
            .map(|(c, _)| Curve {
                sheets: c
                    .sheets
                    .iter()
                    .filter_map(|s| sheet_of[s.index()])
                    .map(SheetId)
                    .collect(),
                ..c.clone()
            })
            .collect();
        join_facing(&mut curves, self.nodes.len());
        join_curves(&mut curves, &mut Vec::new(), self.nodes.len(), |node, a, b| {
            self.nodes[node].kind != NodeKind::Corner && (a.kind != CurveKind::Rib || a.sheets == b.sheets)
        });
        let mut nodes = renumber(&mut curves, &self.nodes, &self.curves, sheets.is_empty());
        for node in &mut nodes {
            node.sheets = node
                .sheets
                .iter()
                .filter_map(|s| sheet_of[s.index()])
                .map(SheetId)
                .collect();
            node.sheets.sort_unstable();
            node.sheets.dedup();
        }
        boundaries(&mut sheets, &curves);
        CoarseScaffold {
            tolerance_mm,
            diagonal_mm: self.diagonal_mm,
            natural_tolerances: natural_tolerances(&curves, tolerance_mm, self.diagonal_mm),
            nodes,
            curves,
            sheets,
            transforms: self.transforms.clone(),
            fine: FineLinks::default(),
        }
    }

    /// The sheets that become one when curves go: the two sides of a curve that stay when the third is trimmed away from it. What a
    /// sheet that goes stood for falls to the sheet it hung on by its most persistent curve; so does a sheet that would
    /// hang on nothing.
    fn joined(&self, keep_sheet: &[bool], keep_curve: &[bool]) -> DisjointSets {
        let mut merged = DisjointSets::new(self.sheets.len());
        let mut gone: Vec<&Curve> = self
            .curves
            .iter()
            .filter(|c| !keep_curve[c.id.index()] && c.sheets.len() > 1)
            .collect();
        gone.sort_by(|a, b| b.persistence.total_cmp(&a.persistence).then(a.id.cmp(&b.id)));
        for c in &gone {
            if c.sheets[..2].iter().all(|s| keep_sheet[s.index()]) {
                merged.union(c.sheets[0].0, c.sheets[1].0);
            }
        }
        let mut hangs = vec![false; self.sheets.len()];
        for c in self.curves.iter().filter(|c| keep_curve[c.id.index()]) {
            let first = c.sheets.first().map(|s| merged.find(s.0));
            if c.sheets.iter().any(|s| Some(merged.find(s.0)) != first) {
                for s in &c.sheets {
                    hangs[merged.find(s.0) as usize] = true;
                }
            }
        }
        for c in gone {
            let first = c.sheets[0].0;
            for s in &c.sheets[1..] {
                let (a, b) = (merged.find(first), merged.find(s.0));
                if a != b && !(hangs[a as usize] && hangs[b as usize]) {
                    let either = hangs[a as usize] || hangs[b as usize];
                    merged.union(a, b);
                    let root = merged.find(a) as usize;
                    hangs[root] = either;
                }
            }
        }
        merged
    }

    /// Sheets and curves that stay: what is persistent enough; the most persistent sheet of each part without any, unless the part
    /// hangs on wires that end in one node of it or go, so that the node can stand for it; and of a component without anything its most
    /// persistent sheet or wire. Ribs stay with their sheets.
    fn kept(&self, tolerance_mm: f64) -> (Vec<bool>, Vec<bool>) {
        let mut sheet: Vec<bool> = self
            .sheets
            .iter()
            .map(|s| s.persistence >= tolerance_mm)
            .collect();
        let mut curve: Vec<bool> = self
            .curves
            .iter()
            .map(|c| c.persistence >= tolerance_mm)
            .collect();
        self.keep_of_components(&mut sheet, &mut curve);
        self.keep_of_parts(&mut sheet, &curve);
        for (keep, c) in curve.iter_mut().zip(&self.curves) {
            if c.kind == CurveKind::Rib {
                *keep = c.sheets.iter().all(|s| sheet[s.index()]);
            }
        }
        (sheet, curve)
    }

    /// The most persistent sheet or wire of each component that would vanish stays; of equals the first, sheets before wires.
    fn keep_of_components(&self, sheet: &mut [bool], curve: &mut [bool]) {
        let mut sets = self.components();
        let sheets = self.sheets.len();
        // Of each component its best so far: persistence, and id as in the sets.
        let mut best: BTreeMap<u32, (f64, usize)> = BTreeMap::new();
        let wires = self.curves.iter().filter(|c| c.kind == CurveKind::Wire);
        let all = self.sheets.iter().map(|s| (s.id.index(), s.persistence));
        for (i, persistence) in all.chain(wires.map(|c| (sheets + c.id.index(), c.persistence))) {
            let slot = best.entry(sets.find(i as u32)).or_insert((persistence, i));
            if slot.0 < persistence {
                *slot = (persistence, i);
            }
        }
        for (_, i) in best.into_values() {
            match i.checked_sub(sheets) {
                None => sheet[i] = true,
                Some(c) => curve[c] = true,
            }
        }
    }

    /// The most persistent sheet of each part stays where nothing else can stand for the part.
    fn keep_of_parts(&self, sheet: &mut [bool], curve: &[bool]) {
        let mut parts = DisjointSets::new(self.sheets.len());
        for c in &self.curves {
            for pair in c.sheets.windows(2) {
                parts.union(pair[0].0, pair[1].0);
            }
        }
        let mut best: BTreeMap<u32, usize> = BTreeMap::new();
        for s in 0..self.sheets.len() {
            let slot = best.entry(parts.find(s as u32)).or_insert(s);
            if self.sheets[*slot].persistence < self.sheets[s].persistence {
                *slot = s;
            }
        }
        let mut has_wires: BTreeSet<u32> = BTreeSet::new();
        let mut held: BTreeSet<(u32, NodeId)> = BTreeSet::new();
        for c in self.curves.iter().filter(|c| c.kind == CurveKind::Wire) {
            for &n in &c.nodes {
                for s in &self.nodes[n.index()].sheets {
                    let part = parts.find(s.0);
                    has_wires.insert(part);
                    if curve[c.id.index()] {
                        held.insert((part, n));
                    }
                }
            }
        }
        for (part, s) in best {
            let nodes = held.range((part, NodeId(0))..=(part, NodeId(u32::MAX))).count();
            sheet[s] |= !has_wires.contains(&part) || nodes > 1;
        }
    }

    /// What hangs together: sheets by their ids, then curves by theirs.
    fn components(&self) -> DisjointSets {
        let sheets = self.sheets.len();
        let mut sets = DisjointSets::new(sheets + self.curves.len());
        let curve = |c: CurveId| (sheets + c.index()) as u32;
        for c in &self.curves {
            for s in &c.sheets {
                sets.union(curve(c.id), s.0);
            }
        }
        for n in &self.nodes {
            let curves = n.curves.iter().map(|&c| curve(c));
            let own: Vec<u32> = curves.chain(n.sheets.iter().map(|s| s.0)).collect();
            for pair in own.windows(2) {
                sets.union(pair[0], pair[1]);
            }
        }
        sets
    }

    /// One sheet for each merged set that holds a kept one, and the new number of every sheet that is still there.
    fn merged_sheets(&self, keep: &[bool], merged: &mut DisjointSets) -> (Vec<Sheet>, Vec<Option<u32>>) {
        let n = self.sheets.len();
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); n];
        for s in 0..n {
            members[merged.find(s as u32) as usize].push(s);
        }
        let mut sheets = Vec::new();
        let mut number = vec![None; n];
        for own in members {
            let kept: Vec<&Sheet> = own
                .iter()
                .filter(|&&s| keep[s])
                .map(|&s| &self.sheets[s])
                .collect();
            if kept.is_empty() {
                continue;
            }
            for &s in own.iter().filter(|&&s| keep[s]) {
                number[s] = Some(sheets.len() as u32);
            }
            let mut sheet = union_of(&kept);
            sheet.id = SheetId::from_index(sheets.len());
            sheet.volume_share = own.iter().map(|&s| self.sheets[s].volume_share).sum();
            sheet.generators = own.iter().map(|&s| self.sheets[s].generators).sum();
            sheets.push(sheet);
        }
        (sheets, number)
    }
}

/// Whether a curve is a seam with one sheet on both sides: it parts nothing.
fn is_idle(curve: &Curve, sheet_of: &[Option<u32>]) -> bool {
    let mut sides = curve.sheets.iter().map(|s| sheet_of[s.index()]);
    let first = sides.next();
    curve.kind == CurveKind::Seam && sides.all(|s| Some(s) == first)
}

/// Several sheets as one: sums, weighted means and moments.
fn union_of(sheets: &[&Sheet]) -> Sheet {
    let mut out = sheets[0].clone();
    if sheets.len() == 1 {
        return out;
    }
    let area: f64 = sheets.iter().map(|s| s.area).sum();
    let share = |s: &Sheet| {
        if area > 0.0 {
            s.area / area
        } else {
            1.0 / sheets.len() as f64
        }
    };
    let centroid: DVec3 = sheets.iter().map(|s| share(s) * s.moments.centroid).sum();
    let mut covariance = Matrix3::<f64>::zeros();
    for s in sheets {
        let d: Vector3<f64> = (s.moments.centroid - centroid).into();
        covariance += d * d.transpose() * share(s);
        for (axis, deviation) in s.moments.axes.iter().zip(s.moments.deviations) {
            let a: Vector3<f64> = (*axis).into();
            covariance += a * a.transpose() * (deviation * deviation * share(s));
        }
    }
    out.area = area;
    out.persistence = sheets.iter().map(|s| s.persistence).fold(0.0, f64::max);
    out.mean_radius = sheets.iter().map(|s| share(s) * s.mean_radius).sum();
    out.max_radius = sheets.iter().map(|s| s.max_radius).fold(0.0, f64::max);
    out.moments = principal(covariance, centroid);
    for s in &sheets[1..] {
        let base = out.mesh.vertices.len() as u32;
        out.mesh.vertices.extend(&s.mesh.vertices);
        out.mesh
            .triangles
            .extend(s.mesh.triangles.iter().map(|t| t.map(|i| i + base)));
    }
    out
}

/// Numbers curves and the nodes they end at afresh. Without any curve or sheet a lone node (a ball) stays.
fn renumber(curves: &mut [Curve], nodes: &[Node], before: &[Curve], nothing_else: bool) -> Vec<Node> {
    let mut ends: Vec<Vec<CurveId>> = vec![Vec::new(); nodes.len()];
    for (i, c) in curves.iter_mut().enumerate() {
        c.id = CurveId::from_index(i);
        for n in &c.nodes {
            ends[n.index()].push(c.id);
        }
    }
    let lone = |n: &Node| nothing_else && before.is_empty() && n.curves.is_empty();
    let mut number = vec![None; nodes.len()];
    let mut out = Vec::new();
    for (n, own) in nodes.iter().zip(ends) {
        if own.is_empty() && !lone(n) {
            continue;
        }
        let id = NodeId::from_index(out.len());
        number[n.id.index()] = Some(id);
        out.push(Node {
            id,
            kind: node_kind(&own, curves),
            persistence: node_persistence(&own, curves),
            curves: own,
            ..n.clone()
        });
    }
    for c in curves {
        c.nodes = c.nodes.iter().filter_map(|n| number[n.index()]).collect();
    }
    out
}
