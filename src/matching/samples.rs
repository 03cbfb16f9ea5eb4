//! A scaffold as points with radii.
//!
//! In: a coarse scaffold. Out: medial points `(x, y, z, r)` spread by the share of the surface they stand for: sheets by area,
//! wires by `pi r` times length (half the tube's surface, as a sheet's area is half its slab's), a lone node by `pi r^2`.
//! Elements near the cut fade in with their persistence, so that whether they are there changes nothing abruptly.
//! A scaffold without sheet meshes (read from `scaffold.json`) is known by its curves, spread by length.
//!
//! Cost: `O(triangles + samples)`.

use crate::coarse_scaffold::hypergraph::{CoarseScaffold, CurveKind, MedialPoint};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Medial points in random order: any prefix is a fair sample.
#[derive(Clone, Debug, Default)]
pub(crate) struct MedialSamples {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) radii: Vec<f64>,
}

/// A triangle or segment that carries samples.
struct Carrier {
    corners: [MedialPoint; 3],
    weight: f64,
}

impl MedialSamples {
    /// Draws `count` medial points; none when the scaffold is empty. `cut_mm` is the persistence at which elements fade in.
    pub(crate) fn new(scaffold: &CoarseScaffold, cut_mm: f64, count: usize, seed: u64) -> Self {
        let carriers = carriers(scaffold, cut_mm);
        let total: f64 = carriers.iter().map(|c| c.weight).sum();
        if total <= 0.0 {
            return Self::default();
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut drawn = Vec::with_capacity(count);
        let (mut at, mut sum) = (0, carriers[0].weight);
        for k in 0..count {
            let mark = (k as f64 + rng.random::<f64>()) / count as f64 * total;
            while sum < mark && at + 1 < carriers.len() {
                at += 1;
                sum += carriers[at].weight;
            }
            let (mut u, mut v) = (rng.random::<f64>(), rng.random::<f64>());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = carriers[at].corners;
            let mix = |x: f64, y: f64, z: f64| x * (1.0 - u - v) + y * u + z * v;
            let position = a.position * (1.0 - u - v) + b.position * u + c.position * v;
            drawn.push((position, mix(a.radius, b.radius, c.radius)));
        }
        for i in (1..drawn.len()).rev() {
            drawn.swap(i, rng.random_range(0..=i));
        }
        let (positions, radii) = drawn.into_iter().unzip();
        Self { positions, radii }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The mirror image, `x -> -x`.
    pub(crate) fn mirror_image(&self) -> Self {
        Self {
            positions: self
                .positions
                .iter()
                .map(|p| DVec3::new(-p.x, p.y, p.z))
                .collect(),
            radii: self.radii.clone(),
        }
    }

    /// The same points with all lengths divided by `unit`.
    pub(crate) fn scaled(&self, unit: f64) -> Self {
        Self {
            positions: self.positions.iter().map(|p| *p / unit).collect(),
            radii: self.radii.iter().map(|r| r / unit).collect(),
        }
    }

    /// Size of the shape the points stand for, mm: root mean square of the distance from the centroid and the radius.
    pub(crate) fn size(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let spread = super::moments::moments(&self.positions)
            .deviations
            .length_squared();
        let radius = self.radii.iter().map(|r| r * r).sum::<f64>() / self.radii.len() as f64;
        (spread + radius).sqrt()
    }
}

/// 0 at the cut, 1 at twice the cut.
pub(crate) fn fade(persistence: f64, cut_mm: f64) -> f64 {
    if cut_mm > 0.0 {
        ((persistence - cut_mm) / cut_mm).clamp(0.0, 1.0)
    } else {
        1.0
    }
}

fn carriers(scaffold: &CoarseScaffold, cut_mm: f64) -> Vec<Carrier> {
    let mut out = Vec::new();
    for sheet in &scaffold.sheets {
        let share = fade(sheet.persistence, cut_mm);
        for t in &sheet.mesh.triangles {
            let corners = t.map(|i| sheet.mesh.vertices[i as usize]);
            let [a, b, c] = corners.map(|m| m.position);
            out.push(Carrier {
                corners,
                weight: share * 0.5 * (b - a).cross(c - a).length(),
            });
        }
    }
    let bare = out.is_empty() && !scaffold.sheets.is_empty();
    for curve in &scaffold.curves {
        if curve.kind == CurveKind::Wire || bare {
            let share = fade(curve.persistence, cut_mm);
            let closing = curve
                .closed
                .then(|| curve.polyline.last().zip(curve.polyline.first()))
                .flatten();
            let pairs = curve
                .polyline
                .windows(2)
                .map(|w| (w[0], w[1]))
                .chain(closing.map(|(a, b)| (*a, *b)));
            for (a, b) in pairs {
                let length = a.position.distance(b.position);
                let weight = share * length * std::f64::consts::PI * 0.5 * (a.radius + b.radius);
                out.push(Carrier {
                    corners: [a, b, a],
                    weight,
                });
            }
        }
    }
    if out.iter().all(|c| c.weight <= 0.0) {
        // Nothing but what sits at the cut, or a ball: take everything there is, at full weight.
        for carrier in &mut out {
            let [a, b, c] = carrier.corners.map(|m| m.position);
            carrier.weight = 0.5 * (b - a).cross(c - a).length() + (b - a).length() * 1e-9;
        }
        for node in &scaffold.nodes {
            let p = MedialPoint {
                position: node.position,
                radius: node.radius,
            };
            let weight = std::f64::consts::PI * node.radius * node.radius;
            out.push(Carrier {
                corners: [p; 3],
                weight,
            });
        }
    }
    out.retain(|c| c.weight > 0.0);
    out
}
