//! Point clouds: points with the outward normals of the surface they were drawn from.

use crate::mesh::Bounds;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Points sampled from a surface, mm.
///
/// `normals` are the true outward normals, one a point, or empty when there are none (outliers,
/// clouds that were built by hand). A method under test that must not see normals uses `points` alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cloud {
    /// Positions, mm.
    pub points: Vec<DVec3>,
    /// Unit outward normals, as many as points, or none.
    pub normals: Vec<DVec3>,
}

impl Cloud {
    /// A cloud without normals.
    pub fn from_points(points: Vec<DVec3>) -> Self {
        Cloud {
            points,
            normals: Vec::new(),
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Box around the points; `None` for an empty cloud.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(&self.points)
    }

    /// The cloud restricted to `keep`, in that order.
    pub fn selected(&self, keep: &[u32]) -> Self {
        let pick = |values: &[DVec3]| -> Vec<DVec3> { keep.iter().map(|&i| values[i as usize]).collect() };
        Cloud {
            points: pick(&self.points),
            normals: if self.normals.is_empty() {
                Vec::new()
            } else {
                pick(&self.normals)
            },
        }
    }
}
