//! From points on a known surface to a coarse scaffold, stage by stage, with times.

use glam::DVec3;
use medial_scaffold::coarse_scaffold::{CoarseScaffold, CoarseScaffoldSettings, CurveKind, coarse_scaffold};
use medial_scaffold::delaunay::Triangulation;
use medial_scaffold::fine_scaffold::{
    Betti, FineScaffold, FineScaffoldSettings, Side, fine_scaffold, mesh_betti, solid_betti,
};
use medial_scaffold::geometry::TriangleMesh;
use medial_scaffold::input::{Geometry, ReadSettings, read_shape};
use medial_scaffold::regularise::{RegulariseSettings, Regularised, regularise};
use medial_scaffold::segregation::{
    KnownSurfaceSettings, Segregation, SegregationSettings, segregate_cloud, segregate_known_refined,
};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A shape on its way.
pub struct Run {
    pub fine: FineScaffold,
    pub regularised: Regularised,
    pub coarse: CoarseScaffold,
    /// Betti numbers of the union of inside tetrahedra, by its boundary.
    pub solid: Betti,
    /// Betti numbers by the known surface, when it has any.
    pub known: Option<Betti>,
    pub seconds_segregate: f64,
    pub seconds_fine: f64,
    pub seconds_regularise: f64,
    pub seconds_coarse: f64,
}

impl Run {
    pub fn count(&self, kind: CurveKind) -> usize {
        self.coarse.curves.iter().filter(|c| c.kind == kind).count()
    }
}

/// Runs all stages.
pub fn run(
    points: &[DVec3],
    surface: &TriangleMesh,
    settings: &RegulariseSettings,
) -> Result<Run, Box<dyn Error>> {
    let start = Instant::now();
    let refined = segregate_known_refined(points, surface, &KnownSurfaceSettings::default())?;
    let seconds = start.elapsed().as_secs_f64();
    rest(
        &refined.triangulation,
        &refined.result.segregation,
        mesh_betti(surface),
        seconds,
        settings,
    )
}

/// Runs all stages on a raw cloud: segregated by its points alone, noise removed as the pipeline does it. `known` are the Betti
/// numbers it should have.
pub fn run_cloud(
    points: &[DVec3],
    known: Option<Betti>,
    settings: &RegulariseSettings,
) -> Result<Run, Box<dyn Error>> {
    let start = Instant::now();
    let cloud = segregate_cloud(points, &SegregationSettings::default())?;
    let seconds = start.elapsed().as_secs_f64();
    rest(&cloud.triangulation, &cloud.segregation, known, seconds, settings)
}

/// The stages after segregation, which took `seconds_segregate`.
fn rest(
    triangulation: &Triangulation,
    segregation: &Segregation,
    known: Option<Betti>,
    seconds_segregate: f64,
    settings: &RegulariseSettings,
) -> Result<Run, Box<dyn Error>> {
    let t0 = Instant::now();
    let fine = fine_scaffold(triangulation, segregation, &FineScaffoldSettings::default())?;
    let t1 = Instant::now();
    let regularised = regularise(&fine, settings)?;
    let t2 = Instant::now();
    let coarse = coarse_scaffold(&fine, &regularised, &CoarseScaffoldSettings::default());
    let t3 = Instant::now();
    Ok(Run {
        solid: solid_betti(triangulation, segregation, Side::Interior)?,
        known,
        fine,
        regularised,
        coarse,
        seconds_segregate,
        seconds_fine: (t1 - t0).as_secs_f64(),
        seconds_regularise: (t2 - t1).as_secs_f64(),
        seconds_coarse: (t3 - t2).as_secs_f64(),
    })
}

/// Folder of the real shapes, or `None` with a note on stderr.
pub fn data() -> Option<PathBuf> {
    let folder =
        std::env::var_os("MEDIAL_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    if folder.is_dir() {
        Some(folder)
    } else {
        eprintln!(
            "skipped: no real shapes at {} (set MEDIAL_DATA)",
            folder.display()
        );
        None
    }
}

/// A mesh file, oriented outward.
pub fn read_mesh(path: &Path) -> Result<TriangleMesh, Box<dyn Error>> {
    match read_shape(path, &ReadSettings::default())?.geometry {
        Geometry::Mesh(mut mesh) => {
            if mesh.signed_volume() < 0.0 {
                mesh.flip();
            }
            Ok(mesh)
        }
        _ => Err(format!("{} holds no mesh", path.display()).into()),
    }
}

/// Blue-noise points on a mesh.
pub fn sample(mesh: &TriangleMesh, n: usize, seed: u64) -> Vec<DVec3> {
    let mesh = datasets_synthetic::TriangleMesh {
        points: mesh.points.clone(),
        triangles: mesh.triangles.clone(),
    };
    datasets_synthetic::sample_poisson(&mesh, n, seed).points
}

/// A synthetic shape and its mesh.
pub fn analytic(name: &str) -> Option<datasets_synthetic::Shape> {
    use datasets_synthetic::shapes as s;
    Some(match name {
        "box" => s::box_shape(1.0, 1.4, 2.0),
        "ellipsoid" => s::ellipsoid(1.0, 0.7, 0.4),
        "torus" => s::torus(1.0, 0.3),
        "y" => s::y_of_capsules(1.0, 0.25),
        "hollow" => s::hollow_sphere(1.0, 0.6),
        "prism" => s::prism(1.0, 1.5),
        "slab" => s::slab(0.3),
        "l" => s::l_block(2.0, 0.8, 0.5),
        "dumbbell" => s::dumbbell(2.0, 0.5, 0.2),
        "capsule" => s::capsule(1.0, 0.3),
        "sphere" => s::sphere(1.0),
        "genus5" => s::genus_five(),
        "tree" => s::tree_tube(3),
        _ => return None,
    })
}

/// The mesh of a synthetic shape.
pub fn mesh_of(shape: &datasets_synthetic::Shape, triangles: usize) -> TriangleMesh {
    let mesh = shape.mesh(triangles);
    TriangleMesh {
        points: mesh.points,
        triangles: mesh.triangles,
    }
}
