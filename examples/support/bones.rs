//! Stability on real bones, one line of the table for each way of making a second scaffold of the same bone.

use super::filters::{Filter, filtered};
use super::run::{Run, data, read_mesh, run, run_cloud, sample};
use super::stability::{
    Agreement, HEADING, NEAR, counts, gap_of, mean_distance, medial_distance, rms_distance,
};
use glam::DVec3;
use medial_scaffold::geometry::{Length, TriangleMesh};
use medial_scaffold::registration::{RegistrationSettings, RegistrationShape, register};
use medial_scaffold::regularise::{Cost, RegulariseSettings};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use std::error::Error;
use std::path::PathBuf;

/// How the second scaffold of a bone is made.
#[derive(Clone, Copy, Debug)]
enum Second {
    /// Other points, as many.
    Resampled,
    /// Four times as many points.
    Denser,
    /// Noise of this many spacings, removed again as the pipeline does with a cloud.
    Noisy(f64),
}

/// The real bones: 16 tarsals, 7 carpals, 2 femurs.
pub fn bones() -> Vec<PathBuf> {
    let Some(root) = data() else { return Vec::new() };
    let mut files: Vec<PathBuf> = [
        "tarsal_visiblehuman_ccby4/VHF_Left",
        "tarsal_visiblehuman_ccby4/VHF_Right",
        "carpal_myosim_apache2/frameA",
        "femur_libhip_mit",
    ]
    .iter()
    .filter_map(|folder| std::fs::read_dir(root.join(folder)).ok())
    .flat_map(|entries| entries.filter_map(|e| e.ok().map(|e| e.path())))
    .filter(|p| p.extension().is_some_and(|e| e == "stl"))
    .filter(|p| !p.to_string_lossy().contains("pisiform"))
    .collect();
    files.sort();
    files
}

/// Prints the lines whose name begins with one of the words (all without words). `n` points a bone.
pub fn table(n: usize, words: &[String]) -> Result<(), Box<dyn Error>> {
    let wanted = |name: &str| words.is_empty() || words.iter().any(|w| name.starts_with(w.as_str()));
    let length = RegulariseSettings {
        tolerance: Length::PercentDiagonal(1.0),
        ..RegulariseSettings::default()
    };
    let count = RegulariseSettings {
        cost: Cost::Count,
        ..length.clone()
    };
    let every = |k: usize| bones().into_iter().step_by(k).collect::<Vec<_>>();
    println!("{HEADING}");
    for (name, second, settings, files) in [
        ("re-sampled", Second::Resampled, &length, every(1)),
        ("4 x density", Second::Denser, &length, every(3)),
        ("noise 0.25", Second::Noisy(0.25), &length, every(1)),
        ("noise 0.5", Second::Noisy(0.5), &length, every(1)),
        ("count, re-sampled", Second::Resampled, &count, every(1)),
        ("count, 4 x density", Second::Denser, &count, every(3)),
        ("count, noise 0.25", Second::Noisy(0.25), &count, every(3)),
    ] {
        if wanted(name) {
            line(name, n, second, settings, &files)?;
        }
    }
    if wanted("all pairs") {
        all_pairs(n, &length)?;
    }
    if wanted("mirrored") {
        mirrored(n, &length)?;
    }
    if wanted("filters") {
        filters(n, &length)?;
    }
    Ok(())
}

fn line(
    name: &str,
    n: usize,
    second: Second,
    settings: &RegulariseSettings,
    files: &[PathBuf],
) -> Result<(), Box<dyn Error>> {
    let verbose = std::env::var_os("MEDIAL_VERBOSE").is_some();
    let mut agreement = Agreement::default();
    for file in files {
        let mesh = read_mesh(file)?;
        let a = run(&sample(&mesh, n, 1), &mesh, settings)?;
        let b = again(&mesh, n, second, settings, &a)?;
        agreement.add(&a, &b);
        if verbose {
            for r in [&a, &b] {
                if r.known.is_some_and(|known| known != r.solid) {
                    eprintln!("Betti numbers {:?}, the surface's {:?}", r.solid, r.known);
                }
            }
            let ([axial_a, sheets_a], [axial_b, sheets_b]) = (counts(&a.coarse), counts(&b.coarse));
            let gap = gap_of(&[&a.coarse, &b.coarse], 1.0, NEAR);
            let [at_a, at_b] = [&a, &b].map(|r| counts(&r.coarse.view(gap)));
            eprintln!(
                "{:50} sheets {sheets_a:2} {sheets_b:2} axial {axial_a:2} {axial_b:2}, at {:.2} tolerances {} {} and {} {}, fidelity {:.2} {:.2}",
                file.file_name().unwrap_or_default().to_string_lossy(),
                gap / a.coarse.tolerance_mm,
                at_a[1],
                at_b[1],
                at_a[0],
                at_b[0],
                a.regularised.fidelity.max_tolerances,
                b.regularised.fidelity.max_tolerances,
            );
        }
    }
    agreement.print(name);
    Ok(())
}

