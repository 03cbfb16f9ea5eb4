//! Smooth maps of space with exact Jacobians and inverses.
//!
//! A [`Warp`] moves points; applied to the vertices of a mesh it gives a second mesh with the same
//! triangles, so every correspondence is known. Because each warp knows its Jacobian, a test can check that it
//! is a diffeomorphism over a shape (positive determinant) and can integrate volume changes.
//!
//! | warp | map | determinant |
//! |---|---|---|
//! | rigid, affine | `A p + t` | `det A` |
//! | bend | the x axis becomes a circle of curvature `c` in the xy plane | `1 - c y` |
//! | twist | cross sections turn about the x axis by `rate x` | 1 |
//! | taper | cross sections scale about the x axis by `1 + slope x` | `(1 + slope x)^2` |
//! | displacement | `p + sum w_i v_i(p)`, linear in the weights: the modes of populations | by `Jacobian` |
//! | chain | one after the other | product |
//!
//! Bend about a shape that is symmetric in y, and twist about any, keep the volume exactly
//! (`integral of (1 - c y) = volume - c * first moment`).

use super::rigid::RigidMotion;
use crate::mesh::Bounds;
use crate::sampling::{generator, stream};
use glam::{DMat3, DVec3};
use rand::RngExt;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// A smooth map of space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Warp {
    /// Rigid motion or mirror image.
    Rigid(RigidMotion),
    /// Affine map `matrix p + translation`.
    Affine {
        /// Linear part.
        matrix: DMat3,
        /// Translation, mm.
        translation: DVec3,
    },
    /// Bends the x axis to a circle of that curvature [1/mm] towards +y.
    Bend {
        /// Curvature, 1/mm.
        curvature: f64,
    },
    /// Turns cross sections about the x axis.
    Twist {
        /// Turn, rad/mm.
        rate: f64,
    },
    /// Scales cross sections about the x axis by `1 + slope x`.
    Taper {
        /// Relative scale, 1/mm.
        slope: f64,
    },
    /// Adds a weighted sum of displacement fields.
    Displacement(Vec<(f64, Displacement)>),
    /// One after the other, first to last.
    Chain(Vec<Warp>),
}

/// A smooth vector field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Displacement {
    /// `matrix p`.
    Linear(DMat3),
    /// `direction (p . form p)`.
    Quadratic {
        /// Where points go.
        direction: DVec3,
        /// Symmetric or not; 1/mm^2 when `direction` is in mm.
        form: DMat3,
    },
    /// `vector exp(-|p - centre|^2 / 2 sigma^2)`.
    Gaussian {
        /// Centre, mm.
        centre: DVec3,
        /// Width, mm.
        sigma: f64,
        /// Displacement at the centre, mm.
        vector: DVec3,
    },
    /// `(p - centre) exp(-|p - centre|^2 / 2 sigma^2)`: swelling about a centre.
    Swelling {
        /// Centre, mm.
        centre: DVec3,
        /// Width, mm.
        sigma: f64,
    },
}

impl Displacement {
    /// The vector at `p`.
    pub fn at(&self, p: DVec3) -> DVec3 {
        match *self {
            Displacement::Linear(m) => m * p,
            Displacement::Quadratic { direction, form } => direction * p.dot(form * p),
            Displacement::Gaussian {
                centre,
                sigma,
                vector,
            } => vector * bell(p - centre, sigma),
            Displacement::Swelling { centre, sigma } => (p - centre) * bell(p - centre, sigma),
        }
    }

    /// The derivative at `p`.
    pub fn jacobian(&self, p: DVec3) -> DMat3 {
        match *self {
            Displacement::Linear(m) => m,
            Displacement::Quadratic { direction, form } => outer(direction, (form + form.transpose()) * p),
            Displacement::Gaussian {
                centre,
                sigma,
                vector,
            } => {
                let d = p - centre;
                outer(vector, d * (-bell(d, sigma) / (sigma * sigma)))
            }
            Displacement::Swelling { centre, sigma } => {
                let d = p - centre;
                let b = bell(d, sigma);
                DMat3::from_diagonal(DVec3::splat(b)) + outer(d, d * (-b / (sigma * sigma)))
            }
        }
    }
}

