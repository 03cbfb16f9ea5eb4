//! Two dates: growth maps, agreement, pairing, and what is refused.

use crate::common::{Grid, ball_volume, run, shape};
use glam::DVec3;
use medial_scaffold::change::{Category, ChangeError, ChangeSettings, Pairing, PartKind, Status, change};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::input::shape::{Geometry, PointCloud, Shape};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

#[test]
fn growth_maps_are_right_within_half_a_voxel_and_add_up() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let spacing = DVec3::new(0.8, 0.8, 1.6);
    let grids: [Grid; 2] = std::array::from_fn(|_| Grid::about(20.0, spacing, &mut rng));
    let base = |p: DVec3| (p / DVec3::new(9.0, 11.0, 13.0)).length() <= 1.0;
    let voxel = 1.6;

    // Uniform growth of a ball.
    let c = run(
        grids[0].mask(|p| p.length() <= 10.0),
        grids[1].mask(|p| p.length() <= 12.0),
    );
    let l = &c.lesions[0];
    let mut errors: Vec<f64> = l
        .growth_map
        .displacement_mm
        .iter()
        .map(|h| (h - 2.0).abs())
        .collect();
    errors.sort_by(f64::total_cmp);
    let (off, most) = (errors[errors.len() * 95 / 100], errors[errors.len() - 1]);
    let g = l.growth.expect("a growth map");
    println!(
        "uniform: 95 % within {off:.2} mm, all within {most:.2} mm (voxel {spacing}), residual {:+.2} %",
        g.identity_residual_percent.expect("a change")
    );
    // A flat cap is known to a slice only, at both dates: no more than that is in the masks.
    assert!(off < 0.5 * voxel && most < voxel, "{off} {most}");
    // A surface spread by a fifth has coarser triangles than the one it is compared with; chords cost about a percent.
    assert!(g.identity_residual_percent.expect("a change").abs() < 2.0);
    assert_eq!(l.parts[0].name, "grew all round");
    assert!((l.change.percent - 72.8).abs() < 1.5, "{}", l.change.percent);
    assert!(l.change.significant);

    // One-sided: the ball's left half drawn out into half an ellipsoid.
    let drawn = |p: DVec3| (p / DVec3::new(if p.x > 0.0 { 13.0 } else { 10.0 }, 10.0, 10.0)).length() <= 1.0;
    let c = run(grids[0].mask(|p| p.length() <= 10.0), grids[1].mask(drawn));
    let l = &c.lesions[0];
    println!(
        "one-sided: {:?}",
        l.parts
            .iter()
            .map(|p| (&p.name, p.share_percent))
            .collect::<Vec<_>>()
    );
    assert_eq!(l.parts[0].name, "grew left");
    assert!((l.change.percent - 15.0).abs() < 1.0, "{}", l.change.percent);
    for (p, h) in l.growth_map.mesh.points.iter().zip(&l.growth_map.displacement_mm) {
        if p.x < -1.0 {
            assert!(h.abs() < 0.5 * voxel, "{p}: {h}");
        }
    }

    // A new lobe: named by where it sits.
    let lobe = DVec3::new(0.0, -11.0, 0.0);
    let c = run(
        grids[0].mask(base),
        grids[1].mask(|p| base(p) || p.distance(lobe) <= 5.0),
    );
    let l = &c.lesions[0];
    println!(
        "lobe: {:?}",
        l.parts
            .iter()
            .map(|p| (&p.name, p.share_percent))
            .collect::<Vec<_>>()
    );
    assert_eq!(l.parts[0].name, "grew anterior");
    assert_eq!(l.parts.iter().filter(|p| p.kind == PartKind::Patch).count(), 1);

    // Shrinking.
    let c = run(
        grids[0].mask(|p| p.length() <= 12.0),
        grids[1].mask(|p| p.length() <= 10.0),
    );
    let l = &c.lesions[0];
    assert_eq!(l.parts[0].name, "shrank all round");
    assert!(l.growth.expect("a growth map").max_outward == 0.0);
    assert_eq!(l.response.recist.category, Category::SD);
    assert!(l.agreement.dice.expect("masks") > 0.7);
}

