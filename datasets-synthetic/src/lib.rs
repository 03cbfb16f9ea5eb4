//! Synthetic anatomical shapes, populations and deformations with exact ground truth.
//!
//! The crate knows nothing of medial scaffolds or of how they are computed: it makes surfaces, and says what is true of them. Lengths
//! are mm throughout, directions unit vectors, seeds `u64`; the same arguments give the same bytes on every machine and with any number
//! of threads.
//!
//! | to get | call |
//! |---|---|
//! | a shape with its truth | [`shapes::ellipsoid`]`(3., 2., 1.)`, [`shapes::box_shape`], [`shapes::torus`], ... ([`shapes`] lists them) |
//! | a bone | [`bones::capitate_like`]`(seed)`, [`bones::all`]`(seed)`; seed 0 is the reference |
//! | a mesh of about n triangles | [`Shape::mesh`]`(n)` |
//! | points on the surface itself | [`Shape::sample_uniform`]`(n, seed)`, [`Shape::sample_poisson`], [`Shape::sample_density_gradient`] |
//! | points on any mesh | [`sample_uniform`]`(&mesh, n, seed)`, [`sample_poisson`], [`sample_density_gradient`]`(&mesh, n, 20., seed)` |
//! | noise, outliers, spacing | [`add_noise`]`(&points, sigma_mm, seed)`, [`add_outliers`]`(&points, share, inflate, seed)`, [`mean_spacing`]`(area, n)` |
//! | topology, volume, area of a mesh | [`TriangleMesh::topology`], [`TriangleMesh::volume`], [`TriangleMesh::area`] |
//! | exact volume, area, Betti numbers, medial set, counts | `shape.truth` ([`Truth`]); [`truth::Medial::distance`]; [`Shape::volume_mm3`] |
//! | inside or outside | [`Shape::field`], [`implicit::Field::value`] (negative inside) |
//! | a pose | [`rigid::random`]`(seed)`, [`rigid::random_of_angle`], [`RigidMotion::mirror`]; [`Shape::moved`] |
//! | a smooth deformation | [`Warp::random_smooth`], [`Warp::bend_x`], [`Warp::swelling`], ...; [`Shape::warped`] |
//! | a crop | [`deform::crop_half_space`], [`deform::crop_half_spaces`], [`deform::visible_from`], [`deform::remove_ball`] |
//! | a lesion that grows by p percent | [`deform::growth::random_lesion`], [`deform::growth::grow`], [`shapes::star_blob`] |
//! | a population with known modes | [`population::population`], [`population::one_mode_ellipsoids`], [`population::two_mode_ellipsoids`] |
//! | a label mask, a NIfTI file | [`masks::LabelMask::fill`], [`masks::LabelMask::fill_mesh`], [`masks::sphere_mask`]; [`nifti::save`] |
//! | files by name | `"bones".parse::<ShapeKind>()`, [`ShapeKind::list`], [`generate`], [`write_dataset`] |
//!
//! ```
//! use datasets_synthetic::{add_noise, mean_spacing, rigid, sample_poisson, shapes};
//!
//! let shape = shapes::ellipsoid(3.0, 2.0, 1.0);
//! let mesh = shape.mesh(5_000); // about 5 000 triangles, closed, outward
//! assert_eq!(mesh.topology().euler, shape.truth.surface_euler);
//!
//! let cloud = sample_poisson(&mesh, 1_000, 7); // on the mesh; `shape.sample_poisson` is on the surface itself
//! let sigma = 0.25 * mean_spacing(mesh.area(), cloud.len());
//! let noisy = add_noise(&cloud.points, sigma, 1);
//! let motion = rigid::random(3);
//! let moved: Vec<_> = noisy.iter().map(|&p| motion.apply(p)).collect();
//! assert_eq!(moved.len(), 1_000);
//! ```

pub mod bones;
pub mod cloud;
pub mod dataset;
pub mod deform;
pub mod implicit;
pub mod masks;
pub mod mesh;
pub mod nifti;
pub mod ply;
pub mod population;
pub mod registry;
pub mod sampling;
pub mod shapes;
pub mod truth;

pub use cloud::Cloud;
pub use dataset::{Dataset, DatasetSettings, generate, write_dataset};
pub use deform::{RigidMotion, Warp, rigid};
pub use mesh::{Bounds, MeshTopology, TriangleMesh};
pub use registry::ShapeKind;
pub use sampling::{
    add_noise, add_outliers, mean_spacing, sample_density_gradient, sample_poisson, sample_uniform,
};
pub use shapes::Shape;
pub use truth::Truth;
