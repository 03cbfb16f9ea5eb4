//! Marching tetrahedra on a body-centred cubic lattice, then an even mesh.
//!
//! 1. The lattice: corners and centres of cubes of side `g` (1.25 edge lengths). Around each inner face of
//!    the cubic grid, the two centres and the four corners form four congruent tetrahedra.
//! 2. Values at all lattice points; zero counts as outside, so the surface never touches one. A tetrahedron
//!    with both signs yields one or two triangles: such a surface is a closed oriented 2-manifold for **any** values
//!    (Payne & Toga 1990; lattice: Chan & Purisima 1998), as long as it stays inside the grid.
//! 3. Vertices: the root of the field on the lattice edge, by the Illinois method, to 1e-12 of the edge.
//! 4. [`remesh`](super::remesh): short edges collapsed, edges flipped, vertices relaxed and projected back.
//!
//! Everything is ordered by lattice index, so equal input gives equal bytes. Values are computed in parallel, each
//! by itself, which does not change them. Cost O((diagonal / edge)^3) field values.
//!
//! Features thinner than the lattice can be missed or joined: choose the edge length below half the
//! thinnest part. The shapes of this crate say what they need through [`crate::shapes::Shape::finest_feature`].

use super::field::Field;
use super::remesh::{RemeshSettings, remesh};
use crate::mesh::{Bounds, TriangleMesh};
use crate::shapes::subdivide;
use glam::DVec3;
use rayon::prelude::*;
use thiserror::Error;

/// Why a field could not be turned into a mesh.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PolygoniseError {
    /// The surface leaves the given box: enlarge the box.
    #[error("the surface crosses the border of the box {min} .. {max}: give a larger box")]
    Truncated {
        /// Least corner of the box.
        min: DVec3,
        /// Greatest corner of the box.
        max: DVec3,
    },
    /// The field has one sign on the whole lattice: nothing to mesh at this resolution.
    #[error(
        "no surface found in the box at edge length {edge_length}: the box misses it, or it is thinner than that"
    )]
    Empty {
        /// Edge length asked for, mm.
        edge_length: f64,
    },
    /// The lattice would be too large for memory.
    #[error(
        "edge length {edge_length} needs {points:.1e} lattice points, more than {LATTICE_LIMIT:.0e}: choose a longer one"
    )]
    TooFine {
        /// Edge length asked for, mm.
        edge_length: f64,
        /// Lattice points it needs.
        points: f64,
    },
}

/// Lattice points at most (8 bytes each).
const LATTICE_LIMIT: f64 = 3e8;

/// Finer meshes are made by splitting the triangles of a mesh of at most this many and projecting the new vertices.
const MARCHED_TRIANGLES: f64 = 100_000.0;

/// Side of the lattice's cubes in target edge lengths: the raw mesh then has about twice the wanted vertices.
const CUBE_PER_EDGE: f64 = 1.25;

/// Meshes the surface of `field` inside `bounds` with edges of about `edge_length` mm.
///
/// # Errors
/// See [`PolygoniseError`].
pub fn mesh_with_edge_length(
    field: &Field,
    bounds: &Bounds,
    edge_length: f64,
) -> Result<TriangleMesh, PolygoniseError> {
    let raw = march(field, bounds, CUBE_PER_EDGE * edge_length)?;
    Ok(remesh(
        &raw,
        field,
        &RemeshSettings {
            edge_length,
            ..RemeshSettings::default()
        },
    ))
}

/// Meshes the surface with about `triangles` triangles (usually within 10 %).
///
/// The area is first estimated on a coarse lattice; equilateral triangles of that area then give the edge length.
///
/// # Errors
/// See [`PolygoniseError`].
pub fn mesh_with_triangles(
    field: &Field,
    bounds: &Bounds,
    triangles: usize,
    finest_feature: f64,
) -> Result<TriangleMesh, PolygoniseError> {
    let coarse = (bounds.size().max_element() / 24.0).min(0.45 * finest_feature);
    let area = march(field, bounds, coarse)?.area();
    // Beyond a hundred thousand triangles the lattice would cost more than the surface: split a coarser mesh instead.
    let parts = (triangles as f64 / MARCHED_TRIANGLES).sqrt().ceil().max(1.0) as usize;
    let marched = (triangles / (parts * parts)).max(4);
    let edge_length = (4.0 * area / (3f64.sqrt() * marched as f64)).sqrt();
    let lattice = (CUBE_PER_EDGE * edge_length).min(0.45 * finest_feature);
    let raw = march(field, bounds, lattice)?;
    let even = remesh(
        &raw,
        field,
        &RemeshSettings {
            edge_length,
            ..RemeshSettings::default()
        },
    );
    if parts == 1 {
        return Ok(even);
    }
    let mut fine = subdivide(&even, parts);
    fine.points.par_iter_mut().for_each(|p| *p = field.project(*p));
    Ok(fine)
}

