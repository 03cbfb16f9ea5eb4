//! What it costs to deform one element into another when either may be healed from several parts.

use crate::canonical::Canonical;
use crate::hypergraph::{AttributedHypergraph, Kind};
use crate::matching_problem::{AttributeScales, ElementCosts, ProblemError};
use serde::{Deserialize, Serialize};

/// Deformation costs between groups of elements; a group is the original parts of one healed element.
///
/// For the distance to be a metric a cost must obey the triangle inequality and be at least the difference of the groups'
/// weights (that of the heaviest part).
pub trait GroupCosts {
    /// Cost of deforming the target group into the source group; parts heaviest first, never empty; `+inf` forbids.
    fn cost(&self, kind: Kind, target: &[u32], source: &[u32]) -> f64;

    /// A cost that no two groups with these heaviest parts undercut. What is known helps the proof; the difference of the weights
    /// is taken into account anyway.
    fn at_least(&self, _kind: Kind, _target: u32, _source: u32) -> f64 {
        0.0
    }
}

/// A healed element is compared by its heaviest part.
impl GroupCosts for ElementCosts {
    fn cost(&self, kind: Kind, target: &[u32], source: &[u32]) -> f64 {
        self.of(kind)[(target[0] as usize, source[0] as usize)]
    }

    fn at_least(&self, kind: Kind, target: u32, source: u32) -> f64 {
        self.of(kind)[(target as usize, source as usize)]
    }
}

/// Costs between canonical graphs, asked of the costs between the graphs given.
pub(super) struct CanonicalCosts<'a> {
    pub costs: &'a dyn GroupCosts,
    pub canonical: &'a Canonical,
}

impl GroupCosts for CanonicalCosts<'_> {
    fn cost(&self, kind: Kind, target: &[u32], source: &[u32]) -> f64 {
        let (target, source) = if self.canonical.exchanged {
            (source, target)
        } else {
            (target, source)
        };
        let old = |order: &[Vec<u32>; 3], list: &[u32]| -> Vec<u32> {
            list.iter().map(|&x| order[kind.index()][x as usize]).collect()
        };
        self.costs.cost(
            kind,
            &old(&self.canonical.target_order, target),
            &old(&self.canonical.source_order, source),
        )
    }

    fn at_least(&self, kind: Kind, target: u32, source: u32) -> f64 {
        let (target, source) = if self.canonical.exchanged {
            (source, target)
        } else {
            (target, source)
        };
        let old = |order: &[Vec<u32>; 3], x: u32| order[kind.index()][x as usize];
        self.costs.at_least(
            kind,
            old(&self.canonical.target_order, target),
            old(&self.canonical.source_order, source),
        )
    }
}

/// What the attribute of a healed element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MergeRule {
    /// The sum over its parts: lengths, areas, volumes.
    Sum,
    /// The largest of its parts: greatest radius.
    Max,
    /// That of the heaviest part.
    Heaviest,
}

/// Merge rule of every attribute, per kind.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct MergeRules {
    /// One rule per node attribute.
    pub nodes: Vec<MergeRule>,
    /// One rule per curve attribute.
    pub curves: Vec<MergeRule>,
    /// One rule per sheet attribute.
    pub sheets: Vec<MergeRule>,
}

impl MergeRules {
    fn of(&self, kind: Kind) -> &[MergeRule] {
        match kind {
            Kind::Node => &self.nodes,
            Kind::Curve => &self.curves,
            Kind::Sheet => &self.sheets,
        }
    }
}

/// Costs from attributes, `max(|w - w'|, sum_k scale_k |a_k - a'_k|)`, with attributes of healed elements by rule.
#[derive(Debug, Clone)]
pub struct AttributeCosts<'a> {
    target: &'a AttributedHypergraph,
    source: &'a AttributedHypergraph,
    scales: &'a AttributeScales,
    rules: &'a MergeRules,
}

impl<'a> AttributeCosts<'a> {
    /// Checks that scales and rules fit the attributes.
    ///
    /// # Errors
    /// When counts do not agree or a scale is negative or not finite.
    pub fn new(
        target: &'a AttributedHypergraph,
        source: &'a AttributedHypergraph,
        scales: &'a AttributeScales,
        rules: &'a MergeRules,
    ) -> Result<Self, ProblemError> {
        ElementCosts::from_attributes(target, source, scales)?;
        for kind in Kind::ALL {
            let (rules, scales) = (rules.of(kind).len(), scales.of(kind).len());
            if rules != scales {
                return Err(ProblemError::AttributeCount {
                    kind,
                    target: rules,
                    source_count: rules,
                    scales,
                });
            }
        }
        Ok(Self {
            target,
            source,
            scales,
            rules,
        })
    }

    fn attribute(&self, g: &AttributedHypergraph, kind: Kind, parts: &[u32], k: usize) -> f64 {
        let values = parts.iter().map(|&x| g.attributes(kind, x as usize)[k]);
        match self.rules.of(kind)[k] {
            MergeRule::Sum => values.sum(),
            MergeRule::Max => values.fold(f64::NEG_INFINITY, f64::max),
            MergeRule::Heaviest => g.attributes(kind, parts[0] as usize)[k],
        }
    }
}

impl GroupCosts for AttributeCosts<'_> {
    fn cost(&self, kind: Kind, target: &[u32], source: &[u32]) -> f64 {
        let weight = |g: &AttributedHypergraph, x: u32| match kind {
            Kind::Node => g.nodes()[x as usize].weight,
            Kind::Curve => g.curves()[x as usize].weight,
            Kind::Sheet => g.sheets()[x as usize].weight,
        };
        let scales = self.scales.of(kind).iter().enumerate();
        let difference: f64 = scales
            .map(|(k, s)| {
                let a = self.attribute(self.target, kind, target, k);
                s * (a - self.attribute(self.source, kind, source, k)).abs()
            })
            .sum();
        difference.max((weight(self.target, target[0]) - weight(self.source, source[0])).abs())
    }

    /// Attributes of the heaviest part stay what they are; sums and maxima may come out equal.
    fn at_least(&self, kind: Kind, target: u32, source: u32) -> f64 {
        let rules = self.rules.of(kind).iter().zip(self.scales.of(kind)).enumerate();
        rules
            .filter(|(_, (rule, _))| **rule == MergeRule::Heaviest)
            .map(|(k, (_, s))| {
                let a = self.target.attributes(kind, target as usize)[k];
                s * (a - self.source.attributes(kind, source as usize)[k]).abs()
            })
            .sum()
    }
}