/// All pairs of six samplings of each bone: what single pairs scatter about.
fn all_pairs(n: usize, settings: &RegulariseSettings) -> Result<(), Box<dyn Error>> {
    let of_bone = |file: &PathBuf| -> Result<Agreement, String> {
        let mesh = read_mesh(file).map_err(|e| e.to_string())?;
        let runs = (1..=6)
            .map(|seed| run(&sample(&mesh, n, seed), &mesh, settings).map_err(|e| e.to_string()))
            .collect::<Result<Vec<Run>, _>>()?;
        let mut agreement = Agreement::default();
        for (i, a) in runs.iter().enumerate() {
            for b in &runs[i + 1..] {
                agreement.add(a, b);
            }
        }
        Ok(agreement)
    };
    let bones = bones();
    let each: Vec<Result<Agreement, String>> = bones.par_iter().with_max_len(1).map(of_bone).collect();
    let mut all = Agreement::default();
    for agreement in each {
        all.merge(agreement?);
    }
    all.print("all pairs of six samplings");
    Ok(())
}

fn again(
    mesh: &TriangleMesh,
    n: usize,
    second: Second,
    settings: &RegulariseSettings,
    first: &Run,
) -> Result<Run, Box<dyn Error>> {
    match second {
        Second::Resampled => run(&sample(mesh, n, 2), mesh, settings),
        Second::Denser => run(&sample(mesh, 4 * n, 3), mesh, settings),
        Second::Noisy(spacings) => {
            let noise = Normal::new(0.0, spacings * first.fine.scale.spacing_mm)?;
            let mut random = ChaCha8Rng::seed_from_u64(4);
            let points: Vec<DVec3> = sample(mesh, n, 2)
                .into_iter()
                .map(|p| p + DVec3::from_array([(); 3].map(|()| noise.sample(&mut random))))
                .collect();
            run_cloud(&points, first.known, settings)
        }
    }
}

