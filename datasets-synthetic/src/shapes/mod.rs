//! Shapes with exact ground truth.
//!
//! A [`Shape`] is a surface that can be meshed at any resolution, sampled **on** itself (not on a mesh of it), voxelised when
//! it bounds a solid, moved and warped, with its [`Truth`] beside it. One file a family:
//!
//! * [`quadrics`]: sphere, ellipsoid, hollow sphere, ball with cavities;
//! * [`polyhedra`]: box, slab, triangular prism, L-block;
//! * [`tubes`]: torus, trefoil knot, capsule, Y of capsules, dumbbell, branching tree;
//! * [`plates`]: plates with any number of holes (genus 5 among them);
//! * [`star`]: star-shaped blobs with exact volume: the three-lobed blob, tumours;
//! * [`open`]: hemisphere, sphere with a cap missing, tube, Moebius band, crossing planes, the pair of planes with a bump;
//! * [`grids`]: the mesh builders they share.

pub mod grids;
pub mod open;
pub mod plates;
pub mod polyhedra;
pub mod quadrics;
pub mod star;
pub mod tubes;

pub use grids::subdivide;
pub use open::{
    crossing_planes, hemisphere, moebius_band, open_tube, planes_with_bump, sphere_with_cap_missing,
};
pub use plates::{genus_five, plate_with_holes};
pub use polyhedra::{box_shape, l_block, prism, slab};
pub use quadrics::{ball_with_cavities, ellipsoid, hollow_sphere, sphere};
pub use star::{star_blob, three_lobed_blob};
pub use tubes::{capsule, dumbbell, torus, tree_tube, trefoil_tube, y_of_capsules};

use crate::cloud::Cloud;
use crate::deform::{RigidMotion, Warp};
use crate::implicit::{Field, mesh_with_triangles};
use crate::mesh::{Bounds, TriangleMesh};
use crate::sampling;
use crate::truth::Truth;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

type Mesher = Arc<dyn Fn(usize) -> TriangleMesh + Send + Sync>;
type Projector = Arc<dyn Fn(DVec3) -> DVec3 + Send + Sync>;

/// A surface with its ground truth.
#[derive(Clone)]
pub struct Shape {
    /// Name in files: lower case with underscores.
    pub name: String,
    /// What is exactly known.
    pub truth: Truth,
    field: Option<Field>,
    bounds: Bounds,
    finest_feature: f64,
    mesher: Mesher,
    projector: Projector,
}

impl std::fmt::Debug for Shape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shape")
            .field("name", &self.name)
            .field("bounds", &self.bounds)
            .finish_non_exhaustive()
    }
}

impl Shape {
    /// A solid given by a field, meshed by marching tetrahedra.
    ///
    /// `bounds` must contain the solid; `finest_feature` is the thickness of its thinnest part, mm, which bounds the lattice
    /// from above whatever the resolution asked for.
    pub fn from_field(name: &str, field: Field, bounds: Bounds, finest_feature: f64, truth: Truth) -> Self {
        let (for_mesh, for_projection) = (field.clone(), field.clone());
        let mesher = Arc::new(move |triangles: usize| {
            mesh_with_triangles(&for_mesh, &bounds, triangles, finest_feature)
                .expect("the bounds contain the solid and the lattice resolves its finest feature")
        });
        let projector = Arc::new(move |p| for_projection.project(p));
        Shape {
            name: name.to_string(),
            truth,
            field: Some(field),
            bounds,
            finest_feature,
            mesher,
            projector,
        }
    }

    /// A surface given by a mesh builder (argument: number of triangles) and a map that takes points near the surface onto it.
    pub fn from_mesher(
        name: &str,
        bounds: Bounds,
        finest_feature: f64,
        truth: Truth,
        field: Option<Field>,
        mesher: impl Fn(usize) -> TriangleMesh + Send + Sync + 'static,
        projector: impl Fn(DVec3) -> DVec3 + Send + Sync + 'static,
    ) -> Self {
        Shape {
            name: name.to_string(),
            truth,
            field,
            bounds,
            finest_feature,
            mesher: Arc::new(mesher),
            projector: Arc::new(projector),
        }
    }

    /// A mesh with about that many triangles (usually within a fifth): closed and oriented outwards when the shape is a solid.
    /// Vertices lie on the surface.
    pub fn mesh(&self, triangles: usize) -> TriangleMesh {
        (self.mesher)(triangles)
    }

    /// The implicit function, negative inside; `None` for open surfaces.
    pub fn field(&self) -> Option<&Field> {
        self.field.as_ref()
    }

    /// A box that contains the shape.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Thickness of the thinnest part, mm.
    pub fn finest_feature(&self) -> f64 {
        self.finest_feature
    }

