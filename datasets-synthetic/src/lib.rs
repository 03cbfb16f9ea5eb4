//! Synthetic anatomical shapes, populations and deformations with exact ground truth.
//!
//! The crate knows nothing of medial scaffolds or of how they are computed: it makes surfaces, and says what is true of them. Lengths
//! are mm throughout, directions unit vectors, seeds `u64`; the same arguments give the same bytes on every machine and with any number
//! of threads.
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
