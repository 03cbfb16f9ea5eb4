//! Pose: exact recovery, least-squares optimality, cliques against brute force, robustness to wrong pairs.

use matchers::pose::*;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn point(rng: &mut ChaCha8Rng, half: f64) -> Point3<f64> {
    Point3::from(Vector3::from_fn(|_, _| rng.random_range(-half..half)))
}

fn motion(rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let axis = point(rng, 3.0).coords;
    Isometry3::from_parts(
        Translation3::from(point(rng, 10.0).coords),
        UnitQuaternion::from_scaled_axis(axis),
    )
}

#[test]
fn recovers_rigid_motion_and_scale_exactly() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for trial in 0..100 {
        let truth = motion(&mut rng);
        let scale = rng.random_range(0.5..2.0);
        // Every third trial lies in a plane.
        let source: Vec<_> = (0..6)
            .map(|_| {
                let p = point(&mut rng, 10.0);
                if trial % 3 == 0 {
                    Point3::new(p.x, p.y, 0.0)
                } else {
                    p
                }
            })
            .collect();
        let weights: Vec<f64> = (0..6).map(|_| rng.random_range(0.1..3.0)).collect();
        let target: Vec<_> = source.iter().map(|p| truth * (p * scale)).collect();
        let pose = fit_similarity(&source, &target, &weights).unwrap();
        assert!((pose.scale - scale).abs() < 1e-10);
        assert!((pose.T_target_source.inverse() * truth).rotation.angle() < 1e-7);
        assert!(pose.rms < 1e-10);
        let rigid: Vec<_> = source.iter().map(|p| truth * p).collect();
        let pose = fit_rigid(&source, &rigid, &weights).unwrap();
        assert_eq!(pose.scale, 1.0);
        assert!((pose.T_target_source.translation.vector - truth.translation.vector).norm() < 1e-9);
    }
}

/// No small motion of the fit lowers the weighted squares; holds for mirrored targets too, where the plain SVD answer
/// would be a reflection.
#[test]
fn the_fit_is_a_least_squares_minimum() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for trial in 0..60 {
        let truth = motion(&mut rng);
        let source: Vec<_> = (0..8).map(|_| point(&mut rng, 10.0)).collect();
        let target: Vec<_> = source
            .iter()
            .map(|p| {
                let q = if trial % 2 == 0 {
                    Point3::new(-p.x, p.y, p.z)
                } else {
                    *p
                };
                truth * q + point(&mut rng, 1.0).coords
            })
            .collect();
        let weights: Vec<f64> = (0..8).map(|_| rng.random_range(0.0..2.0)).collect();
        let pose = fit_rigid(&source, &target, &weights).unwrap();
        let squares = |t: &Isometry3<f64>| -> f64 {
            (0..8)
                .map(|k| weights[k] * (t * source[k] - target[k]).norm_squared())
                .sum()
        };
        let least = squares(&pose.T_target_source);
        for _ in 0..30 {
            let nudge = Isometry3::new(point(&mut rng, 1e-3).coords, point(&mut rng, 1e-3).coords);
            assert!(squares(&(nudge * pose.T_target_source)) >= least - 1e-9 * least.max(1.0));
        }
    }
}

#[test]
fn points_on_a_line_are_refused() {
    let line: Vec<_> = (0..5)
        .map(|k| Point3::new(f64::from(k), 2.0 * f64::from(k), 0.0))
        .collect();
    assert!(matches!(
        fit_rigid(&line, &line, &[1.0; 5]),
        Err(PoseError::Underdetermined { .. })
    ));
    assert!(matches!(
        fit_rigid(&line[..2], &line[..2], &[1.0; 2]),
        Err(PoseError::Underdetermined { .. })
    ));
    assert!(matches!(
        fit_rigid(&line, &line[..2], &[1.0; 5]),
        Err(PoseError::Length { .. })
    ));
    assert!(matches!(
        fit_rigid(&line, &line, &[f64::NAN; 5]),
        Err(PoseError::BadPair { index: 0 })
    ));
}

fn brute_clique(g: &Graph) -> usize {
    let n = g.vertices();
    let clique =
        |set: &u32| (0..n).all(|a| (0..a).all(|b| set >> a & 1 == 0 || set >> b & 1 == 0 || g.joined(a, b)));
    (0..1u32 << n)
        .filter(clique)
        .map(|s| s.count_ones() as usize)
        .max()
        .unwrap_or(0)
}