fn bell(d: DVec3, sigma: f64) -> f64 {
    (-d.length_squared() / (2.0 * sigma * sigma)).exp()
}

/// `a b^T`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

impl Warp {
    /// The map that moves nothing.
    pub fn identity() -> Self {
        Warp::Rigid(RigidMotion::default())
    }

    /// Bend of the x axis with that curvature [1/mm] towards +y.
    pub fn bend_x(curvature: f64) -> Self {
        Warp::Bend { curvature }
    }

    /// Uniform scaling about the origin.
    pub fn scale(factor: f64) -> Self {
        Warp::Affine {
            matrix: DMat3::from_diagonal(DVec3::splat(factor)),
            translation: DVec3::ZERO,
        }
    }

    /// Local growth: space swells about `centre`, by the factor `1 + amount` there, fading over `sigma` mm.
    ///
    /// A diffeomorphism for `-1 < amount < 2.24` (the radial derivative
    /// `1 + amount (1 - t) exp(-t / 2)`, `t = (distance / sigma)^2`, is least at `t = 3`).
    pub fn swelling(centre: DVec3, sigma: f64, amount: f64) -> Self {
        Warp::Displacement(vec![(amount, Displacement::Swelling { centre, sigma })])
    }

    /// A random smooth warp of the space around `bounds`: eight Gaussian displacements, random in place and direction,
    /// of width 0.3 diagonals, whose root-mean-square size over the box is `amplitude` mm.
    ///
    /// The amplitude is reduced when needed to keep the Lipschitz constant of the displacement at most one half, so
    /// the map is a diffeomorphism of the whole space.
    pub fn random_smooth(bounds: &Bounds, amplitude: f64, seed: u64) -> Self {
        let mut rng = generator(seed, stream::WARP);
        let sigma = 0.3 * bounds.diagonal();
        let mut terms = Vec::new();
        for _ in 0..8 {
            let u = DVec3::new(rng.random(), rng.random(), rng.random());
            let mut normal = || -> f64 { rng.sample(StandardNormal) };
            let vector = DVec3::new(normal(), normal(), normal());
            terms.push((
                1.0,
                Displacement::Gaussian {
                    centre: bounds.min + u * bounds.size(),
                    sigma,
                    vector,
                },
            ));
        }
        let raw = Warp::Displacement(terms.clone());
        let probe = 8;
        let mut square = 0.0;
        for i in 0..probe * probe * probe {
            let step = DVec3::new(
                (i % probe) as f64,
                (i / probe % probe) as f64,
                (i / (probe * probe)) as f64,
            );
            let p = bounds.min + (step + 0.5) / probe as f64 * bounds.size();
            square += raw.apply(p).distance_squared(p) / (probe * probe * probe) as f64;
        }
        // |d/dr exp(-r^2 / 2 s^2)| is at most exp(-1/2) / s.
        let lipschitz: f64 = terms
            .iter()
            .map(|(_, d)| match d {
                Displacement::Gaussian { vector, .. } => vector.length() * (-0.5f64).exp() / sigma,
                _ => 0.0,
            })
            .sum();
        let weight = (amplitude / square.sqrt()).min(0.5 / lipschitz);
        terms.iter_mut().for_each(|t| t.0 = weight);
        Warp::Displacement(terms)
    }

    /// First `self`, then `next`.
    pub fn then(self, next: Warp) -> Self {
        match self {
            Warp::Chain(mut all) => {
                all.push(next);
                Warp::Chain(all)
            }
            first => Warp::Chain(vec![first, next]),
        }
    }

