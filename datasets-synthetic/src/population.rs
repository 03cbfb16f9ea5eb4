//! Populations: individuals of one shape that differ by known modes.
//!
//! A [`Mode`] is a smooth displacement field; an individual is `p + sum_m w_m v_m(p)`, so point positions are **linear** in the weights and the
//! modes, their variances and every correspondence (by vertex index) are known exactly. Seven modes act on every shape, in units of its size:
//! size, elongation, flattening, bend, taper, twist, and a swelling of one end. Weights are independent and normal with the standard deviations given,
//! cut at 2.5 so that every individual stays a diffeomorphic image of the reference (tested).
//!
//! Two families of ellipsoids have one and two modes only, for tests of mode counting.

use crate::deform::Warp;
use crate::deform::warp::Displacement;
use crate::mesh::Bounds;
use crate::sampling::generator;
use crate::shapes::{Shape, ellipsoid};
use glam::{DMat3, DVec3};
use rand::RngExt;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// Random stream of individuals.
const STREAM: u64 = 20;

/// Weights are cut at this many standard deviations.
const CUT: f64 = 2.5;

/// A way in which individuals differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mode {
    /// What it does.
    pub name: String,
    /// Standard deviation of its weight over the population.
    pub standard_deviation: f64,
    /// Its displacement field for weight 1, mm.
    pub field: Vec<Displacement>,
}

/// One member of a population.
#[derive(Clone, Debug)]
pub struct Individual {
    /// Weight of every mode, in the order of the modes.
    pub weights: Vec<f64>,
    /// The map from the reference to this individual.
    pub warp: Warp,
    /// Its shape; meshes correspond to the reference's by index.
    pub shape: Shape,
}

/// A population with its truth.
#[derive(Clone, Debug)]
pub struct Population {
    /// The mean shape.
    pub reference: Shape,
    /// Its modes.
    pub modes: Vec<Mode>,
    /// Its members.
    pub individuals: Vec<Individual>,
}

/// `a b^T` of unit vectors.
fn form(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The seven modes for a shape that fills `bounds`.
pub fn modes(bounds: &Bounds) -> Vec<Mode> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let half = 0.5 * bounds.size().max_element();
    let linear = |d: DVec3| vec![Displacement::Linear(DMat3::from_diagonal(d))];
    let quadratic = |direction: DVec3, a: DVec3, b: DVec3| Displacement::Quadratic {
        direction: direction / half,
        form: form(a, b),
    };
    let mode = |name: &str, standard_deviation: f64, field: Vec<Displacement>| Mode {
        name: name.to_string(),
        standard_deviation,
        field,
    };
    let end = bounds.centre() + 0.6 * half * x;
    vec![
        mode("size", 0.06, linear(DVec3::ONE)),
        mode("elongation", 0.05, linear(DVec3::new(1.0, -0.5, -0.5))),
        mode("flattening", 0.05, linear(DVec3::new(0.0, 1.0, -1.0))),
        mode("bend", 0.06, vec![quadratic(y, x, x)]),
        mode("taper", 0.08, vec![quadratic(y, x, y), quadratic(z, x, z)]),
        mode("twist", 0.10, vec![quadratic(-y, x, z), quadratic(z, x, y)]),
        mode(
            "swelling",
            0.12,
            vec![Displacement::Swelling {
                centre: end,
                sigma: 0.45 * half,
            }],
        ),
    ]
}

/// The map of an individual with those weights.
pub fn warp_of(modes: &[Mode], weights: &[f64]) -> Warp {
    let terms = modes
        .iter()
        .zip(weights)
        .flat_map(|(mode, &w)| mode.field.iter().map(move |&d| (w, d)));
    Warp::Displacement(terms.collect())
}

fn with_weights(reference: &Shape, modes: &[Mode], weights: Vec<f64>) -> Individual {
    let warp = warp_of(modes, &weights);
    let shape = reference.warped(&warp);
    Individual { weights, warp, shape }
}

/// One random individual of a shape.
pub fn individual(reference: &Shape, seed: u64) -> Individual {
    let modes = modes(&reference.bounds());
    let mut rng = generator(seed, STREAM);
    let weights = modes
        .iter()
        .map(|mode| {
            let z: f64 = rng.sample(StandardNormal);
            mode.standard_deviation * z.clamp(-CUT, CUT)
        })
        .collect();
    with_weights(reference, &modes, weights)
}

