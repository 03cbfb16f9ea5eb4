//! From a shape to generators: the points the wave starts from, with the known surface where the input has one.
//!
//! In: a [`Shape`]. Out: [`Generators`] in coordinate order, and remarks for the user.
//!
//! * A cloud gives its distinct points, no others ([`cloud`]).
//! * A label map gives the closed surface of its voxels ([`marching`]), smoothed within half a voxel so that the scaffold does
//!   not grow a sheet into every stair ([`smoothing`]), then sampled like a mesh.
//! * A mesh gives evenly spread samples of its surface ([`blue_noise`]), with points along its sharp edges ([`features`]) so that
//!   corners survive; or its own vertices when asked.
//!
//! Meshes are put in canonical order first (points by coordinates, triangles by points), so that the samples do not depend on
//! the order of the file. Cost: `O(n log n)` in triangles and samples.

pub mod blue_noise;
pub mod cloud;
pub mod features;
pub mod marching;
pub mod smoothing;

pub use marching::{LabelSurface, LabelSurfaceSettings, label_surface};

use super::shape::{Generators, Geometry, Shape};
use crate::geometry::{Length, LengthScale, TriangleMesh};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How generators are taken from a shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SamplingSettings {
    /// Distance between samples, `sqrt(area / samples)`; `None` leaves it to `count`. Multiples of the spacing are relative to
    /// the spacing that `count` would give. Ignored for clouds, whose points are the generators.
    pub spacing: Option<Length>,
    /// Samples on a surface when no spacing is given. 10 000 puts them 0.6 % of the diagonal apart on bones.
    pub count: usize,
    /// Take the vertices of a mesh as they are instead of re-sampling it.
    pub vertices: bool,
    /// Edges bent more than this get samples of their own, degrees. 40 keeps the edges of machined shapes and leaves bones
    /// alone, whose meshes bend by 10 to 20 degrees an edge.
    pub feature_angle_deg: f64,
    /// Label of a label map; `None` takes all labels as one solid.
    pub label: Option<i32>,
    /// Smoothing passes on the surface of a label map; 0 keeps the voxel stairs. On voxelised balls of 16, 32 and 64 voxels 60
    /// passes leave stairs of 0.08, 0.07 and 0.07 voxels rms (20 passes of a wider band: 0.10, 0.09, 0.09) and volumes of +0.07,
    /// +0.12 and +0.02 %; 120 passes make the smallest grow by 1 %.
    pub smoothing_passes: u32,
    /// Seed of the sampling.
    pub seed: u64,
    /// Most samples allowed; a spacing that asks for more is an error.
    pub max_samples: usize,
}

impl Default for SamplingSettings {
    fn default() -> Self {
        Self {
            spacing: None,
            count: 10_000,
            vertices: false,
            feature_angle_deg: 40.0,
            label: None,
            smoothing_passes: 60,
            seed: 0,
            max_samples: 5_000_000,
        }
    }
}

/// Generators and what the user should know of how they came about.
#[derive(Clone, Debug, Default)]
pub struct Sampling {
    /// The generators.
    pub generators: Generators,
    /// Samples on sharp edges, corners included.
    pub feature_samples: usize,
    /// What was done, in plain words.
    pub remarks: Vec<String>,
}

/// A shape that gives no generators.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SamplingError {
    /// The label is not in the map, or the map is empty.
    #[error("label {label} has no voxels; choose one that is in the file")]
    NoLabel {
        /// The label asked for.
        label: i32,
    },
    /// No label at all.
    #[error("the label map has no labels; give a segmentation")]
    NoLabels,
    /// The surface has no area.
    #[error("the surface has no area; its triangles are all degenerate: export the mesh again")]
    NoArea,
    /// The spacing makes no sense or too many samples.
    #[error(
        "a spacing of {spacing_mm} mm gives {samples} samples of this surface, allowed are 4 to {most}; choose another spacing"
    )]
    Spacing {
        /// The spacing asked for, mm.
        spacing_mm: f64,
        /// The samples it would give.
        samples: f64,
        /// The most allowed.
        most: usize,
    },
    /// Too few distinct points.
    #[error("only {distinct} distinct points; a shape needs at least four")]
    TooFew {
        /// How many there are.
        distinct: usize,
    },
}

/// Generators of a shape; see the module's documentation.
///
/// # Errors
/// [`SamplingError`] when the label is missing, the surface has no area, or the spacing asks for too few or too many samples.
pub fn sample(shape: &Shape, settings: &SamplingSettings) -> Result<Sampling, SamplingError> {
    match &shape.geometry {
        Geometry::Cloud(points) => cloud::generators(points),
        Geometry::Mesh(mesh) => sample_mesh(mesh, settings, settings.feature_angle_deg),
        Geometry::Labels(map) => {
            let surface = label_surface(
                map,
                &LabelSurfaceSettings {
                    label: settings.label,
                    smoothing_passes: settings.smoothing_passes,
                },
            )?;
            // What bends sharply on a voxel surface is stairs, not edges.
            let mut sampling = sample_mesh(&surface.mesh, settings, 180.0)?;
            let mut remarks = surface.remarks();
            remarks.append(&mut sampling.remarks);
            sampling.remarks = remarks;
            Ok(sampling)
        }
    }
}

