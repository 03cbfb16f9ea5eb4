//! Delaunay triangulation against an independent validator (`support/validate.rs`) on random and degenerate fixtures.

#[path = "support/exact.rs"]
mod exact;
#[path = "support/fixtures.rs"]
mod fixtures;
#[path = "support/validate.rs"]
mod validate;

use glam::DVec3;
use medial_scaffold::delaunay::{DelaunaySettings, Triangulation, delaunay};

fn build(points: &[DVec3]) -> Triangulation {
    delaunay(points, &DelaunaySettings::default()).expect("finite points")
}

#[test]
fn random_fixtures_are_delaunay() {
    for seed in 0..1000 {
        let points = fixtures::random(seed);
        let t = build(&points);
        validate::check(&t, &points).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    }
}

#[test]
fn degenerate_fixtures_are_delaunay() {
    let all = fixtures::degenerate();
    assert!(all.len() >= 100);
    for (name, points) in all {
        let t = build(&points);
        validate::check(&t, &points).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

#[test]
fn order_does_not_matter() {
    for (name, points) in fixtures::degenerate() {
        let t = build(&points);
        for seed in 0..3 {
            assert_eq!(build(&fixtures::shuffled(&points, seed)), t, "{name}");
        }
    }
}

#[test]
fn threads_do_not_matter() {
    for (name, points) in fixtures::larger() {
        let one = delaunay(&points, &DelaunaySettings { threads: 1 }).expect("finite points");
        for threads in [2, 3, 8] {
            let many = delaunay(&points, &DelaunaySettings { threads }).expect("finite points");
            assert!(many == one, "{name} with {threads} threads");
        }
        validate::check(&one, &points).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

/// More threads than processors are interrupted in the middle of an insertion. What then goes wrong is a matter of chance,
/// hence so many clouds, each large enough for threads to be used and small enough for them to meet often.
#[test]
fn interrupted_threads_do_not_lose_what_they_hold() {
    for seed in 0..100 {
        let points = fixtures::random_cube(20_000, seed);
        let one = delaunay(&points, &DelaunaySettings { threads: 1 }).expect("finite points");
        let threads = 2 + seed as usize % 7;
        let many = delaunay(&points, &DelaunaySettings { threads }).expect("finite points");
        assert!(many == one, "seed {seed}, {threads} threads");
    }
}

#[test]
fn every_permutation_of_small_sets_gives_the_same() {
    let cube = fixtures::grid(2, 2, 2);
    let octahedron: Vec<DVec3> = [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .flat_map(|a| [a, -a])
        .collect();
    for points in [
        cube[..7].to_vec(),
        octahedron,
        fixtures::grid(3, 2, 1),
        fixtures::random(0)[..6].to_vec(),
    ] {
        let expected = build(&points);
        let mut order: Vec<DVec3> = points.clone();
        permutations(&mut order, points.len(), &mut |p| assert_eq!(build(p), expected));
    }
}

/// Heap's algorithm.
fn permutations(points: &mut [DVec3], k: usize, f: &mut impl FnMut(&[DVec3])) {
    if k <= 1 {
        return f(points);
    }
    for i in 0..k {
        permutations(points, k - 1, f);
        points.swap(if k.is_multiple_of(2) { i } else { 0 }, k - 1);
    }
}

#[test]
fn powers_of_two_change_nothing() {
    for (name, points) in fixtures::degenerate()
        .into_iter()
        .chain((0..40).map(|s| (format!("{s}"), fixtures::random(s))))
    {
        let t = build(&points);
        for e in [-300, 200] {
            let scaled: Vec<DVec3> = points.iter().map(|&p| p * f64::powi(2.0, e)).collect();
            let exact = points
                .iter()
                .zip(&scaled)
                .all(|(p, q)| *q * f64::powi(2.0, -e) == *p && q.is_finite());
            if exact {
                let s = build(&scaled);
                assert!(
                    s.tets().eq(t.tets()) && s.tets().all(|i| s.tet(i) == t.tet(i)),
                    "{name} times 2^{e}"
                );
            }
        }
    }
}