/// `count` random individuals of a shape; member `i` is `individual(reference, seed + i)`.
pub fn population(reference: &Shape, count: usize, seed: u64) -> Population {
    Population {
        reference: reference.clone(),
        modes: modes(&reference.bounds()),
        individuals: (0..count as u64)
            .map(|i| individual(reference, seed + i))
            .collect(),
    }
}

/// Ellipsoids 3 x 2 x 1 whose longest axis alone varies: `x -> (1 + w) x`, `w` evenly spaced over `+-0.25`. One mode holds all the variance.
pub fn one_mode_ellipsoids(count: usize) -> Population {
    ellipsoid_family(count, &[("length", 0.25, DVec3::X)])
}

/// Ellipsoids 3 x 2 x 1 whose two longest axes vary independently, on a spiral of weights that are uncorrelated in the sample up to `1 / count`.
pub fn two_mode_ellipsoids(count: usize) -> Population {
    ellipsoid_family(count, &[("length", 0.25, DVec3::X), ("width", 0.12, DVec3::Y)])
}

fn ellipsoid_family(count: usize, spec: &[(&str, f64, DVec3)]) -> Population {
    let reference = ellipsoid(3.0, 2.0, 1.0);
    let modes: Vec<Mode> = spec
        .iter()
        .map(|&(name, reach, axis)| Mode {
            name: name.to_string(),
            // Uniform over +-reach.
            standard_deviation: reach / 3f64.sqrt(),
            field: vec![Displacement::Linear(DMat3::from_diagonal(axis))],
        })
        .collect();
    let individuals = (0..count)
        .map(|i| {
            let even = (2.0 * i as f64 + 1.0) / count as f64 - 1.0;
            let golden = 2.0 * ((i as f64 + 0.5) * 0.618_033_988_749_895).fract() - 1.0;
            let weights = spec
                .iter()
                .zip([even, golden])
                .map(|(&(_, reach, _), place)| reach * place)
                .collect();
            with_weights(&reference, &modes, weights)
        })
        .collect();
    Population {
        reference,
        modes,
        individuals,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bones::{Bone, bone};

    #[test]
    fn individuals_are_diffeomorphic_images_linear_in_their_weights() {
        for kind in Bone::ALL {
            let reference = bone(kind, 0);
            let modes = modes(&reference.bounds());
            let points = reference.mesh(1_500).points;
            for seed in 1..=10 {
                let one = individual(&reference, seed);
                assert!(one.warp.least_determinant(&points) > 0.25, "{kind:?} {seed}");
                let double: Vec<f64> = one.weights.iter().map(|w| 0.5 * w).collect();
                let half = warp_of(&modes, &double);
                for &p in points.iter().step_by(50) {
                    assert!((half.apply(p) - p).distance(0.5 * (one.warp.apply(p) - p)) < 1e-12);
                }
            }
            // The worst corner of the cut distribution.
            for sign in [1.0, -1.0] {
                let weights: Vec<f64> = modes.iter().map(|m| sign * CUT * m.standard_deviation).collect();
                let least = warp_of(&modes, &weights).least_determinant(&points);
                assert!(least > 0.02, "{kind:?}: {least}");
            }
        }
    }

    #[test]
    fn individuals_are_closed_and_correspond() {
        let reference = bone(Bone::Capitate, 0);
        let family = population(&reference, 3, 5);
        let mean = reference.mesh(2_000);
        for member in &family.individuals {
            let mesh = member.shape.mesh(2_000);
            assert!(mesh.topology().is_closed_oriented_manifold() && mesh.volume() > 0.0);
            assert_eq!(mesh.triangles, mean.triangles);
            let worst = mesh
                .points
                .iter()
                .zip(&mean.points)
                .map(|(p, q)| p.distance(member.warp.apply(*q)));
            assert!(worst.fold(0.0, f64::max) < 1e-12);
            let field = member.shape.field().expect("a solid");
            let sample = member.shape.sample_uniform(200, 1);
            assert!(sample.points.iter().all(|&p| field.value(p).abs() < 1e-8));
        }
        assert_ne!(family.individuals[0].weights, family.individuals[1].weights);
    }

    #[test]
    fn ellipsoid_families_have_their_volumes() {
        for family in [one_mode_ellipsoids(7), two_mode_ellipsoids(7)] {
            let base = family.reference.mesh(4_000).volume();
            for member in &family.individuals {
                let grown: f64 = member.weights.iter().map(|w| 1.0 + w).product();
                assert!((member.shape.mesh(4_000).volume() / (base * grown) - 1.0).abs() < 1e-9);
            }
        }
    }
}