/// Generators of a mesh.
///
/// # Errors
/// Those of [`sample`].
pub fn sample_mesh(
    mesh: &TriangleMesh,
    settings: &SamplingSettings,
    feature_angle_deg: f64,
) -> Result<Sampling, SamplingError> {
    let mut mesh = canonical(mesh);
    let inward = turn_outward(&mut mesh);
    let area = mesh.area();
    if !(area.is_finite() && area > 0.0) {
        return Err(SamplingError::NoArea);
    }
    if settings.vertices {
        return vertices(mesh, area).map(|s| s.with(inward));
    }
    let count = wanted(&mesh, area, settings)?;
    let spacing = (area / count as f64).sqrt();
    let features = features::samples(&mesh, feature_angle_deg, spacing);
    let samples = blue_noise::samples(&mesh, &features, count, spacing, settings.seed);
    let (points, source) = distinct(&samples);
    let spacing_mm = (area / points.len() as f64).sqrt();
    let remarks = vec![format!(
        "the surface was sampled with {} points {spacing_mm:.4} mm apart{}",
        points.len(),
        if features.is_empty() {
            String::new()
        } else {
            format!(", {} of them on sharp edges", features.len())
        }
    )];
    finish(points, source, mesh, spacing_mm, features.len(), remarks).map(|s| s.with(inward))
}

/// Turns a closed mesh that looks inward, and says so. The inside must be where the winding number is positive.
fn turn_outward(mesh: &mut TriangleMesh) -> Option<String> {
    let topology = mesh.topology();
    if !(topology.watertight && topology.oriented && mesh.signed_volume() < 0.0) {
        return None;
    }
    mesh.flip();
    Some("the triangles look inward: they were turned outward for this run".into())
}

impl Sampling {
    fn with(mut self, remark: Option<String>) -> Self {
        self.remarks.extend(remark);
        self
    }
}

/// Samples that the settings ask for.
fn wanted(mesh: &TriangleMesh, area: f64, settings: &SamplingSettings) -> Result<usize, SamplingError> {
    let by_count = (area / settings.count.max(1) as f64).sqrt();
    let spacing_mm = match settings.spacing {
        None => by_count,
        Some(length) => {
            let scale = LengthScale {
                diagonal_mm: mesh.diagonal_mm(),
                spacing_mm: by_count,
            };
            length.to_mm(scale, mesh.diagonal_mm())
        }
    };
    let samples = area / (spacing_mm * spacing_mm);
    if (4.0..=settings.max_samples as f64 + 0.5).contains(&samples) {
        Ok(samples.round() as usize)
    } else {
        Err(SamplingError::Spacing {
            spacing_mm,
            samples: samples.round(),
            most: settings.max_samples,
        })
    }
}

fn vertices(mesh: TriangleMesh, area: f64) -> Result<Sampling, SamplingError> {
    let (points, source) = distinct(&mesh.points);
    let spacing_mm = (area / points.len().max(1) as f64).sqrt();
    let remarks = vec![format!(
        "the {} distinct vertices of the mesh are the generators",
        points.len()
    )];
    finish(points, source, mesh, spacing_mm, 0, remarks)
}

fn finish(
    points: Vec<DVec3>,
    source: Vec<u32>,
    mesh: TriangleMesh,
    spacing_mm: f64,
    feature_samples: usize,
    remarks: Vec<String>,
) -> Result<Sampling, SamplingError> {
    if points.len() < 4 {
        return Err(SamplingError::TooFew {
            distinct: points.len(),
        });
    }
    Ok(Sampling {
        generators: Generators {
            points,
            source,
            known_surface: Some(mesh),
            spacing_mm,
        },
        feature_samples,
        remarks,
    })
}

/// Points by coordinates, each once, with the index of the first that has them.
pub(crate) fn distinct(points: &[DVec3]) -> (Vec<DVec3>, Vec<u32>) {
    // Adding zero makes -0 and 0 the same coordinate.
    let clean: Vec<DVec3> = points.iter().map(|&p| p + DVec3::ZERO).collect();
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| by_coordinates(clean[a as usize], clean[b as usize]).then(a.cmp(&b)));
    order.dedup_by(|b, a| clean[*a as usize] == clean[*b as usize]);
    (order.iter().map(|&i| clean[i as usize]).collect(), order)
}

