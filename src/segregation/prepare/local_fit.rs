//! Local quadratic height fits over neighbours: the one tool behind outliers, noise level and smoothing.
//!
//! In: a point, its neighbours and their weights. Out: a height function `h(u, v)` of degree two in the frame of the
//! weighted principal axes with the point at the origin, or `None` where the neighbours do not determine one (fewer than
//! six, or all on a line).

use super::knn::KnnLists;
use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;

/// Terms of a quadratic in two variables.
pub const TERMS: usize = 6;

/// A quadratic height field over the tangent plane of a point.
#[derive(Clone, Copy, Debug)]
pub struct HeightFit {
    /// Unit axes: two in the plane, then the normal.
    pub frame: DMat3,
    /// The point the frame is at.
    pub origin: DVec3,
    /// Length that in-plane coordinates are divided by.
    scale: f64,
    /// Coefficients of `1, u, v, u^2, uv, v^2` in scaled coordinates; heights in mm.
    coefficients: [f64; TERMS],
}

impl HeightFit {
    /// Height of the fitted surface over the origin, mm.
    pub fn height_at_origin(&self) -> f64 {
        self.coefficients[0]
    }

    /// Signed height of a point above the fitted surface, mm.
    pub fn residual(&self, point: DVec3) -> f64 {
        let local = self.frame.transpose() * (point - self.origin);
        let t = terms(local.x / self.scale, local.y / self.scale);
        local.z - t.iter().zip(&self.coefficients).map(|(a, b)| a * b).sum::<f64>()
    }

    /// Squared in-plane distance of a point from the origin, mm^2.
    pub fn in_plane2(&self, point: DVec3) -> f64 {
        let d = point - self.origin;
        let h = d.dot(self.frame.z_axis);
        (d.length_squared() - h * h).max(0.0)
    }
}

#[inline]
fn terms(u: f64, v: f64) -> [f64; TERMS] {
    [1.0, u, v, u * u, u * v, v * v]
}

/// Axes of the weighted second moments of points about their weighted mean, smallest moment last.
pub fn principal_frame(points: impl Iterator<Item = DVec3> + Clone, weights: &[f64]) -> Option<DMat3> {
    let total: f64 = weights.iter().sum();
    if total <= 0.0 || !total.is_finite() {
        return None;
    }
    let mean = points.clone().zip(weights).map(|(p, w)| p * *w).sum::<DVec3>() / total;
    let mut m = [0.0f64; 6];
    for (p, w) in points.zip(weights) {
        let d = p - mean;
        m[0] += w * d.x * d.x;
        m[1] += w * d.x * d.y;
        m[2] += w * d.x * d.z;
        m[3] += w * d.y * d.y;
        m[4] += w * d.y * d.z;
        m[5] += w * d.z * d.z;
    }
    if m.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(Matrix3::new(m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5]));
    let values = eigen.eigenvalues;
    let least = (0..3).min_by(|&a, &b| values[a].total_cmp(&values[b]))?;
    let column = |k: usize| {
        let c = eigen.eigenvectors.column(k);
        DVec3::new(c[0], c[1], c[2])
    };
    let normal = column(least).normalize_or_zero();
    if normal == DVec3::ZERO {
        return None;
    }
    let (u, v) = normal.any_orthonormal_pair();
    Some(DMat3::from_cols(u, v, normal))
}

/// Fits heights in a given frame; `None` when the normal equations are singular. `O(neighbours)`.
pub fn fit_heights(
    origin: DVec3,
    frame: DMat3,
    neighbours: impl Iterator<Item = DVec3>,
    weights: &[f64],
    scale: f64,
) -> Option<HeightFit> {
    let mut a = [[0.0f64; TERMS]; TERMS];
    let mut b = [0.0f64; TERMS];
    let to_local = frame.transpose();
    for (p, &w) in neighbours.zip(weights) {
        let local = to_local * (p - origin);
        let t = terms(local.x / scale, local.y / scale);
        for i in 0..TERMS {
            let wt = w * t[i];
            for j in i..TERMS {
                a[i][j] += wt * t[j];
            }
            b[i] += wt * local.z;
        }
    }
    let coefficients = solve_spd(a, b)?;
    Some(HeightFit {
        frame,
        origin,
        scale,
        coefficients,
    })
}