/// The lattice: cube corners first, then cube centres.
struct Lattice {
    min: DVec3,
    cube: f64,
    /// Cubes along each axis.
    n: [usize; 3],
}

impl Lattice {
    fn corner(&self, i: usize, j: usize, k: usize) -> usize {
        (k * (self.n[1] + 1) + j) * (self.n[0] + 1) + i
    }

    fn corners(&self) -> usize {
        (self.n[0] + 1) * (self.n[1] + 1) * (self.n[2] + 1)
    }

    fn centre(&self, i: usize, j: usize, k: usize) -> usize {
        self.corners() + (k * self.n[1] + j) * self.n[0] + i
    }

    fn len(&self) -> usize {
        self.corners() + self.n[0] * self.n[1] * self.n[2]
    }

    fn position(&self, id: usize) -> DVec3 {
        let (id, nx, ny, shift) = if id < self.corners() {
            (id, self.n[0] + 1, self.n[1] + 1, 0.0)
        } else {
            (id - self.corners(), self.n[0], self.n[1], 0.5)
        };
        let (i, j, k) = (id % nx, id / nx % ny, id / (nx * ny));
        self.min + self.cube * (DVec3::new(i as f64, j as f64, k as f64) + shift)
    }
}

/// The raw marching-tetrahedra mesh with cubes of side `cube` mm; vertices are on the surface, triangles are uneven.
pub(crate) fn march(field: &Field, bounds: &Bounds, cube: f64) -> Result<TriangleMesh, PolygoniseError> {
    // Two cubes of air, so that centres and corners around the solid exist; an irrational shift keeps
    // symmetric shapes from having lattice points exactly on their surface.
    let grown = bounds.inflated(2.0 * cube);
    let min = grown.min - cube * DVec3::new(0.2718, 0.3141, 0.1618);
    let size = (grown.max - min) / cube;
    let n = [size.x, size.y, size.z].map(|s| s.ceil().max(1.0));
    let points = 2.0 * n[0] * n[1] * n[2];
    if points > LATTICE_LIMIT {
        return Err(PolygoniseError::TooFine {
            edge_length: cube / CUBE_PER_EDGE,
            points,
        });
    }
    let lattice = Lattice {
        min,
        cube,
        n: n.map(|s| s as usize),
    };
    let values: Vec<f64> = (0..lattice.len())
        .into_par_iter()
        .map(|id| field.value(lattice.position(id)))
        .collect();
    if border_is_inside(&lattice, &values) {
        return Err(PolygoniseError::Truncated {
            min: bounds.min,
            max: bounds.max,
        });
    }
    let soup = triangles_of_all_tetrahedra(&lattice, &values);
    if soup.is_empty() {
        return Err(PolygoniseError::Empty {
            edge_length: cube / CUBE_PER_EDGE,
        });
    }
    Ok(weld(field, &lattice, &values, &soup))
}

fn border_is_inside(lattice: &Lattice, values: &[f64]) -> bool {
    let [nx, ny, nz] = lattice.n;
    let mut inside = false;
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                if i == 0 || j == 0 || k == 0 || i == nx || j == ny || k == nz {
                    inside |= values[lattice.corner(i, j, k)] < 0.0;
                }
            }
        }
    }
    inside
}

/// A crossed lattice edge, smaller id in the upper half: sorts by place.
type EdgeKey = u64;

fn edge_key(a: usize, b: usize) -> EdgeKey {
    ((a.min(b) as u64) << 32) | a.max(b) as u64
}