#[test]
fn cliques_equal_brute_force() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for trial in 0..120 {
        let n = rng.random_range(0..12);
        let density = [0.2, 0.5, 0.9][trial % 3];
        let mut g = Graph::new(n);
        for a in 0..n {
            for b in 0..a {
                if rng.random::<f64>() < density {
                    g.join(a, b);
                }
            }
        }
        let best = max_clique(&g, 1_000_000);
        assert!(best.proven);
        assert_eq!(best.vertices.len(), brute_clique(&g), "trial {trial}");
        for (k, &a) in best.vertices.iter().enumerate() {
            assert!(best.vertices[..k].iter().all(|&b| g.joined(a, b)));
        }
    }
}

#[test]
fn a_planted_clique_is_found_across_word_boundaries() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let n = 200;
    let mut g = Graph::new(n);
    for a in 0..n {
        for b in 0..a {
            if rng.random::<f64>() < 0.3 {
                g.join(a, b);
            }
        }
    }
    let planted: Vec<usize> = (0..n).step_by(13).collect();
    for &a in &planted {
        planted.iter().for_each(|&b| g.join(a, b));
    }
    let best = max_clique(&g, 5_000_000);
    assert!(best.proven);
    assert_eq!(best.vertices, planted);
    let stopped = max_clique(&g, 3);
    assert!(!stopped.proven && !stopped.vertices.is_empty());
}

struct Doubtful {
    truth: Isometry3<f64>,
    source: Vec<Point3<f64>>,
    target: Vec<Point3<f64>>,
    right: Vec<usize>,
}

fn doubtful(rng: &mut ChaCha8Rng, n: usize, wrong_share: f64, noise: f64) -> Doubtful {
    let truth = motion(rng);
    let source: Vec<_> = (0..n).map(|_| point(rng, 10.0)).collect();
    let mut right = Vec::new();
    let target = source
        .iter()
        .enumerate()
        .map(|(k, p)| {
            if (k as f64) < wrong_share * n as f64 {
                truth * point(rng, 10.0)
            } else {
                right.push(k);
                truth * p + point(rng, noise).coords
            }
        })
        .collect();
    Doubtful {
        truth,
        source,
        target,
        right,
    }
}

#[test]
fn gnc_survives_60_percent_wrong_pairs() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..30 {
        let d = doubtful(&mut rng, 60, 0.6, 0.05);
        let settings = GncSettings {
            inlier_bound: 0.3,
            ..GncSettings::default()
        };
        let fit = fit_gnc(&d.source, &d.target, &[1.0; 60], &settings).unwrap();
        let error = (fit.pose.T_target_source.inverse() * d.truth)
            .rotation
            .angle()
            .to_degrees();
        assert!(error < 1.0, "{error} degrees");
        assert!(fit.converged);
        assert!(d.right.iter().all(|&k| fit.weights[k] == 1.0));
    }
}

#[test]
fn clique_and_gnc_survive_90_percent_wrong_pairs() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for _ in 0..30 {
        let d = doubtful(&mut rng, 150, 0.9, 0.05);
        let settings = RobustPoseSettings {
            inlier_bound: 0.2,
            ..RobustPoseSettings::default()
        };
        let found = robust_pose(&d.source, &d.target, &[1.0; 150], &settings).unwrap();
        let error = (found.pose.T_target_source.inverse() * d.truth)
            .rotation
            .angle()
            .to_degrees();
        assert!(error < 1.0, "{error} degrees");
        assert!(found.clique_proven);
        assert!(d.right.iter().all(|k| found.inliers.contains(k)));
    }
}

#[test]
fn an_unknown_scale_is_estimated() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for _ in 0..10 {
        let mut d = doubtful(&mut rng, 60, 0.5, 0.02);
        // Shrink the source, so that the target is 1.15 times as large.
        d.source.iter_mut().for_each(|p| *p /= 1.15);
        let scale = ScaleRange {
            least: 0.8,
            greatest: 1.25,
        };
        let settings = RobustPoseSettings {
            inlier_bound: 0.1,
            scale,
            ..RobustPoseSettings::default()
        };
        let found = robust_pose(&d.source, &d.target, &[1.0; 60], &settings).unwrap();
        assert!((found.pose.scale - 1.15).abs() < 0.01, "{}", found.pose.scale);
        assert!(d.right.iter().all(|k| found.inliers.contains(k)));
    }
}
