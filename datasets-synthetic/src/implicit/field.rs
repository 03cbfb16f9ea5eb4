//! Fields: expression trees of implicit primitives with exact gradients.
//!
//! A [`Field`] is negative inside, zero on the surface and positive outside. Primitives marked *exact*
//! are signed distances; the others are scaled so that their gradient has about unit length near the
//! surface, which is what blending and projection need.
//!
//! Blends use the log-sum-exp soft minimum `-k ln sum exp(-f_i / k)`: smooth of every order, symmetric in
//! its terms, and its gradient is the soft-max mean of the gradients. A blend of terms that are all far
//! apart (compared with `k`) equals their union; where `m` terms coincide the surface bulges by `k ln m`.

use crate::deform::Warp;
use glam::{DMat3, DVec3};
use std::sync::Arc;

/// An implicit solid. Cheap to clone (sub-trees are shared).
#[derive(Clone, Debug)]
pub enum Field {
    /// Ball; exact.
    Ball {
        /// Centre, mm.
        centre: DVec3,
        /// Radius, mm.
        radius: f64,
    },
    /// Superellipsoid `sum |q_i / radii_i|^power = 1` in its own axes (`power` 2 is an ellipsoid, higher
    /// is boxier).
    Superellipsoid {
        /// Centre, mm.
        centre: DVec3,
        /// Columns are the solid's axes.
        axes: DMat3,
        /// Half lengths along the axes, mm.
        radii: DVec3,
        /// Exponent, at least 1; multiples of one half are the fastest.
        power: f64,
        /// Geometric mean of the radii, mm: makes the gradient about one in the mean over directions.
        mean_radius: f64,
    },
    /// Axis-aligned box; exact.
    Box {
        /// Least corner, mm.
        min: DVec3,
        /// Greatest corner, mm.
        max: DVec3,
    },
    /// Points below a plane: `normal . p <= offset`; exact.
    HalfSpace {
        /// Unit normal, pointing out.
        normal: DVec3,
        /// Signed distance of the plane from the origin, mm.
        offset: f64,
    },
    /// Balls of one radius along a polyline (a capsule when it has two points); exact outside and near the surface.
    Tube {
        /// Centreline, mm; closed when the first point is repeated at the end.
        centreline: Arc<Vec<DVec3>>,
        /// Radius, mm.
        radius: f64,
    },
    /// Balls of linearly varying radius along a segment, approximated by interpolating the radius at the foot
    /// point (within `slope^2 / 2` of the exact round cone).
    Cone {
        /// Ends, mm.
        ends: [DVec3; 2],
        /// Radii at the ends, mm.
        radii: [f64; 2],
    },
    /// Solid torus around the z axis; exact.
    Torus {
        /// Radius of the core circle, mm.
        major: f64,
        /// Radius of the tube, mm.
        minor: f64,
    },
    /// Points within `radius` of a disk with round holes in the plane z = 0; exact outside the disk's edge curves.
    Plate {
        /// Radius of the disk, mm.
        disk: f64,
        /// Centres (x, y) and radii of the holes, mm.
        holes: Arc<Vec<([f64; 2], f64)>>,
        /// Thickness / 2, mm.
        radius: f64,
    },
    /// Star-shaped solid around the origin.
    Star(Arc<crate::shapes::star::StarRadius>),
    /// Union (minimum); creases stay sharp.
    Union(Arc<Vec<Field>>),
    /// Intersection (maximum); edges stay sharp.
    Intersection(Arc<Vec<Field>>),
    /// Smooth union with blending length `k` mm.
    Blend {
        /// Blending length, mm.
        k: f64,
        /// What is joined.
        terms: Arc<Vec<Field>>,
    },
    /// Smooth intersection with blending length `k` mm.
    Carve {
        /// Blending length, mm.
        k: f64,
        /// What is intersected (use [`Field::outside`] for tools to be removed).
        terms: Arc<Vec<Field>>,
    },
    /// Complement.
    Outside(Arc<Field>),
    /// The surface moved outwards by `distance` mm (inwards when negative).
    Offset {
        /// What is moved.
        of: Arc<Field>,
        /// Outward distance, mm.
        distance: f64,
    },
    /// Scaled along the coordinate axes, then shifted; the value is scaled by the mean factor.
    Stretched {
        /// What is stretched.
        of: Arc<Field>,
        /// Factor along each axis.
        scale: DVec3,
        /// Shift afterwards, mm.
        shift: DVec3,
        /// Geometric mean of the factors.
        mean_factor: f64,
    },
    /// The surface made gently uneven: plane waves are added to the field.
    Relief {
        /// What is made uneven.
        of: Arc<Field>,
        /// Waves: vector [rad/mm], phase (rad) and amplitude (mm).
        waves: Arc<Vec<(DVec3, f64, f64)>>,
    },
    /// The image of a solid under a smooth map.
    Warped {
        /// The solid before.
        of: Arc<Field>,
        /// The map from before to after.
        warp: Arc<Warp>,
    },
}

