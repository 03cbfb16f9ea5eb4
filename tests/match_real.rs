//! The main job on real bones whose motion is known: two frames of one wrist, re-sampled bones in random poses, left and right.
//! `MEDIAL_SLOW=1` runs every bone; otherwise a sample.

mod support;

use datasets_synthetic::{rigid, sample_uniform};
use glam::{DMat3, DVec3};
use matchers::pose::fit_rigid;
use medial_scaffold::geometry::{Rigid, TriangleMesh};
use medial_scaffold::input::{
    Geometry, PointCloud, ReadSettings, RepairSettings, Shape, Units, read_shape, repair,
};
use medial_scaffold::pipeline::{MatchRun, MatchSettings, match_shapes};
use medial_scaffold::registration::Mirror;
use nalgebra::Point3;
use std::path::{Path, PathBuf};
use support::{real_data, slow};

const CARPALS: [&str; 5] = ["capitate", "hamate", "scaphoid", "trapezium", "trapezoid"];
const TARSALS: [&str; 8] = [
    "Calcaneous",
    "Cuboid",
    "IntermediateCuneiform",
    "LateralCuneiform",
    "MedialCuneiform",
    "Navicular",
    "Patella",
    "Talus",
];

fn read(path: &Path, units: Units) -> Shape {
    let settings = ReadSettings {
        units: Some(units),
        ..ReadSettings::default()
    };
    read_shape(path, &settings).unwrap_or_else(|e| panic!("{e}"))
}

fn mesh(shape: &Shape) -> &TriangleMesh {
    match &shape.geometry {
        Geometry::Mesh(mesh) => mesh,
        other => panic!("{} is not a mesh: {other:?}", shape.name),
    }
}

fn matched(target: &Shape, source: &Shape, mirror: Mirror) -> MatchRun {
    let mut settings = MatchSettings::default();
    settings.registration.mirror = mirror;
    match_shapes(target, source, &settings, &|_| {}).unwrap_or_else(|e| panic!("{e}"))
}

/// `n` random points of a surface in a random pose, and the motion back.
fn resampled_and_moved(mesh: &TriangleMesh, n: usize, seed: u64) -> (Shape, Rigid) {
    let made = datasets_synthetic::TriangleMesh {
        points: mesh.points.clone(),
        triangles: mesh.triangles.clone(),
    };
    let motion = rigid::random(seed);
    let points = sample_uniform(&made, n, seed)
        .points
        .iter()
        .map(|&p| motion.apply(p))
        .collect();
    let cloud = Geometry::Cloud(PointCloud {
        points,
        normals: Vec::new(),
    });
    let back = Rigid {
        linear: motion.rotation,
        translation: motion.translation,
    }
    .inverse();
    (Shape::generated("re-sampled", cloud), back)
}

/// The motion of vertices onto vertices of the same order, by three points far apart: exact up to the files' rounding.
fn motion_of_vertices(target: &TriangleMesh, source: &TriangleMesh) -> Rigid {
    let farthest = |mesh: &TriangleMesh, from: &dyn Fn(DVec3) -> f64| {
        (0..mesh.points.len())
            .max_by(|&a, &b| from(mesh.points[a]).total_cmp(&from(mesh.points[b])))
            .expect("points")
    };
    let p = &source.points;
    let a = farthest(source, &|x| (x - p[0]).length());
    let b = farthest(source, &|x| (x - p[a]).length());
    let c = farthest(source, &|x| (x - p[a]).cross(p[b] - p[a]).length());
    let frame = |mesh: &TriangleMesh| {
        let x = (mesh.points[b] - mesh.points[a]).normalize();
        let z = x.cross(mesh.points[c] - mesh.points[a]).normalize();
        DMat3::from_cols(x, z.cross(x), z)
    };
    let linear = frame(target) * frame(source).transpose();
    Rigid {
        linear,
        translation: target.points[a] - linear * source.points[a],
    }
}

fn wrist(bone: &str) -> Option<[PathBuf; 2]> {
    let folder = real_data()?.join("carpal_myosim_apache2");
    Some([
        folder.join(format!("frameA/arm_r_{bone}.stl")),
        folder.join(format!("frameB/{bone}.stl")),
    ])
}

#[test]
fn two_frames_of_one_wrist_are_90_degrees_apart() {
    for bone in CARPALS {
        let Some([a, b]) = wrist(bone) else { return };
        let done = matched(&read(&a, Units::M), &read(&b, Units::M), Mirror::No);
        let angle = done
            .registration
            .T_target_source
            .rotation_angle_deg(&Rigid::IDENTITY);
        assert!((angle - 90.0).abs() < 0.01, "{bone}: {angle} degrees");
        assert!(
            done.registration.rms < 0.01,
            "{bone}: residual {} mm",
            done.registration.rms
        );
        assert!(
            !done.registration.mirrored && !done.registration.ambiguous,
            "{bone}"
        );
    }
}