/// Left bones against the mirror images of the right ones: how far the medial points and the surfaces are apart. Every distance is
/// the mean of both ways, over all points by area; the medial points of all that the scaffolds hold, and of what is left at the gap of both.
fn mirrored(n: usize, settings: &RegulariseSettings) -> Result<(), Box<dyn Error>> {
    println!(
        "\n| left against mirrored right | axial | sheets | surfaces %D, mean, rms | medial points %D | over the surfaces' rms | over their mean | the same at the gap of both |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut ratios: Vec<[f64; 4]> = Vec::new();
    for right in bones() {
        let name = right.to_string_lossy().into_owned();
        let left = PathBuf::from(name.replace("Right", "Left").replace("rfemur", "lfemur"));
        if left == right || !left.is_file() {
            continue;
        }
        let (target, mut source) = (read_mesh(&left)?, read_mesh(&right)?);
        source.points.iter_mut().for_each(|p| p.x = -p.x);
        source.flip();
        let pose = register(
            &RegistrationShape::mesh(&target),
            &RegistrationShape::mesh(&source),
            &RegistrationSettings::default(),
        )?
        .T_target_source;
        source.points.iter_mut().for_each(|p| *p = pose.apply(*p));
        let a = run(&sample(&target, n, 1), &target, settings)?;
        let b = run(&sample(&source, n, 2), &source, settings)?;
        let share = 50.0 / a.coarse.diagonal_mm;
        let mean = share * (mean_distance(&target, &source) + mean_distance(&source, &target));
        let rms = share * (rms_distance(&target, &source) + rms_distance(&source, &target));
        let medial = |a, b| share * (medial_distance(a, b) + medial_distance(b, a));
        let all = medial(&a.coarse, &b.coarse);
        let gap = gap_of(&[&a.coarse, &b.coarse], 1.0, NEAR);
        let seen = medial(&a.coarse.view(gap), &b.coarse.view(gap));
        let own = [all / rms, all / mean, seen / rms, seen / mean];
        let ([axial_a, sheets_a], [axial_b, sheets_b]) = (counts(&a.coarse), counts(&b.coarse));
        println!(
            "| {} | {axial_a}, {axial_b} | {sheets_a}, {sheets_b} | {mean:.2}, {rms:.2} | {all:.2} | {:.2} | {:.2} | {:.2}, {:.2} |",
            left.file_stem().unwrap_or_default().to_string_lossy(),
            own[0],
            own[1],
            own[2],
            own[3]
        );
        ratios.push(own);
    }
    let of = |k: usize| ratios.iter().map(|r| r[k]).sum::<f64>() / ratios.len().max(1) as f64;
    println!(
        "| mean of {} | | | | | {:.2} | {:.2} | {:.2}, {:.2} |",
        ratios.len(),
        of(0),
        of(1),
        of(2),
        of(3)
    );
    Ok(())
}

/// Filters that decide facet by facet, re-sampled and at four times the density.
fn filters(n: usize, settings: &RegulariseSettings) -> Result<(), Box<dyn Error>> {
    println!(
        "\n| filter | bones | sheets, axial curves a bone | change re-sampled: sheets, axial | change at 4 x density: sheets, axial | medial distance %D | Betti = surface's |"
    );
    println!("|---|---|---|---|---|---|---|");
    let kinds = [
        ("angle 60 degrees", Filter::Angle(60.0)),
        ("angle 90 degrees", Filter::Angle(90.0)),
        ("lambda 4 %D", Filter::Lambda(4.0)),
        ("lambda 12 %D", Filter::Lambda(12.0)),
    ];
    let files: Vec<PathBuf> = bones().into_iter().step_by(3).collect();
    let mut sums = [[0.0; 8]; 4];
    for file in &files {
        let mesh = read_mesh(file)?;
        let first = run(&sample(&mesh, n, 1), &mesh, settings)?;
        let others = [
            run(&sample(&mesh, n, 2), &mesh, settings)?,
            run(&sample(&mesh, 4 * n, 3), &mesh, settings)?,
        ];
        for ((_, filter), sum) in kinds.iter().zip(&mut sums) {
            let a = filtered(&first.fine, *filter);
            sum[0] += a.counts[1] as f64;
            sum[1] += a.counts[0] as f64;
            let of_known =
                |f: &super::filters::Filtered| f64::from(u8::from(first.known.is_none_or(|k| k == f.betti)));
            sum[7] += of_known(&a);
            for (k, other) in others.iter().enumerate() {
                let b = filtered(&other.fine, *filter);
                let change = |i: usize| a.counts[i].abs_diff(b.counts[i]) as f64 / a.counts[i].max(1) as f64;
                sum[2 + 2 * k] += change(1);
                sum[3 + 2 * k] += change(0);
                if k == 0 {
                    sum[6] += 50.0
                        * (mean_distance(&a.surface, &b.surface) + mean_distance(&b.surface, &a.surface))
                        / first.coarse.diagonal_mm;
                    sum[7] += of_known(&b);
                }
            }
        }
    }
    let m = files.len().max(1) as f64;
    for ((name, _), s) in kinds.iter().zip(sums) {
        println!(
            "| {name} | {} | {:.0}, {:.0} | {:.0} %, {:.0} % | {:.0} %, {:.0} % | {:.2} | {:.0}/{} |",
            files.len(),
            s[0] / m,
            s[1] / m,
            100.0 * s[2] / m,
            100.0 * s[3] / m,
            100.0 * s[4] / m,
            100.0 * s[5] / m,
            s[6] / m,
            s[7],
            2 * files.len()
        );
    }
    Ok(())
}