    /// Volume, mm^3: the analytic one when it is known, else by extrapolation; `None` for open surfaces.
    ///
    /// A mesh with its vertices on the surface and the same mesh with every triangle split and the new vertices projected have errors in the ratio
    /// 4 : 1 (squared edge length), so `(4 fine - coarse) / 3` cancels them: about 1e-5 for the bones, tested against shapes of known volume.
    pub fn volume_mm3(&self) -> Option<f64> {
        if !self.truth.closed {
            return None;
        }
        self.truth.volume_mm3.or_else(|| {
            let coarse = self.mesh(6_000);
            let mut fine = subdivide(&coarse, 2);
            fine.points.par_iter_mut().for_each(|p| *p = self.project(*p));
            Some((4.0 * fine.volume() - coarse.volume()) / 3.0)
        })
    }

    /// A point of the surface near `p` (for `p` near the surface).
    pub fn project(&self, p: DVec3) -> DVec3 {
        (self.projector)(p)
    }

    /// `n` independent points on the surface itself, uniform over its area, with normals.
    ///
    /// Drawn on a fine mesh and projected: density is uniform up to the squared ratio of edge to curvature radius.
    pub fn sample_uniform(&self, n: usize, seed: u64) -> Cloud {
        self.on_surface(sampling::sample_uniform(&self.sampling_mesh(n), n, seed))
    }

    /// `n` blue-noise points on the surface itself, with normals.
    pub fn sample_poisson(&self, n: usize, seed: u64) -> Cloud {
        self.on_surface(sampling::sample_poisson(&self.sampling_mesh(n), n, seed))
    }

    /// `n` points on the surface itself whose density grows along x by `ratio`.
    pub fn sample_density_gradient(&self, n: usize, ratio: f64, seed: u64) -> Cloud {
        self.on_surface(sampling::sample_density_gradient(
            &self.sampling_mesh(n),
            n,
            ratio,
            seed,
        ))
    }

    fn sampling_mesh(&self, n: usize) -> TriangleMesh {
        self.mesh((2 * n).clamp(4_000, 60_000))
    }

    fn on_surface(&self, cloud: Cloud) -> Cloud {
        let points: Vec<DVec3> = cloud.points.par_iter().map(|&p| self.project(p)).collect();
        let normals = match &self.field {
            Some(field) => points
                .par_iter()
                .zip(&cloud.normals)
                .map(|(&p, &facet)| {
                    // On the sharp edges of polyhedra the facet knows better than the gradient.
                    let n = field.normal(p);
                    if n.dot(facet) > 0.8 { n } else { facet }
                })
                .collect(),
            None => cloud.normals,
        };
        Cloud { points, normals }
    }

    /// The shape after a rigid motion or a mirror image; meshes stay oriented outwards and all truth moves along.
    pub fn moved(&self, motion: &RigidMotion) -> Self {
        let mut shape = self.warped(&Warp::Rigid(*motion));
        shape.truth = self.truth.moved(motion);
        shape.finest_feature = self.finest_feature;
        shape
    }

    /// The shape under a smooth map. Meshes correspond to the meshes of this shape index by index.
    ///
    /// Topology stays; volume, area and medial geometry are not known in closed form any more and become `None`
    /// (see [`Warp::image_volume`]).
    pub fn warped(&self, warp: &Warp) -> Self {
        let shared = Arc::new(warp.clone());
        let flips = warp.jacobian(self.bounds.centre()).determinant() < 0.0;
        let (mesher, projector) = (self.mesher.clone(), self.projector.clone());
        let (for_mesh, for_points) = (shared.clone(), shared.clone());
        let corners = self.warped_bounds(warp);
        let truth = Truth {
            derivation: format!("{} Then warped smoothly.", self.truth.derivation),
            volume_mm3: None,
            area_mm2: None,
            medial_radius_mm: None,
            counts: None,
            counts_at_tolerance: None,
            medial: None,
            ..self.truth.clone()
        };
        Shape {
            name: self.name.clone(),
            truth,
            field: self.field.clone().map(|of| Field::Warped {
                of: Arc::new(of),
                warp: shared.clone(),
            }),
            bounds: corners,
            finest_feature: 0.5 * self.finest_feature,
            mesher: Arc::new(move |n| {
                let mesh = mesher(n).mapped(|p| for_mesh.apply(p));
                if flips { mesh.flipped() } else { mesh }
            }),
            projector: Arc::new(move |p| for_points.apply(projector(for_points.inverse(p)))),
        }
    }

    /// Box around the images of a lattice over the faces of the bounds, with 5 % to spare.
    fn warped_bounds(&self, warp: &Warp) -> Bounds {
        let steps = 8;
        let mut images = Vec::new();
        for i in 0..=steps {
            for j in 0..=steps {
                for k in 0..=steps {
                    if [i, j, k].iter().any(|&s| s == 0 || s == steps) {
                        let u = DVec3::new(i as f64, j as f64, k as f64) / steps as f64;
                        images.push(warp.apply(self.bounds.min + u * self.bounds.size()));
                    }
                }
            }
        }
        let bounds = Bounds::of(&images).expect("the lattice has points");
        bounds.inflated(0.05 * bounds.diagonal())
    }
}