#[test]
fn a_wrist_bone_re_sampled_in_a_random_pose_comes_back() {
    for (i, bone) in CARPALS.iter().enumerate() {
        let Some([a, b]) = wrist(bone) else { return };
        let (target, other) = (read(&a, Units::M), read(&b, Units::M));
        let known = motion_of_vertices(mesh(&target), mesh(&other));
        let (source, back) = resampled_and_moved(mesh(&other), 5000, 7 + i as u64);
        let done = matched(&target, &source, Mirror::No);
        let off = done
            .registration
            .T_target_source
            .rotation_angle_deg(&known.after(&back));
        println!(
            "{bone}: {off:.3} degrees off, rms {:.4} mm",
            done.registration.rms
        );
        assert!(off < 0.5, "{bone}: {off} degrees off");
    }
}

#[test]
fn tarsals_re_sampled_in_random_poses_come_back() {
    let Some(data) = real_data() else { return };
    let bones = if slow() { &TARSALS[..] } else { &TARSALS[4..6] };
    for (i, bone) in bones.iter().enumerate() {
        let path = data.join(format!(
            "tarsal_visiblehuman_ccby4/VHF_Right/VHF_Right_Bone_{bone}_smooth.stl"
        ));
        let target = read(&path, Units::Mm);
        let (source, truth) = resampled_and_moved(mesh(&target), 5000, 100 + i as u64);
        let done = matched(&target, &source, Mirror::No);
        let off = done.registration.T_target_source.rotation_angle_deg(&truth);
        println!(
            "{bone}: {off:.3} degrees off, rms {:.4} mm",
            done.registration.rms
        );
        assert!(off < 0.5, "{bone}: {off} degrees off");
    }
}

#[test]
fn left_and_right_are_found_to_be_mirror_images() {
    let Some(data) = real_data() else { return };
    let bones = if slow() { &TARSALS[..] } else { &TARSALS[4..6] };
    for bone in bones {
        let side = |side: &str| {
            read(
                &data.join(format!(
                    "tarsal_visiblehuman_ccby4/VHF_{side}/VHF_{side}_Bone_{bone}_smooth.stl"
                )),
                Units::Mm,
            )
        };
        let done = matched(&side("Right"), &side("Left"), Mirror::Auto);
        println!(
            "{bone}: mirrored {}, rms {:.4} mm",
            done.registration.mirrored, done.registration.rms
        );
        assert!(done.registration.mirrored, "{bone}");
    }
}

/// The markers of a Slicer markups file, LPS mm.
fn landmarks(path: &Path) -> Vec<DVec3> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let file: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    file["markups"][0]["controlPoints"]
        .as_array()
        .expect("markers")
        .iter()
        .map(|p| DVec3::from_array([0, 1, 2].map(|k| p["position"][k].as_f64().expect("a number"))))
        .collect()
}

/// Two individuals, 51 landmarks set by hand on each: no pose can lay them closer than their own best rigid fit.
#[test]
fn two_skulls_are_laid_together_as_their_landmarks_are() {
    if !slow() {
        return;
    }
    let Some(data) = real_data() else { return };
    let folder = data.join("mouse_skull_localonly");
    let skull = |name: &str| {
        let mut shape = read(&folder.join(format!("{name}.ply")), Units::Mm);
        let repaired = repair(mesh(&shape), &RepairSettings::default());
        shape.geometry = Geometry::Mesh(repaired.mesh);
        (shape, landmarks(&folder.join(format!("{name}.mrk.json"))))
    };
    let ((target, target_marks), (source, source_marks)) = (skull("A_J"), skull("BALB_CJ"));
    let done = matched(&target, &source, Mirror::No);
    assert!(!done.registration.ambiguous);
    let rms = |motion: &dyn Fn(DVec3) -> DVec3| {
        let squares = target_marks
            .iter()
            .zip(&source_marks)
            .map(|(t, &s)| (motion(s) - *t).length_squared());
        (squares.sum::<f64>() / target_marks.len() as f64).sqrt()
    };
    let points =
        |marks: &[DVec3]| -> Vec<Point3<f64>> { marks.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect() };
    let weights = vec![1.0; target_marks.len()];
    let best = fit_rigid(&points(&source_marks), &points(&target_marks), &weights).expect("landmarks");
    let [given, ours, least] = [
        rms(&|p| p),
        rms(&|p| done.registration.T_target_source.apply(p)),
        rms(&|p| DVec3::from_slice(best.apply(&Point3::new(p.x, p.y, p.z)).coords.as_slice())),
    ];
    println!("landmarks: as given {given:.3}, matched {ours:.3}, their own best fit {least:.3} mm");
    assert!(ours < 1.2 * least && ours < given);
}
