//! Several segmentations of one lesion against each other and against a truth.

use crate::common::{Grid, ball_volume, only};
use glam::DVec3;
use medial_scaffold::change::{ChangeSettings, compare};
use medial_scaffold::input::Shape;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

#[test]
fn repeated_segmentations_give_the_error_of_the_interval() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let radii = [9.5, 10.0, 10.5];
    let mut drawn: Vec<Shape> = radii
        .iter()
        .map(|r| Grid::about(12.0, DVec3::ONE, &mut rng).mask(|p| p.length() <= *r))
        .collect();
    for (i, s) in drawn.iter_mut().enumerate() {
        s.name = format!("reader {i}");
    }
    let settings = ChangeSettings::default();
    let all = compare(&drawn, None, &settings).expect("solids");
    assert_eq!(
        (all.lesions.len(), all.pairs.len(), all.repeatability.len()),
        (3, 3, 1)
    );
    let volumes: Vec<f64> = radii.iter().map(|r| ball_volume(*r)).collect();
    let mean = volumes.iter().sum::<f64>() / 3.0;
    let truth = (volumes.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 2.0).sqrt() / mean;
    let cv = all.repeatability[0].cv.expect("three");
    assert!((cv - truth).abs() < 0.01, "{cv} {truth}");
    let against = compare(&drawn[1..], Some(&drawn[0]), &settings).expect("solids");
    assert_eq!(
        against.pairs.iter().map(|p| p.first.as_str()).collect::<Vec<_>>(),
        ["reader 0", "reader 0"]
    );
    assert!(against.pairs[1].agreement.dice < against.pairs[0].agreement.dice);
    assert_eq!(against.repeatability[0].segmentations, 2);

    let settings = ChangeSettings {
        repeat_cv: Some(cv),
        ..settings
    };
    let (m, sd) = only(&drawn[1], &settings);
    assert!(
        (sd / m.volume_best / cv - 1.0).abs() < 0.01,
        "digitisation adds little"
    );
}