/// Value and gradient of a field at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldSample {
    /// Negative inside.
    pub value: f64,
    /// Gradient; about unit length near the surface.
    pub gradient: DVec3,
}

impl Field {
    /// Ellipsoid or superellipsoid with axes given by a rotation.
    pub fn superellipsoid(centre: DVec3, axes: DMat3, radii: DVec3, power: f64) -> Self {
        Field::Superellipsoid {
            centre,
            axes,
            radii,
            power,
            mean_radius: (radii.x * radii.y * radii.z).cbrt(),
        }
    }

    /// Capsule: balls of `radius` along a segment.
    pub fn capsule(a: DVec3, b: DVec3, radius: f64) -> Self {
        Field::Tube {
            centreline: Arc::new(vec![a, b]),
            radius,
        }
    }

    /// Scaled along the coordinate axes, then shifted.
    pub fn stretched(self, scale: DVec3, shift: DVec3) -> Self {
        let mean_factor = (scale.x * scale.y * scale.z).cbrt();
        Field::Stretched {
            of: Arc::new(self),
            scale,
            shift,
            mean_factor,
        }
    }

    /// Sharp union.
    pub fn union(terms: Vec<Field>) -> Self {
        Field::Union(Arc::new(terms))
    }

    /// Sharp intersection.
    pub fn intersection(terms: Vec<Field>) -> Self {
        Field::Intersection(Arc::new(terms))
    }

    /// Smooth union.
    pub fn blend(k: f64, terms: Vec<Field>) -> Self {
        Field::Blend {
            k,
            terms: Arc::new(terms),
        }
    }

    /// Smooth difference: `self` without the `tools`.
    pub fn carved(self, k: f64, tools: Vec<Field>) -> Self {
        let terms = std::iter::once(self)
            .chain(tools.into_iter().map(Field::outside))
            .collect();
        Field::Carve {
            k,
            terms: Arc::new(terms),
        }
    }

    /// Complement.
    pub fn outside(self) -> Self {
        Field::Outside(Arc::new(self))
    }

    /// Image under a smooth map.
    pub fn warped(self, warp: Warp) -> Self {
        Field::Warped {
            of: Arc::new(self),
            warp: Arc::new(warp),
        }
    }

    /// Value at `p`: negative inside.
    pub fn value(&self, p: DVec3) -> f64 {
        match self {
            Field::Union(terms) => terms.iter().map(|t| t.value(p)).fold(f64::INFINITY, f64::min),
            Field::Intersection(terms) => terms.iter().map(|t| t.value(p)).fold(f64::NEG_INFINITY, f64::max),
            Field::Blend { k, terms } => {
                let least = terms.iter().map(|t| t.value(p)).fold(f64::INFINITY, f64::min);
                // Second walk instead of a buffer: terms are cheap and allocation is not.
                let sum: f64 = terms.iter().map(|t| (-(t.value(p) - least) / k).exp()).sum();
                least - k * sum.ln()
            }
            Field::Carve { k, terms } => {
                let most = terms.iter().map(|t| t.value(p)).fold(f64::NEG_INFINITY, f64::max);
                let sum: f64 = terms.iter().map(|t| ((t.value(p) - most) / k).exp()).sum();
                most + k * sum.ln()
            }
            Field::Outside(of) => -of.value(p),
            Field::Offset { of, distance } => of.value(p) - distance,
            Field::Stretched {
                of,
                scale,
                shift,
                mean_factor,
            } => mean_factor * of.value((p - shift) / scale),
            Field::Relief { of, waves } => {
                of.value(p)
                    + waves
                        .iter()
                        .map(|(k, phase, a)| a * (k.dot(p) + phase).sin())
                        .sum::<f64>()
            }
            Field::Warped { of, warp } => of.value(warp.inverse(p)),
            Field::Star(star) => p.length() - star.radius(p),
            _ => self.primitive(p).value,
        }
    }