fn triangles_of_all_tetrahedra(lattice: &Lattice, values: &[f64]) -> Vec<[EdgeKey; 3]> {
    let [nx, ny, nz] = lattice.n;
    let mut soup = Vec::new();
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let here = lattice.centre(i, j, k);
                let c = |a: usize, b: usize, d: usize| lattice.corner(i + a, j + b, k + d);
                // The face towards the next cube along each axis, its corners counter-clockwise seen from that cube.
                if i + 1 < nx {
                    let ring = [c(1, 0, 0), c(1, 1, 0), c(1, 1, 1), c(1, 0, 1)];
                    around_face(here, lattice.centre(i + 1, j, k), ring, values, &mut soup);
                }
                if j + 1 < ny {
                    let ring = [c(0, 1, 0), c(0, 1, 1), c(1, 1, 1), c(1, 1, 0)];
                    around_face(here, lattice.centre(i, j + 1, k), ring, values, &mut soup);
                }
                if k + 1 < nz {
                    let ring = [c(0, 0, 1), c(1, 0, 1), c(1, 1, 1), c(0, 1, 1)];
                    around_face(here, lattice.centre(i, j, k + 1), ring, values, &mut soup);
                }
            }
        }
    }
    soup
}

fn around_face(a: usize, b: usize, ring: [usize; 4], values: &[f64], soup: &mut Vec<[EdgeKey; 3]>) {
    for s in 0..4 {
        march_tetrahedron([a, b, ring[s], ring[(s + 1) % 4]], values, soup);
    }
}

/// Triangles of one positively oriented tetrahedron, counter-clockwise seen from the positive side.
fn march_tetrahedron(tet: [usize; 4], values: &[f64], soup: &mut Vec<[EdgeKey; 3]>) {
    let inside = tet.map(|v| values[v] < 0.0);
    let count = inside.iter().filter(|&&s| s).count();
    // Even permutations that bring a given vertex, or a given pair, to the front.
    const FIRST: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]];
    const PAIR: [[usize; 4]; 6] = [
        [0, 1, 2, 3],
        [0, 2, 3, 1],
        [0, 3, 1, 2],
        [1, 2, 0, 3],
        [1, 3, 2, 0],
        [2, 3, 0, 1],
    ];
    match count {
        1 | 3 => {
            let odd = (0..4)
                .find(|&i| inside[i] == (count == 1))
                .expect("one vertex differs from the others");
            let [p, q, r, s] = FIRST[odd].map(|i| tet[i]);
            let (u, v, w) = (edge_key(p, q), edge_key(p, r), edge_key(p, s));
            soup.push(if count == 1 { [u, v, w] } else { [u, w, v] });
        }
        2 => {
            let order = PAIR
                .iter()
                .find(|o| inside[o[0]] && inside[o[1]])
                .expect("two vertices are inside");
            let [p, q, r, s] = order.map(|i| tet[i]);
            let (pr, ps, qr, qs) = (edge_key(p, r), edge_key(p, s), edge_key(q, r), edge_key(q, s));
            soup.push([pr, ps, qs]);
            soup.push([pr, qs, qr]);
        }
        _ => {}
    }
}

fn weld(field: &Field, lattice: &Lattice, values: &[f64], soup: &[[EdgeKey; 3]]) -> TriangleMesh {
    let mut keys: Vec<EdgeKey> = soup.iter().flatten().copied().collect();
    keys.par_sort_unstable();
    keys.dedup();
    let points = keys
        .par_iter()
        .map(|&key| {
            let (a, b) = ((key >> 32) as usize, (key & 0xFFFF_FFFF) as usize);
            root_on_edge(
                field,
                [lattice.position(a), lattice.position(b)],
                [values[a], values[b]],
            )
        })
        .collect();
    let id = |key: EdgeKey| keys.binary_search(&key).expect("every key was collected") as u32;
    let triangles = soup.par_iter().map(|t| t.map(id)).collect();
    TriangleMesh { points, triangles }
}

/// Root of the field on a segment whose ends have opposite signs (Illinois method).
fn root_on_edge(field: &Field, ends: [DVec3; 2], values: [f64; 2]) -> DVec3 {
    let (mut t0, mut t1) = (0.0, 1.0);
    let (mut f0, mut f1) = (values[0], values[1]);
    let mut t = 0.5;
    for _ in 0..40 {
        t = (t0 * f1 - t1 * f0) / (f1 - f0);
        let f = field.value(ends[0].lerp(ends[1], t));
        if f == 0.0 || (t1 - t0) < 1e-12 {
            break;
        }
        if (f < 0.0) == (f1 < 0.0) {
            (t1, f1) = (t, f);
            f0 *= 0.5;
        } else {
            (t0, f0) = (t1, f1);
            (t1, f1) = (t, f);
        }
        if f.abs() < 1e-13 {
            break;
        }
    }
    // Lattice corners must stay distinct vertices even when the surface passes through one.
    ends[0].lerp(ends[1], t.clamp(1e-6, 1.0 - 1e-6))
}