#[test]
fn a_mask_against_itself_has_not_changed() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let s = Grid::about(9.0, DVec3::new(0.7, 0.7, 1.5), &mut rng).mask(|p| p.length() < 8.0);
    let c = change(&s, &s, &ChangeSettings::default()).expect("a solid");
    let l = &c.lesions[0];
    assert_eq!((l.change.percent, l.change.significant), (0.0, false));
    assert_eq!(l.agreement.dice, Some(1.0));
    for a in [
        l.agreement.mesh.expect("surfaces"),
        l.agreement.voxel.expect("voxels"),
    ] {
        assert!(
            a.hausdorff < 1e-9 && a.assd < 1e-9 && a.surface_dice == 1.0,
            "{a:?}"
        );
    }
    assert!(l.parts.is_empty());
    // The file has the fields that it promises.
    let json = serde_json::to_value(&c).expect("JSON");
    for path in [
        "/lesions/0/label",
        "/lesions/0/baseline/volume_mesh",
        "/lesions/0/baseline/volume_voxel",
        "/lesions/0/baseline/area",
        "/lesions/0/baseline/sphericity",
        "/lesions/0/baseline/diameter_3d",
        "/lesions/0/baseline/diameter_axial",
        "/lesions/0/baseline/diameter_perpendicular",
        "/lesions/0/followup/volume_mesh",
        "/lesions/0/change/volume_mm3",
        "/lesions/0/change/percent",
        "/lesions/0/change/ci95_percent/1",
        "/lesions/0/change/significant",
        "/lesions/0/response/recist/category",
        "/lesions/0/response/rano/category",
        "/lesions/0/response/volumetric/category",
        "/lesions/0/growth/max_outward",
        "/lesions/0/growth/max_inward",
        "/new",
        "/vanished",
        "/totals/percent",
    ] {
        assert!(json.pointer(path).is_some(), "{path}");
    }
}

#[test]
fn shifted_slabs_have_the_distances_worked_by_hand() {
    // Two cubes of 10 voxels, one shifted by 2: borders 2 apart on two faces.
    let grid = Grid {
        dims: [20; 3],
        spacing: DVec3::ONE,
        origin: DVec3::ZERO,
    };
    let cube = |x0: f64| {
        grid.mask(|p| p.x >= x0 && p.x < x0 + 10.0 && p.y >= 4.0 && p.y < 14.0 && p.z >= 4.0 && p.z < 14.0)
    };
    let c = run(cube(3.0), cube(5.0));
    let a = c.lesions[0].agreement;
    assert!((a.dice.expect("masks") - 0.8).abs() < 1e-12);
    assert_eq!(a.voxel.expect("voxels").hausdorff, 2.0);
    assert!((a.mesh.expect("surfaces").hausdorff - 2.0).abs() < 0.2);
    assert!(a.voxel.expect("voxels").surface_dice > 0.6);
}

