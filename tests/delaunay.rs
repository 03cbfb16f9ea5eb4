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