/// Cholesky solution of a symmetric positive definite system given by its upper triangle.
fn solve_spd(mut a: [[f64; TERMS]; TERMS], mut b: [f64; TERMS]) -> Option<[f64; TERMS]> {
    let largest = (0..TERMS).map(|i| a[i][i]).fold(0.0, f64::max);
    for i in 0..TERMS {
        for k in 0..i {
            for j in i..TERMS {
                a[i][j] -= a[k][i] * a[k][j];
            }
        }
        if a[i][i] <= 1e-12 * largest {
            return None;
        }
        let root = a[i][i].sqrt();
        for j in i..TERMS {
            a[i][j] /= root;
        }
    }
    for i in 0..TERMS {
        for k in 0..i {
            b[i] -= a[k][i] * b[k];
        }
        b[i] /= a[i][i];
    }
    for i in (0..TERMS).rev() {
        for k in i + 1..TERMS {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    b.iter().all(|x| x.is_finite()).then_some(b)
}

/// The unweighted fit to the first `k` members of a point's list.
pub fn plain_fit(points: &[DVec3], list: &[u32], origin: DVec3) -> Option<HeightFit> {
    let weights = [1.0f64; MOST];
    let weights = &weights[..list.len().min(MOST)];
    let near = list[..weights.len()].iter().map(|&j| points[j as usize]);
    let frame = principal_frame(near.clone(), weights)?;
    let reach = near
        .clone()
        .map(|p| p.distance_squared(origin))
        .fold(0.0, f64::max)
        .sqrt();
    if reach <= 0.0 {
        return None;
    }
    fit_heights(origin, frame, near, weights, reach)
}

/// Longest list any fit uses.
pub const MOST: usize = 64;

/// Local spacing of every point: in a plane of density `rho` the mean squared distance of the `k` nearest is
/// `k / (2 pi rho)`, so `1 / sqrt(rho) = sqrt(2 pi m2 / k)`. In-plane distances, so that noise does not widen it. mm.
pub fn spacings(points: &[DVec3], lists: &KnnLists, k: usize) -> Vec<f64> {
    (0..points.len())
        .into_par_iter()
        .map(|i| {
            let list = lists.first(i, k);
            spacing(points, list, i)
        })
        .collect()
}

fn spacing(points: &[DVec3], list: &[u32], i: usize) -> f64 {
    let p = points[i];
    let weights = [1.0f64; MOST];
    let near = list.iter().map(|&j| points[j as usize]);
    let normal =
        principal_frame(near.clone(), &weights[..list.len().min(MOST)]).map_or(DVec3::ZERO, |f| f.z_axis);
    let sum: f64 = near
        .map(|q| {
            let d = q - p;
            let h = d.dot(normal);
            d.length_squared() - h * h
        })
        .sum();
    let k = list.len().max(1) as f64;
    (2.0 * std::f64::consts::PI * sum / (k * k)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_paraboloid_is_fitted_exactly() {
        let points: Vec<DVec3> = (0..25)
            .map(|i| {
                let (u, v) = (f64::from(i % 5) - 2.0, f64::from(i / 5) - 2.0);
                DVec3::new(u, v, 0.01 * u * u - 0.02 * u * v + 0.03 * v * v)
            })
            .collect();
        let weights = [1.0; 25];
        let fit = fit_heights(
            DVec3::new(0.5, 0.5, 3.0),
            DMat3::IDENTITY,
            points.iter().copied(),
            &weights,
            2.0,
        )
        .expect("25 points in general position");
        for p in &points {
            assert!(fit.residual(*p).abs() < 1e-12);
        }
        assert!((3.0 + fit.height_at_origin() - (0.01 - 0.02 + 0.03) * 0.25).abs() < 1e-12);
    }

    #[test]
    fn points_on_a_line_have_no_fit() {
        let points: Vec<DVec3> = (0..10).map(|i| DVec3::X * f64::from(i)).collect();
        let list: Vec<u32> = (0..10).collect();
        assert!(plain_fit(&points, &list, points[0]).is_none());
    }
}