#[test]
fn lesions_are_paired_by_overlap_whatever_their_grids() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let centre = |x: f64| DVec3::new(x, 0.0, 0.0);
    let near = |p: DVec3, x: f64, r: f64| p.distance(centre(x)) <= r;
    // Baseline: A (-30), B (-10), C1 and C2 (8 and 16), V (30). Follow-up: A; B split into two; C merged; N (40) new.
    let a = Grid::about(50.0, DVec3::ONE, &mut rng).mask(|p| {
        near(p, -30.0, 4.0)
            || near(p, -10.0, 6.0)
            || near(p, 8.0, 3.0)
            || near(p, 16.0, 3.0)
            || near(p, 30.0, 3.0)
    });
    let b = Grid::about(50.0, DVec3::new(0.8, 0.8, 1.3), &mut rng).mask(|p| {
        near(p, -30.0, 5.0)
            || near(p, -14.0, 2.5)
            || near(p, -6.0, 2.5)
            || near(p, 12.0, 8.0)
            || near(p, 42.0, 3.0)
    });
    let settings = ChangeSettings {
        pairing: Pairing::Overlap,
        ..Default::default()
    };
    let c = change(&a, &b, &settings).expect("solids");
    let mut lesions: Vec<_> = c.lesions.iter().collect();
    lesions.sort_by(|a, b| a.baseline.centroid.x.total_cmp(&b.baseline.centroid.x));
    let status: Vec<Status> = lesions.iter().map(|l| l.status).collect();
    assert_eq!(status, [Status::Paired, Status::Split, Status::Merged]);
    assert_eq!(
        (c.new.len(), c.vanished.len(), c.split.len(), c.merged.len()),
        (1, 1, 1, 1)
    );
    assert_eq!(c.split[0].followup.len(), 2);
    assert_eq!(c.merged[0].baseline.len(), 2);
    let split = lesions[1];
    assert!((split.followup.volume_best / (2.0 * ball_volume(2.5)) - 1.0).abs() < 0.1);
    let total: f64 =
        c.lesions.iter().map(|l| l.followup.volume_best).sum::<f64>() + c.new[0].measures.volume_best;
    assert!((c.totals.followup_mm3 - total).abs() < 1e-9);

    // By label: the same label is the same lesion, wherever it lies.
    let a = Grid::about(30.0, DVec3::ONE, &mut rng).labels(|p| {
        if near(p, -10.0, 4.0) {
            1
        } else {
            2 * i32::from(near(p, 10.0, 4.0))
        }
    });
    let b = Grid::about(30.0, DVec3::ONE, &mut rng).labels(|p| {
        if near(p, 10.0, 5.0) {
            2
        } else {
            7 * i32::from(near(p, -20.0, 4.0))
        }
    });
    let c = run(a, b);
    assert_eq!(c.lesions.iter().map(|l| l.label).collect::<Vec<_>>(), [2]);
    assert_eq!((c.vanished[0].label, c.new[0].label), (1, 7));
}

#[test]
fn what_is_no_solid_gives_an_error_and_not_a_number() {
    let settings = ChangeSettings::default();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let grid = Grid::about(8.0, DVec3::ONE, &mut rng);
    let ball = grid.mask(|p| p.length() < 6.0);
    let error =
        |other: &Shape, settings: &ChangeSettings| change(&ball, other, settings).expect_err("no solid");

    let tetrahedron = TriangleMesh {
        points: vec![DVec3::ZERO, 6.0 * DVec3::X, 6.0 * DVec3::Y, 6.0 * DVec3::Z],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3]],
    };
    let open = shape("open.ply", Geometry::Mesh(tetrahedron.clone()));
    let e = error(&open, &settings);
    assert!(
        matches!(
            e,
            ChangeError::OpenMesh {
                boundary_edges: 3,
                ..
            }
        ),
        "{e}"
    );
    assert!(
        e.to_string().contains("open.ply") && e.to_string().contains("3 open edges"),
        "{e}"
    );

    let mut turned = tetrahedron;
    turned.triangles.push([0, 2, 3]);
    let e = error(&shape("turned.ply", Geometry::Mesh(turned.clone())), &settings);
    assert!(e.to_string().contains("turned both ways"), "{e}");
    // Closed but inside out: turned silently, because nothing else can be meant.
    turned.triangles[3] = [0, 3, 2];
    turned.flip();
    assert!(change(&ball, &shape("inward.ply", Geometry::Mesh(turned)), &settings).is_ok());

    assert!(matches!(
        error(&grid.mask(|_| false), &settings),
        ChangeError::Empty { .. }
    ));
    let wanted = ChangeSettings {
        label: Some(3),
        ..Default::default()
    };
    assert!(error(&ball, &wanted).to_string().contains("no label 3"));
    let cloud = shape(
        "cloud.xyz",
        Geometry::Cloud(PointCloud {
            points: vec![DVec3::ZERO],
            normals: vec![],
        }),
    );
    assert!(matches!(error(&cloud, &settings), ChangeError::NotSolid { .. }));

    let mut away = ball.clone();
    if let Geometry::Labels(map) = &mut away.geometry {
        map.origin += DVec3::new(0.0, 0.0, 400.0);
    }
    let e = error(&away, &settings);
    assert!(
        matches!(e, ChangeError::Apart { .. }) && e.to_string().contains("--align"),
        "{e}"
    );
}
