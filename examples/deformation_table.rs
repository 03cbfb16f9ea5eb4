//! Sweeps what can happen to a shape before it is registered, against exact truth: noise, warp, bend, size, missing parts, cuts,
//! one-sided views, clutter, uneven density.
//!
//! `cargo run --release --example deformation_table -- [BONES] [ROW...]`: eight synthetic carpal-like bones (no data needed). The
//! target is a cloud of 4 000 points of the bone, the source one of 2 000 points of the deformed bone in a random pose.
//! Truth is the least-squares motion of corresponding points; for rigid rows that is the motion itself, and where one end grew
//! it is the motion of what did not. Columns: rotation within 5 degrees;
//! within 20 degrees (the right basin: what is asked of shapes that differ); median and worst angle; median distance of corresponding points under the found pose above that under the true one, percent of
//! the diagonal; wrong and right answers flagged, as ambiguous or uncertain.

use datasets_synthetic::bones;
use datasets_synthetic::deform::crop::{crop_half_spaces, random_direction, remove_ball, visible_from};
use datasets_synthetic::{
    Cloud, Shape, Warp, add_noise, add_outliers, mean_spacing, rigid, sample_density_gradient,
};
use glam::{DMat3, DVec3};
use medial_scaffold::geometry::Rigid;
use medial_scaffold::registration::{RegistrationSettings, RegistrationShape, register};

/// What is done to the source.
#[derive(Clone, Copy)]
enum Change {
    Nothing,
    /// Noise, in spacings.
    Noise(f64),
    /// A random smooth warp, share of the diagonal.
    Warp(f64),
    /// Curvature times the diagonal.
    Bend(f64),
    /// Size, with the similarity option.
    Size(f64),
    /// A swelling of one end: its width, and how far the surface moves at most, shares of the diagonal.
    Growth(f64, f64),
    /// A ball taken out, share of the diagonal.
    Missing(f64),
    /// Cut by three planes to a share.
    Cuts(f64),
    /// Seen from one side only, up to 80 degrees from the line of sight.
    OneSided,
    /// Outliers, share of the points.
    Clutter(f64),
    /// Density from one end to the other, one to this.
    Density(f64),
}

const ROWS: [(&str, Change); 23] = [
    ("re-sampled", Change::Nothing),
    ("noise 0.5 spacing", Change::Noise(0.5)),
    ("noise 1 spacing", Change::Noise(1.0)),
    ("warp 1 %", Change::Warp(0.01)),
    ("warp 2 %", Change::Warp(0.02)),
    ("warp 5 %", Change::Warp(0.05)),
    ("warp 8 %", Change::Warp(0.08)),
    ("bend 0.2", Change::Bend(0.2)),
    ("size 0.8", Change::Size(0.8)),
    ("size 1.2", Change::Size(1.2)),
    ("growth 5 %", Change::Growth(0.15, 0.05)),
    ("growth 10 %", Change::Growth(0.15, 0.1)),
    ("local growth 5 %", Change::Growth(0.08, 0.05)),
    ("local growth 10 %", Change::Growth(0.08, 0.1)),
    ("missing ball 15 %", Change::Missing(0.15)),
    ("three cuts to 60 %", Change::Cuts(0.6)),
    ("three cuts to 40 %", Change::Cuts(0.4)),
    ("one-sided", Change::OneSided),
    ("clutter 2 %", Change::Clutter(0.02)),
    ("clutter 5 %", Change::Clutter(0.05)),
    ("density 1:5", Change::Density(5.0)),
    ("density 1:20", Change::Density(20.0)),
    ("thin plate, one-sided", Change::OneSided),
];

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let most = args.iter().find_map(|a| a.parse().ok()).unwrap_or(8);
    let rows: Vec<&String> = args.iter().filter(|a| a.parse::<usize>().is_err()).collect();
    println!(
        "| change of the source | bones | within 5 deg | within 20 deg | median deg | worst deg | extra distance % diag | wrong, flagged | right, flagged |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, change) in ROWS {
        if rows.is_empty() || rows.iter().any(|r| *r == name) {
            row(name, change, most);
        }
    }
}