    /// Value and gradient at `p`.
    pub fn sample(&self, p: DVec3) -> FieldSample {
        match self {
            Field::Union(terms) => extreme(terms, p, -1.0),
            Field::Intersection(terms) => extreme(terms, p, 1.0),
            Field::Blend { k, terms } => soft_extreme(terms, p, -k),
            Field::Carve { k, terms } => soft_extreme(terms, p, *k),
            Field::Outside(of) => {
                let s = of.sample(p);
                FieldSample {
                    value: -s.value,
                    gradient: -s.gradient,
                }
            }
            Field::Offset { of, distance } => {
                let s = of.sample(p);
                FieldSample {
                    value: s.value - distance,
                    gradient: s.gradient,
                }
            }
            Field::Stretched {
                of,
                scale,
                shift,
                mean_factor,
            } => {
                let s = of.sample((p - shift) / scale);
                FieldSample {
                    value: mean_factor * s.value,
                    gradient: *mean_factor * s.gradient / scale,
                }
            }
            Field::Relief { of, waves } => {
                let mut s = of.sample(p);
                for (k, phase, a) in waves.iter() {
                    let (sin, cos) = (k.dot(p) + phase).sin_cos();
                    s.value += a * sin;
                    s.gradient += *k * (a * cos);
                }
                s
            }
            Field::Warped { of, warp } => {
                let q = warp.inverse(p);
                let s = of.sample(q);
                let gradient = warp.jacobian(q).inverse().transpose() * s.gradient;
                FieldSample {
                    value: s.value,
                    gradient,
                }
            }
            Field::Star(_) => self.numeric(p),
            _ => self.primitive(p),
        }
    }

    /// Moves `p` along the gradient onto the surface (Newton); converges quadratically from nearby.
    ///
    /// At creases of sharp unions the answer is on the surface but need not be the nearest point.
    pub fn project(&self, p: DVec3) -> DVec3 {
        let mut q = p;
        let mut best = (f64::INFINITY, p);
        for _ in 0..12 {
            let s = self.sample(q);
            if s.value.abs() < best.0 {
                best = (s.value.abs(), q);
            }
            if s.value.abs() < 1e-13 {
                break;
            }
            let step = s.gradient * (s.value / s.gradient.length_squared().max(1e-12));
            q -= step;
            if step.length_squared() < 1e-30 {
                break;
            }
        }
        if self.value(q).abs() <= best.0 { q } else { best.1 }
    }

    /// Unit outward normal at a point near the surface.
    pub fn normal(&self, p: DVec3) -> DVec3 {
        self.sample(p).gradient.normalize_or_zero()
    }

    /// Central differences, for fields whose gradient has no short closed form.
    fn numeric(&self, p: DVec3) -> FieldSample {
        let h = 1e-5 * p.length().max(1.0);
        let d = |axis: DVec3| (self.value(p + h * axis) - self.value(p - h * axis)) / (2.0 * h);
        FieldSample {
            value: self.value(p),
            gradient: DVec3::new(d(DVec3::X), d(DVec3::Y), d(DVec3::Z)),
        }
    }

    fn primitive(&self, p: DVec3) -> FieldSample {
        match self {
            Field::Ball { centre, radius } => distance_to(p, *centre, *radius),
            Field::Superellipsoid {
                centre,
                axes,
                radii,
                power,
                mean_radius,
            } => superellipsoid(p - centre, axes, *radii, *power, *mean_radius),
            Field::Box { min, max } => axis_box(p, *min, *max),
            Field::HalfSpace { normal, offset } => FieldSample {
                value: normal.dot(p) - offset,
                gradient: *normal,
            },
            Field::Tube { centreline, radius } => tube(p, centreline, *radius),
            Field::Cone { ends, radii } => {
                let t = segment_parameter(p, ends[0], ends[1]);
                let radius = radii[0] + t * (radii[1] - radii[0]);
                distance_to(p, ends[0].lerp(ends[1], t), radius)
            }
            Field::Torus { major, minor } => {
                let rho = p.x.hypot(p.y);
                let core = DVec3::new(p.x, p.y, 0.0) * (major / rho.max(f64::MIN_POSITIVE));
                distance_to(p, core, *minor)
            }
            Field::Plate { disk, holes, radius } => plate(p, *disk, holes, *radius),
            // Combinations are handled by the callers.
            _ => self.numeric(p),
        }
    }
}

