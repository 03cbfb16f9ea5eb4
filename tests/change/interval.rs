//! The interval of a change of volume: covers the truth as often as it says, and stays silent where nothing changed.

use crate::common::{Grid, ball_volume, only, read, slow};
use glam::DVec3;
use medial_scaffold::change::ChangeSettings;
use medial_scaffold::change::error_model::{Uncertain, volume_change};
use medial_scaffold::input::Shape;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::f64::consts::PI;

#[test]
fn the_interval_covers_the_truth_in_95_of_100_cases() {
    // Ellipsoids on random grids, each date's boundary displaced by a normal amount, as the error model says. Lengths mm.
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let settings = ChangeSettings::default();
    let cases = if slow() { 2000 } else { 400 };
    let mut covered = 0;
    let mut false_alarms = (0, 0);
    for case in 0..cases {
        let spacing = if case % 2 == 0 {
            DVec3::ONE
        } else {
            DVec3::new(0.9, 0.9, 2.5)
        };
        let sd = (spacing.x * spacing.y * spacing.z).cbrt() / 12f64.sqrt();
        let normal = Normal::new(0.0, sd).expect("a positive spread");
        let axes = DVec3::new(
            rng.random_range(6.0..9.0),
            rng.random_range(8.0..12.0),
            rng.random_range(9.0..14.0),
        );
        let growth = if case % 4 == 3 {
            0.0
        } else {
            rng.random_range(-1.5..2.5)
        };
        let volume = |a: DVec3| 4.0 / 3.0 * PI * a.x * a.y * a.z;
        let truth = 100.0 * (volume(axes + growth) / volume(axes) - 1.0);
        let seen = |axes: DVec3, rng: &mut ChaCha8Rng| {
            let drawn = axes + normal.sample(rng);
            let s = Grid::about(drawn.max_element(), spacing, rng).mask(|p| (p / drawn).length() <= 1.0);
            let (m, sd) = only(&s, &settings);
            Uncertain {
                volume: m.volume_best,
                sd,
            }
        };
        let (b, f) = (seen(axes, &mut rng), seen(axes + growth, &mut rng));
        let c = volume_change(b, f);
        covered += usize::from(c.ci95_percent[0] <= truth && truth <= c.ci95_percent[1]);
        if growth == 0.0 {
            false_alarms.0 += usize::from(c.significant);
            false_alarms.1 += 1;
        }
    }
    let share = 100.0 * covered as f64 / f64::from(cases);
    println!(
        "covered {share:.1} % of {cases}; called significant without change: {} of {}",
        false_alarms.0, false_alarms.1
    );
    assert!((93.0..=97.0).contains(&share), "{share} %");
}

#[test]
fn digitisation_alone_has_the_spread_that_the_model_says() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let settings = ChangeSettings {
        boundary_sd_mm: Some(0.0),
        ..Default::default()
    };
    for spacing in [DVec3::ONE, DVec3::new(1.0, 1.0, 3.0)] {
        let n = 300;
        let (mut sum, mut squares, mut model) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            // Radii vary so that no lattice resonance of one radius rules.
            let r: f64 = rng.random_range(7.0..9.0);
            let s = Grid::about(r, spacing, &mut rng).mask(|p| p.length() <= r);
            let (m, sd) = only(&s, &settings);
            let error = m.volume_best - ball_volume(r);
            sum += error;
            squares += error * error;
            model += sd * sd;
        }
        let ratio = (squares / model).sqrt();
        let bias = sum / f64::from(n);
        println!("{spacing}: observed / modelled spread {ratio:.2}, bias {bias:.2} mm3");
        assert!((0.8..1.25).contains(&ratio), "{ratio}");
        assert!(bias.abs() < 3.0 * (squares / f64::from(n * n)).sqrt(), "{bias}");
    }
}

#[test]
fn one_contour_on_three_grids_has_not_changed() {
    println!("| case | CT mm3 | MR % | interval | PET % | interval |\n|---|---|---|---|---|---|");
    let cases: Vec<usize> = if slow() { (1..=12).collect() } else { vec![1, 4, 9] };
    for case in cases {
        let folder = format!("tumour_sts_ibsi_ccby3/STS_{case:03}");
        let (Some(ct), Some(mr), Some(pet)) = (
            read(&format!("{folder}/CT_mask.nii.gz")),
            read(&format!("{folder}/MR_T1_mask.nii.gz")),
            read(&format!("{folder}/PET_mask.nii.gz")),
        ) else {
            return;
        };
        let settings = ChangeSettings::default();
        let of = |s: &Shape| {
            let (m, sd) = only(s, &settings);
            Uncertain {
                volume: m.volume_best,
                sd,
            }
        };
        let (ct, mr, pet) = (of(&ct), of(&mr), of(&pet));
        let (to_mr, to_pet) = (volume_change(ct, mr), volume_change(ct, pet));
        println!(
            "| {case} | {:.0} | {:+.2} | {:+.1} to {:+.1} | {:+.2} | {:+.1} to {:+.1} |",
            ct.volume,
            to_mr.percent,
            to_mr.ci95_percent[0],
            to_mr.ci95_percent[1],
            to_pet.percent,
            to_pet.ci95_percent[0],
            to_pet.ci95_percent[1]
        );
        assert!(
            to_mr.percent.abs() < 1.0 && !to_mr.significant,
            "case {case}: {to_mr:?}"
        );
        assert!(!to_pet.significant, "case {case}: {to_pet:?}");
    }
}