    /// Image of a point.
    pub fn apply(&self, p: DVec3) -> DVec3 {
        match self {
            Warp::Rigid(motion) => motion.apply(p),
            Warp::Affine { matrix, translation } => *matrix * p + *translation,
            Warp::Bend { curvature } => {
                let (angle, r) = (curvature * p.x, 1.0 / curvature - p.y);
                if *curvature == 0.0 {
                    return p;
                }
                DVec3::new(r * angle.sin(), 1.0 / curvature - r * angle.cos(), p.z)
            }
            Warp::Twist { rate } => DMat3::from_rotation_x(rate * p.x) * p,
            Warp::Taper { slope } => {
                let s = 1.0 + slope * p.x;
                DVec3::new(p.x, s * p.y, s * p.z)
            }
            Warp::Displacement(terms) => p + terms.iter().map(|(w, d)| *w * d.at(p)).sum::<DVec3>(),
            Warp::Chain(all) => all.iter().fold(p, |q, warp| warp.apply(q)),
        }
    }

    /// Derivative of the map at `p`.
    pub fn jacobian(&self, p: DVec3) -> DMat3 {
        match self {
            Warp::Rigid(motion) => motion.rotation,
            Warp::Affine { matrix, .. } => *matrix,
            Warp::Bend { curvature } => {
                let angle = curvature * p.x;
                let s = 1.0 - curvature * p.y;
                DMat3::from_cols(
                    DVec3::new(s * angle.cos(), s * angle.sin(), 0.0),
                    DVec3::new(-angle.sin(), angle.cos(), 0.0),
                    DVec3::Z,
                )
            }
            Warp::Twist { rate } => {
                let turn = DMat3::from_rotation_x(rate * p.x);
                let image = turn * p;
                DMat3::from_cols(
                    DVec3::new(1.0, -rate * image.z, rate * image.y),
                    turn.y_axis,
                    turn.z_axis,
                )
            }
            Warp::Taper { slope } => {
                let s = 1.0 + slope * p.x;
                DMat3::from_cols(
                    DVec3::new(1.0, slope * p.y, slope * p.z),
                    DVec3::Y * s,
                    DVec3::Z * s,
                )
            }
            Warp::Displacement(terms) => terms
                .iter()
                .fold(DMat3::IDENTITY, |sum, (w, d)| sum + d.jacobian(p) * *w),
            Warp::Chain(all) => {
                let mut q = p;
                let mut product = DMat3::IDENTITY;
                for warp in all {
                    product = warp.jacobian(q) * product;
                    q = warp.apply(q);
                }
                product
            }
        }
    }

    /// The point whose image is `p`: closed form, or Newton's method with step halving for displacements.
    ///
    /// For points that no point maps to (a taper beyond its apex) the result is the closest iterate found.
    pub fn inverse(&self, p: DVec3) -> DVec3 {
        match self {
            Warp::Rigid(motion) => motion.inverse().apply(p),
            Warp::Affine { matrix, translation } => matrix.inverse() * (p - *translation),
            Warp::Bend { curvature } => {
                if *curvature == 0.0 {
                    return p;
                }
                let side = curvature.signum();
                let v = 1.0 / curvature - p.y;
                let angle = (side * p.x).atan2(side * v);
                DVec3::new(angle / curvature, 1.0 / curvature - side * p.x.hypot(v), p.z)
            }
            Warp::Twist { rate } => DMat3::from_rotation_x(-rate * p.x) * p,
            Warp::Taper { slope } => {
                let s = 1.0 + slope * p.x;
                DVec3::new(p.x, p.y / s, p.z / s)
            }
            Warp::Displacement(_) => self.newton_inverse(p),
            Warp::Chain(all) => all.iter().rev().fold(p, |q, warp| warp.inverse(q)),
        }
    }

