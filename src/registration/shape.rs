//! What registration takes: a surface, and the coarse scaffold when there is one.

use crate::coarse_scaffold::hypergraph::CoarseScaffold;
use crate::geometry::TriangleMesh;
use glam::DVec3;
use thiserror::Error;

/// A surface as a mesh or as a cloud. Lengths in mm.
#[derive(Clone, Copy, Debug)]
pub enum Surface<'a> {
    /// A triangle mesh, closed or not.
    Mesh(&'a TriangleMesh),
    /// A cloud. Without normals its noise is removed and normals are made; with normals it is taken as it is.
    Cloud {
        /// Points, mm.
        points: &'a [DVec3],
        /// Outward unit normals, one a point.
        normals: Option<&'a [DVec3]>,
    },
}

/// A shape to register: its surface and, optionally, its coarse scaffold, which adds hypotheses of the pose.
#[derive(Clone, Copy, Debug)]
pub struct RegistrationShape<'a> {
    /// The surface, which decides.
    pub surface: Surface<'a>,
    /// The coarse scaffold of the same shape in the same frame.
    pub scaffold: Option<&'a CoarseScaffold>,
}

impl<'a> RegistrationShape<'a> {
    /// A shape known by its mesh alone.
    pub fn mesh(mesh: &'a TriangleMesh) -> Self {
        Self {
            surface: Surface::Mesh(mesh),
            scaffold: None,
        }
    }

    /// A shape known by a raw cloud alone.
    pub fn cloud(points: &'a [DVec3]) -> Self {
        Self {
            surface: Surface::Cloud {
                points,
                normals: None,
            },
            scaffold: None,
        }
    }

    /// The same shape with its scaffold.
    pub fn with_scaffold(self, scaffold: &'a CoarseScaffold) -> Self {
        Self {
            scaffold: Some(scaffold),
            ..self
        }
    }

    pub(crate) fn points(&self) -> &'a [DVec3] {
        match self.surface {
            Surface::Mesh(mesh) => &mesh.points,
            Surface::Cloud { points, .. } => points,
        }
    }

    /// Checks everything later stages rely on; `role` is `target` or `source`.
    pub(crate) fn validate(&self, role: &'static str) -> Result<(), RegistrationError> {
        let points = self.points();
        if points.len() < FEWEST_POINTS {
            return Err(RegistrationError::TooFewPoints {
                role,
                found: points.len(),
                needed: FEWEST_POINTS,
            });
        }
        if let Some(index) = points.iter().position(|p| !p.is_finite()) {
            return Err(RegistrationError::NotFinite {
                role,
                index,
                what: "point",
            });
        }
        let [low, high] = crate::geometry::mesh::bounds(points).expect("there are points");
        if !(high - low).length().is_normal() {
            return Err(RegistrationError::NoExtent { role });
        }
        match self.surface {
            Surface::Mesh(mesh) => {
                for (triangle, t) in mesh.triangles.iter().enumerate() {
                    if let Some(&vertex) = t.iter().find(|&&v| v as usize >= points.len()) {
                        return Err(RegistrationError::BadTriangle {
                            role,
                            triangle,
                            vertex,
                            points: points.len(),
                        });
                    }
                }
                if !mesh.area().is_normal() {
                    return Err(RegistrationError::NoArea { role });
                }
            }
            Surface::Cloud {
                normals: Some(normals),
                ..
            } => {
                if normals.len() != points.len() {
                    return Err(RegistrationError::NormalCount {
                        role,
                        normals: normals.len(),
                        points: points.len(),
                    });
                }
                if let Some(index) = normals.iter().position(|n| !(n.is_finite() && n.length() > 0.5)) {
                    return Err(RegistrationError::NotFinite {
                        role,
                        index,
                        what: "normal",
                    });
                }
            }
            Surface::Cloud { normals: None, .. } => {}
        }
        Ok(())
    }
}

/// Fewest points a pose can be looked for with: four corners of a tetrahedron.
const FEWEST_POINTS: usize = 4;

/// Why two shapes could not be registered.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RegistrationError {
    /// Hardly any points.
    #[error("the {role} has {found} points; registration needs at least {needed}")]
    TooFewPoints {
        /// `target` or `source`.
        role: &'static str,
        /// How many there are.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// A coordinate or normal that is not a number, or a normal without length.
    #[error("{what} {index} of the {role} is not finite or has no length; run `medial check` on the file")]
    NotFinite {
        /// `target` or `source`.
        role: &'static str,
        /// Which point.
        index: usize,
        /// `point` or `normal`.
        what: &'static str,
    },
    /// All points in one place.
    #[error("all points of the {role} are in one place; there is no shape to register")]
    NoExtent {
        /// `target` or `source`.
        role: &'static str,
    },
    /// A mesh without area.
    #[error("the triangles of the {role} have no area; give it as a cloud or repair the mesh")]
    NoArea {
        /// `target` or `source`.
        role: &'static str,
    },
    /// A triangle that names a missing vertex.
    #[error("triangle {triangle} of the {role} names vertex {vertex}, but there are {points} points")]
    BadTriangle {
        /// `target` or `source`.
        role: &'static str,
        /// Which triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of points.
        points: usize,
    },
    /// Normals and points differ in number.
    #[error("the {role} has {normals} normals for {points} points; give one normal a point or none at all")]
    NormalCount {
        /// `target` or `source`.
        role: &'static str,
        /// Number of normals.
        normals: usize,
        /// Number of points.
        points: usize,
    },
    /// A setting out of its range.
    #[error("setting `{name}` is {value}; it must be {allowed}")]
    Setting {
        /// Name of the field.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
}