fn row(name: &str, change: Change, most: usize) {
    let shapes: Vec<Shape> = if name.starts_with("thin plate") {
        (0..most).map(plate).collect()
    } else {
        bones::all(0).into_iter().take(most).collect()
    };
    let (mut errors, mut extra) = (Vec::new(), Vec::new());
    let (mut wrong_flagged, mut right_flagged) = (0, 0);
    for (k, shape) in shapes.iter().enumerate() {
        let seed = 100 + k as u64;
        let diagonal = shape.bounds().diagonal();
        let warp = warp_of(change, shape, seed);
        let target = shape.sample_uniform(4000, seed).points;
        let source = changed(change, shape, &warp, seed);
        let motion = rigid::random(seed);
        let motion = Rigid {
            linear: motion.rotation,
            translation: motion.translation,
        };
        let source: Vec<DVec3> = source.iter().map(|&p| motion.apply(p)).collect();
        // Corresponding points of the whole shape, whatever is left of the source.
        let before = shape.sample_uniform(1000, seed + 7).points;
        let after: Vec<DVec3> = before.iter().map(|&p| motion.apply(warp.apply(p))).collect();
        let truth = match change {
            Change::Growth(..) => motion.inverse(),
            _ => least_squares(&after, &before, matches!(change, Change::Size(_))),
        };
        let settings = RegistrationSettings {
            scale: matches!(change, Change::Size(_)),
            ..Default::default()
        };
        let found = register(
            &RegistrationShape::cloud(&target),
            &RegistrationShape::cloud(&source),
            &settings,
        )
        .expect("the clouds are sound");
        let error = found.T_target_source.rotation_angle_deg(&truth);
        let distance = |pose: &Rigid| {
            let sum: f64 = after
                .iter()
                .zip(&before)
                .map(|(a, b)| pose.apply(*a).distance(*b))
                .sum();
            100.0 * sum / before.len() as f64 / diagonal
        };
        extra.push(distance(&found.T_target_source) - distance(&truth));
        let flagged = found.ambiguous || found.uncertain;
        if error < 5.0 {
            right_flagged += usize::from(flagged);
            if flagged {
                println!(
                    "<!-- {name}, {}: right, {:?}, {:?} {:?} -->",
                    shape.name, found.method, found.ambiguity, found.uncertainty
                );
            }
        } else {
            wrong_flagged += usize::from(flagged);
            println!(
                "<!-- {name}, {} {k}: {error:.1} degrees, {:?}, standard error {:.1}, score {:.3}, {:?} {:?} -->",
                shape.name,
                found.method,
                found.precision.map_or(f64::NAN, |p| p.rotation_deg),
                found.score,
                found.ambiguity,
                found.uncertainty
            );
        }
        errors.push(error);
    }
    let n = errors.len();
    let below = |limit: f64| errors.iter().filter(|e| **e < limit).count();
    let (right, basin) = (below(5.0), below(20.0));
    errors.sort_by(f64::total_cmp);
    extra.sort_by(f64::total_cmp);
    println!(
        "| {name} | {n} | {right}/{n} | {basin}/{n} | {:.2} | {:.1} | {:.2} | {wrong_flagged}/{} | {right_flagged}/{right} |",
        errors[n / 2],
        errors[n - 1],
        extra[n / 2],
        n - right,
    );
}

fn warp_of(change: Change, shape: &Shape, seed: u64) -> Warp {
    let bounds = shape.bounds();
    let diagonal = bounds.diagonal();
    match change {
        Change::Warp(share) => Warp::random_smooth(&bounds, share * diagonal, seed),
        Change::Bend(turn) => Warp::bend_x(turn / diagonal),
        Change::Size(factor) => Warp::scale(factor),
        Change::Growth(width, share) => {
            let end = bounds.centre() + 0.4 * bounds.size() * DVec3::X;
            swelling(end, width * diagonal, share * diagonal)
        }
        _ => Warp::identity(),
    }
}