    fn newton_inverse(&self, target: DVec3) -> DVec3 {
        let mut q = target;
        let mut error = target - self.apply(q);
        for _ in 0..30 {
            if error.length_squared() < 1e-28 * (1.0 + target.length_squared()) {
                break;
            }
            let step = self.jacobian(q).inverse() * error;
            let mut scale = 1.0;
            loop {
                let next = q + scale * step;
                let next_error = target - self.apply(next);
                if next_error.length_squared() < error.length_squared() {
                    (q, error) = (next, next_error);
                    break;
                }
                scale *= 0.5;
                if scale < 1e-3 {
                    return q;
                }
            }
        }
        q
    }

    /// Least determinant of the Jacobian over some points: positive means locally one-to-one and orientation-keeping.
    pub fn least_determinant(&self, points: &[DVec3]) -> f64 {
        points
            .iter()
            .map(|&p| self.jacobian(p).determinant())
            .fold(f64::INFINITY, f64::min)
    }

    /// Volume of the image of the solid in a closed mesh, by the divergence theorem over the mapped triangles with
    /// each triangle split into `4^levels`: converges to the volume of the smoothly warped polyhedron.
    pub fn image_volume(&self, mesh: &crate::TriangleMesh, levels: u32) -> f64 {
        let fine = crate::shapes::subdivide(mesh, 1 << levels);
        fine.mapped(|p| self.apply(p)).volume()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<Warp> {
        let bounds = Bounds::centred(DVec3::new(3.0, 2.0, 1.0));
        vec![
            Warp::Rigid(crate::deform::rigid::random(3)),
            Warp::scale(1.3),
            Warp::bend_x(0.2),
            Warp::bend_x(-0.15),
            Warp::Twist { rate: 0.3 },
            Warp::Taper { slope: 0.1 },
            Warp::swelling(DVec3::X, 1.0, 0.8),
            Warp::swelling(DVec3::X, 1.0, -0.5),
            Warp::random_smooth(&bounds, 0.3, 9),
            Warp::bend_x(0.1)
                .then(Warp::Twist { rate: 0.1 })
                .then(Warp::random_smooth(&bounds, 0.2, 1)),
            Warp::Displacement(vec![(
                0.05,
                Displacement::Quadratic {
                    direction: DVec3::Y,
                    form: DMat3::from_diagonal(DVec3::X),
                },
            )]),
        ]
    }

    #[test]
    fn inverses_jacobians_and_determinants_are_right() {
        for (k, warp) in all().into_iter().enumerate() {
            for i in 0..50 {
                let u = |m: f64| (i as f64 * m).fract() * 2.0 - 1.0;
                let p = DVec3::new(3.0 * u(0.7549), 2.0 * u(0.5698), u(0.433));
                assert!(
                    warp.inverse(warp.apply(p)).distance(p) < 1e-10,
                    "warp {k}: inverse at {p}"
                );
                let j = warp.jacobian(p);
                let h = 1e-6;
                for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                    let numeric = (warp.apply(p + h * axis) - warp.apply(p - h * axis)) / (2.0 * h);
                    assert!((j * axis).distance(numeric) < 1e-7, "warp {k}: derivative at {p}");
                }
                assert!(j.determinant() > 0.05, "warp {k}: not a diffeomorphism at {p}");
            }
        }
    }

    #[test]
    fn known_volumes() {
        let ball = crate::shapes::ellipsoid(3.0, 1.5, 1.0).mesh(20_000);
        let volume = ball.volume();
        assert!((Warp::bend_x(0.2).image_volume(&ball, 1) / volume - 1.0).abs() < 1e-4);
        assert!((Warp::Twist { rate: 0.5 }.image_volume(&ball, 1) / volume - 1.0).abs() < 1e-3);
        assert!((Warp::scale(1.1).image_volume(&ball, 0) / volume - 1.331).abs() < 1e-12);
        // Taper of a body symmetric in x: volume grows by slope^2 times the mean of x^2 = a^2 / 5.
        let expected = 1.0 + 0.01 * 9.0 / 5.0;
        assert!((Warp::Taper { slope: 0.1 }.image_volume(&ball, 1) / volume - expected).abs() < 1e-3);
    }
}