fn distance_to(p: DVec3, foot: DVec3, radius: f64) -> FieldSample {
    let d = p - foot;
    let length = d.length();
    FieldSample {
        value: length - radius,
        gradient: if length > 0.0 { d / length } else { DVec3::Z },
    }
}

/// Parameter in [0, 1] of the point of a segment nearest to `p`.
pub(crate) fn segment_parameter(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let d = b - a;
    let l2 = d.length_squared();
    if l2 > 0.0 {
        ((p - a).dot(d) / l2).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

fn tube(p: DVec3, centreline: &[DVec3], radius: f64) -> FieldSample {
    let mut best = (f64::INFINITY, p);
    for pair in centreline.windows(2) {
        let foot = pair[0].lerp(pair[1], segment_parameter(p, pair[0], pair[1]));
        let d2 = p.distance_squared(foot);
        if d2 < best.0 {
            best = (d2, foot);
        }
    }
    distance_to(p, best.1, radius)
}

fn superellipsoid(p: DVec3, axes: &DMat3, radii: DVec3, power: f64, scale: f64) -> FieldSample {
    let q = axes.transpose() * p / radii;
    let (norm, slope) = if power == 2.0 {
        let n = q.length();
        (n, if n > 0.0 { q / n } else { DVec3::ZERO })
    } else {
        let powers = DVec3::new(
            half_power(q.x.abs(), power),
            half_power(q.y.abs(), power),
            half_power(q.z.abs(), power),
        );
        let sum = powers.element_sum();
        let n = sum.powf(1.0 / power);
        // d n / d q = (|q| / n)^(power - 1) sign q = |q|^power / q * n / sum.
        let slope = |x: f64, xp: f64| if x != 0.0 { xp / x * (n / sum) } else { 0.0 };
        (
            n,
            DVec3::new(slope(q.x, powers.x), slope(q.y, powers.y), slope(q.z, powers.z)),
        )
    };
    let gradient = *axes * (slope / radii) * scale;
    let gradient = if gradient == DVec3::ZERO {
        *axes * DVec3::Z
    } else {
        gradient
    };
    FieldSample {
        value: scale * (norm - 1.0),
        gradient,
    }
}

/// `x^power` for `x >= 0`, without the general power function when `2 power` is a whole number.
fn half_power(x: f64, power: f64) -> f64 {
    let whole = power.floor();
    let part = power - whole;
    if part == 0.0 {
        x.powi(whole as i32)
    } else if part == 0.5 {
        x.powi(whole as i32) * x.sqrt()
    } else {
        x.powf(power)
    }
}

fn axis_box(p: DVec3, min: DVec3, max: DVec3) -> FieldSample {
    let centre = 0.5 * (min + max);
    let q = (p - centre).abs() - 0.5 * (max - min);
    let sign = (p - centre).signum();
    if q.max_element() <= 0.0 {
        let gradient = if q.x >= q.y && q.x >= q.z {
            DVec3::X
        } else if q.y >= q.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        FieldSample {
            value: q.max_element(),
            gradient: gradient * sign,
        }
    } else {
        let out = q.max(DVec3::ZERO);
        let length = out.length();
        FieldSample {
            value: length,
            gradient: out / length * sign,
        }
    }
}

fn plate(p: DVec3, disk: f64, holes: &[([f64; 2], f64)], radius: f64) -> FieldSample {
    let rho = p.x.hypot(p.y);
    let mut outside = rho - disk;
    let mut direction = DVec3::new(p.x, p.y, 0.0) / rho.max(f64::MIN_POSITIVE);
    for &([x, y], hole) in holes {
        let d = DVec3::new(p.x - x, p.y - y, 0.0);
        let length = d.length();
        if hole - length > outside {
            outside = hole - length;
            direction = -d / length.max(f64::MIN_POSITIVE);
        }
    }
    let foot = if outside > 0.0 { p - outside * direction } else { p };
    distance_to(p, DVec3::new(foot.x, foot.y, 0.0), radius)
}

fn extreme(terms: &[Field], p: DVec3, sign: f64) -> FieldSample {
    let mut best = FieldSample {
        value: sign * f64::NEG_INFINITY,
        gradient: DVec3::Z,
    };
    for term in terms {
        let s = term.sample(p);
        if sign * s.value > sign * best.value {
            best = s;
        }
    }
    best
}

/// Log-sum-exp with signed temperature `k`: soft maximum for `k > 0`, soft minimum for `k < 0`.
fn soft_extreme(terms: &[Field], p: DVec3, k: f64) -> FieldSample {
    let mut reference = f64::NAN;
    let mut sum = 0.0;
    let mut gradient = DVec3::ZERO;
    for term in terms {
        let s = term.sample(p);
        if reference.is_nan() {
            reference = s.value;
        }
        let exponent = (s.value - reference) / k;
        // Keep the running sum scaled by its largest term.
        if exponent > 0.0 {
            let shrink = (-exponent).exp();
            sum = sum * shrink + 1.0;
            gradient = gradient * shrink + s.gradient;
            reference = s.value;
        } else {
            let weight = exponent.exp();
            sum += weight;
            gradient += weight * s.gradient;
        }
    }
    FieldSample {
        value: reference + k * sum.ln(),
        gradient: gradient / sum,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn zoo() -> Vec<Field> {
        let axes = DMat3::from_quat(DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(0.7));
        let ellipsoid =
            Field::superellipsoid(DVec3::new(0.1, 0.2, -0.1), axes, DVec3::new(2.0, 1.2, 0.8), 2.0);
        let boxy = Field::superellipsoid(DVec3::ZERO, axes, DVec3::new(1.0, 1.5, 1.2), 3.5);
        let ball = Field::Ball {
            centre: DVec3::new(1.0, 0.5, 0.0),
            radius: 0.7,
        };
        let plate = Field::Plate {
            disk: 3.0,
            holes: Arc::new(vec![([1.5, 0.0], 0.6), ([-1.0, 1.0], 0.5)]),
            radius: 0.3,
        };
        vec![
            ellipsoid.clone(),
            boxy.clone(),
            Field::Box {
                min: DVec3::splat(-1.0),
                max: DVec3::new(1.0, 0.5, 2.0),
            },
            Field::Torus {
                major: 2.0,
                minor: 0.5,
            },
            Field::capsule(DVec3::X, -DVec3::Y, 0.4),
            Field::Cone {
                ends: [DVec3::ZERO, DVec3::X],
                radii: [0.5, 0.3],
            },
            plate,
            Field::blend(0.2, vec![ellipsoid.clone(), ball.clone(), boxy.clone()]),
            ellipsoid.clone().carved(0.1, vec![ball.clone()]),
            Field::Offset {
                of: Arc::new(boxy.clone()),
                distance: 0.2,
            },
            ellipsoid.warped(Warp::bend_x(0.2)),
            Field::union(vec![ball, boxy]),
        ]
    }

    #[test]
    fn gradients_are_the_derivatives_and_projections_land_on_the_surface() {
        for (k, field) in zoo().into_iter().enumerate() {
            for i in 0..60 {
                let u = |m: f64| (i as f64 * m).fract() * 5.0 - 2.5;
                let p = DVec3::new(u(0.754877666), u(0.569840296), u(0.433));
                let s = field.sample(p);
                assert!(
                    (s.value - field.value(p)).abs() < 1e-12,
                    "field {k}: value by two ways"
                );
                if !matches!(field, Field::Cone { .. }) {
                    let error = s.gradient.distance(field.numeric(p).gradient);
                    assert!(
                        error < 1e-6 * s.gradient.length().max(1.0),
                        "field {k} at {p}: gradient off by {error}"
                    );
                }
                if s.value.abs() < 0.3 {
                    assert!(
                        field.value(field.project(p)).abs() < 1e-9,
                        "field {k} at {p}: projection"
                    );
                }
            }
        }
    }
}
