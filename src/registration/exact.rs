//! The nearest place of a surface, exactly: on the triangles of a mesh, on the discs of an oriented cloud.

use crate::geometry::TriangleMesh;
use crate::geometry::closest::ClosestOnMesh;
use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::sync::Arc;

/// A place on a surface nearest to a query.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    pub(crate) place: DVec3,
    /// Outward unit normal there.
    pub(crate) normal: DVec3,
}

/// A surface that answers nearest-place queries. Its mirror image and its copies of other sizes share the index: queries are mirrored
/// and scaled instead.
#[derive(Clone)]
pub(crate) struct ExactSurface {
    kind: Arc<Kind>,
    mirrored: bool,
    /// Size of this copy as a factor of the indexed surface.
    size: f64,
}

enum Kind {
    /// Triangles in a bounding volume hierarchy, with their normals.
    Mesh {
        index: ClosestOnMesh,
        normals: Vec<DVec3>,
    },
    /// Discs of radius `reach` about oriented points: the distance does not feel where on the surface the samples fell.
    Discs {
        tree: PointTree,
        points: Vec<DVec3>,
        normals: Vec<DVec3>,
        reach: f64,
    },
}

/// A kd-tree that answers with one index and no list: the inner loop of the refinement asks it a million times. Which of
/// several equally near points it names does not matter there.
pub(crate) struct PointTree(ImmutableKdTree<f64, 3>);

impl PointTree {
    /// `None` when there are no points or the tree cannot be built.
    pub(crate) fn new(points: &[DVec3]) -> Option<Self> {
        let rows: Vec<[f64; 3]> = points.iter().map(|p| p.to_array()).collect();
        ImmutableKdTree::new_from_slice(&rows).ok().map(Self)
    }

    /// Index of the nearest point.
    #[inline]
    pub(crate) fn nearest(&self, q: DVec3) -> usize {
        let found = self
            .0
            .query(&q.to_array())
            .nearest_one::<SquaredEuclidean<f64>>()
            .execute();
        found.item as usize
    }
}

impl ExactSurface {
    /// Triangles with their outward unit normals; `None` without triangles.
    pub(crate) fn of_mesh(mesh: &TriangleMesh, normals: Vec<DVec3>) -> Option<Self> {
        let index = ClosestOnMesh::new(mesh)?;
        Some(Self::new(Kind::Mesh { index, normals }))
    }

    /// Discs of radius `reach` about oriented points; `None` without points.
    pub(crate) fn of_discs(points: &[DVec3], normals: &[DVec3], reach: f64) -> Option<Self> {
        Some(Self::new(Kind::Discs {
            tree: PointTree::new(points)?,
            points: points.to_vec(),
            normals: normals.to_vec(),
            reach,
        }))
    }

    fn new(kind: Kind) -> Self {
        Self {
            kind: Arc::new(kind),
            mirrored: false,
            size: 1.0,
        }
    }

    /// The surface with `x -> -x`.
    pub(crate) fn mirror_image(&self) -> Self {
        Self {
            kind: Arc::clone(&self.kind),
            mirrored: !self.mirrored,
            size: self.size,
        }
    }

    /// The surface enlarged by `factor` about the origin.
    pub(crate) fn resized(&self, factor: f64) -> Self {
        Self {
            kind: Arc::clone(&self.kind),
            mirrored: self.mirrored,
            size: self.size * factor,
        }
    }

    /// Nearest place to `q`.
    pub(crate) fn touch(&self, q: DVec3) -> Touch {
        let inner = q / self.size;
        if self.mirrored {
            let touch = self.kind.touch(flip(inner));
            return Touch {
                place: flip(touch.place) * self.size,
                normal: flip(touch.normal),
            };
        }
        let touch = self.kind.touch(inner);
        Touch {
            place: touch.place * self.size,
            normal: touch.normal,
        }
    }
}

fn flip(p: DVec3) -> DVec3 {
    DVec3::new(-p.x, p.y, p.z)
}

impl Kind {
    fn touch(&self, q: DVec3) -> Touch {
        match self {
            Kind::Mesh { index, normals } => {
                let found = index.closest(q);
                Touch {
                    place: found.point,
                    normal: normals[found.triangle as usize],
                }
            }
            Kind::Discs {
                tree,
                points,
                normals,
                reach,
            } => {
                let i = tree.nearest(q);
                let offset = q - points[i];
                let height = offset.dot(normals[i]);
                let along = offset - normals[i] * height;
                let place = points[i] + along.clamp_length_max(*reach);
                Touch {
                    place,
                    normal: normals[i],
                }
            }
        }
    }
}