fn by_coordinates(a: DVec3, b: DVec3) -> std::cmp::Ordering {
    a.x.total_cmp(&b.x)
        .then(a.y.total_cmp(&b.y))
        .then(a.z.total_cmp(&b.z))
}

/// The same mesh in an order that depends on its geometry alone: used points by coordinates, triangles from their smallest
/// point on and sorted. Points of equal coordinates stay apart, for joining them would change the topology.
pub fn canonical(mesh: &TriangleMesh) -> TriangleMesh {
    let mut used = vec![false; mesh.points.len()];
    for i in mesh.triangles.iter().flatten() {
        used[*i as usize] = true;
    }
    let mut order: Vec<u32> = (0..mesh.points.len() as u32)
        .filter(|&i| used[i as usize])
        .collect();
    let clean = |i: u32| mesh.points[i as usize] + DVec3::ZERO;
    order.sort_unstable_by(|&a, &b| by_coordinates(clean(a), clean(b)).then(a.cmp(&b)));
    let mut slot = vec![0u32; mesh.points.len()];
    for (new, &old) in order.iter().enumerate() {
        slot[old as usize] = new as u32;
    }
    let mut triangles: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| slot[i as usize]);
            match a.min(b).min(c) {
                m if m == a => [a, b, c],
                m if m == b => [b, c, a],
                _ => [c, a, b],
            }
        })
        .collect();
    triangles.sort_unstable();
    TriangleMesh {
        points: order.iter().map(|&i| clean(i)).collect(),
        triangles,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ClosestOnMesh, Neighbours};

    /// A cube of side 2 with two triangles a face.
    fn cube() -> TriangleMesh {
        let points = (0..8)
            .map(|c| DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64) * 2.0 - 1.0)
            .collect();
        let faces: [[u32; 4]; 6] = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let triangles = faces
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        TriangleMesh { points, triangles }
    }

    #[test]
    fn a_cube_keeps_its_corners_and_gets_the_number_asked_for() {
        let settings = SamplingSettings {
            count: 1500,
            ..Default::default()
        };
        let out = sample_mesh(&cube(), &settings, 40.0).expect("a surface");
        let points = &out.generators.points;
        assert_eq!(points.len(), 1500);
        for corner in cube().points {
            assert!(points.contains(&corner));
        }
        let step = 2.0 / (2.0 / (0.8 * (24.0f64 / 1500.0).sqrt())).round();
        assert_eq!(out.feature_samples, 8 + 12 * ((2.0 / step).round() as usize - 1));
        let surface = ClosestOnMesh::new(&cube()).expect("triangles");
        assert!(points.iter().all(|&p| surface.closest(p).distance2 < 1e-28));
        // Even: no two much nearer than the spacing, no gap much wider.
        let tree = Neighbours::new(points);
        let spacing = out.generators.spacing_mm;
        for &p in points {
            let nearest = tree.knn(p, 2)[1].distance2.sqrt();
            assert!(
                (0.35 * spacing..1.4 * spacing).contains(&nearest),
                "{p}: {}",
                nearest / spacing
            );
        }
    }

    #[test]
    fn samples_do_not_depend_on_the_order_of_the_file() {
        let mesh = cube();
        let n = mesh.points.len() as u32;
        let reversed = TriangleMesh {
            points: mesh.points.iter().rev().copied().collect(),
            triangles: mesh
                .triangles
                .iter()
                .rev()
                .map(|&[a, b, c]| [n - 1 - b, n - 1 - c, n - 1 - a])
                .collect(),
        };
        let settings = SamplingSettings {
            spacing: Some(Length::PercentDiagonal(3.0)),
            ..Default::default()
        };
        let (a, b) = (
            sample_mesh(&mesh, &settings, 40.0).expect("a surface"),
            sample_mesh(&reversed, &settings, 40.0).expect("a surface"),
        );
        assert_eq!(a.generators.points, b.generators.points);
        assert_eq!(a.generators.known_surface, b.generators.known_surface);
        let other = SamplingSettings { seed: 1, ..settings };
        assert_ne!(
            sample_mesh(&mesh, &other, 40.0)
                .expect("a surface")
                .generators
                .points,
            a.generators.points
        );
    }

    #[test]
    fn impossible_spacings_are_refused() {
        for length in [
            Length::Millimetres(0.0),
            Length::Millimetres(1e-9),
            Length::Millimetres(100.0),
        ] {
            let settings = SamplingSettings {
                spacing: Some(length),
                ..Default::default()
            };
            assert!(matches!(
                sample_mesh(&cube(), &settings, 40.0),
                Err(SamplingError::Spacing { .. })
            ));
        }
        let flat = TriangleMesh {
            points: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0],
            triangles: vec![[0, 1, 2]],
        };
        assert_eq!(
            sample_mesh(&flat, &SamplingSettings::default(), 40.0).err(),
            Some(SamplingError::NoArea)
        );
    }
}