fn changed(change: Change, shape: &Shape, warp: &Warp, seed: u64) -> Vec<DVec3> {
    let other = seed + 1000;
    let mesh = shape.mesh(12_000);
    let cloud = shape.sample_uniform(2000, other);
    let spacing = mean_spacing(mesh.area(), 2000);
    let diagonal = shape.bounds().diagonal();
    let denser = |share: f64| shape.sample_uniform((2000.0 / share) as usize, other);
    let left: Cloud = match change {
        Change::Missing(share) => remove_ball(&cloud, cloud.points[0], share * diagonal).cloud,
        Change::Cuts(share) => crop_half_spaces(&denser(share), 3, share, other).cloud,
        // A thin plate seen edge-on shows next to nothing: another direction is taken.
        Change::OneSided => (0..20)
            .map(|k| visible_from(&denser(0.5), &mesh, random_direction(other + 100 * k), 80.0).cloud)
            .find(|seen| seen.points.len() >= 1000)
            .expect("one of 20 directions sees the shape"),
        Change::Density(ratio) => sample_density_gradient(&mesh, 2000, ratio, other),
        _ => cloud,
    };
    let points: Vec<DVec3> = left.points.iter().map(|&p| warp.apply(p)).collect();
    match change {
        Change::Noise(spacings) => add_noise(&points, spacings * spacing, other),
        Change::Clutter(share) => add_outliers(&points, share, 0.2, other),
        _ => points,
    }
}

/// A swelling that moves no point farther than `most` mm; it moves those one `sigma` from its centre that far.
fn swelling(centre: DVec3, sigma: f64, most: f64) -> Warp {
    Warp::swelling(centre, sigma, most / (sigma * (-0.5f64).exp()))
}

/// A curved plate, 20 x 14 x 1 mm, with one bump: the walls are a twenty-fifth of the diagonal apart. Curvature, place and
/// height of the bump change with `k`: it moves the outline by up to 2 to 2.7 mm and thickens the plate to 2.1 to 2.5 mm.
fn plate(k: usize) -> Shape {
    let mut plate = datasets_synthetic::ShapeKind::Slab
        .shape(0)
        .expect("a single shape");
    let bounds = plate.bounds();
    let size = bounds.size();
    let t = k as f64;
    // A bend turns x towards y; the plate is to turn out of its plane.
    let lay = |angle: f64| Warp::Affine {
        matrix: DMat3::from_rotation_x(angle),
        translation: DVec3::ZERO,
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    let bend = Warp::bend_x((0.8 - 0.07 * (k % 8) as f64) / size.x);
    plate = plate.warped(&lay(quarter)).warped(&bend).warped(&lay(-quarter));
    let place = DVec3::new((1.0 + t).cos(), (1.0 + 2.0 * t).sin(), 0.0);
    let end = bounds.centre() + 0.35 * size * place;
    plate.warped(&swelling(
        end,
        0.15 * size.x,
        (0.1 + 0.005 * (k % 8) as f64) * size.x,
    ))
}

/// The motion (or similarity) that brings `from` onto `to` in the least squares sense.
fn least_squares(from: &[DVec3], to: &[DVec3], scale: bool) -> Rigid {
    let points = |p: &[DVec3]| -> Vec<_> { p.iter().map(|p| nalgebra::Point3::new(p.x, p.y, p.z)).collect() };
    let fit = if scale {
        matchers::pose::fit_similarity
    } else {
        matchers::pose::fit_rigid
    };
    let fit = fit(&points(from), &points(to), &vec![1.0; from.len()]).expect("points");
    let m = fit.T_target_source.rotation.to_rotation_matrix().into_inner() * fit.scale;
    let t = fit.T_target_source.translation.vector;
    Rigid {
        linear: DMat3::from_cols_slice(m.as_slice()),
        translation: DVec3::new(t.x, t.y, t.z),
    }
}
