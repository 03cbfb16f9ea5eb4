//! The nearest place of a surface, exactly: on the triangles of a mesh, on the discs of an oriented cloud.

use crate::geometry::TriangleMesh;
use crate::geometry::closest::ClosestOnMesh;
use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// A place on a surface nearest to a query.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    pub(crate) place: DVec3,
    /// Outward unit normal there.
    pub(crate) normal: DVec3,
}

/// A surface that answers nearest-place queries.
pub(crate) enum ExactSurface {
    /// Triangles in a bounding volume hierarchy, with their normals.
    Mesh {
        mesh: TriangleMesh,
        index: Box<ClosestOnMesh>,
        normals: Vec<DVec3>,
    },
    /// Discs of radius `reach` about oriented points: the distance does not feel where on the surface the samples fell.
    Discs {
        tree: Box<PointTree>,
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
    pub(crate) fn of_mesh(mesh: TriangleMesh, normals: Vec<DVec3>) -> Option<Self> {
        let index = Box::new(ClosestOnMesh::new(&mesh)?);
        Some(ExactSurface::Mesh { mesh, index, normals })
    }

    /// Nearest place to `q`.
    pub(crate) fn touch(&self, q: DVec3) -> Touch {
        match self {
            ExactSurface::Mesh { index, normals, .. } => {
                let found = index.closest(q);
                Touch {
                    place: found.point,
                    normal: normals[found.triangle as usize],
                }
            }
            ExactSurface::Discs {
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
