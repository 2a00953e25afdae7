//! The directions in which points spread most and least.

use glam::{DMat3, DVec3};

/// The principal axes of points, right-handed: eigenvectors of their covariance by Jacobi rotations (G. H. Golub, C.
/// F. Van Loan: Matrix Computations, 8.5).
pub(crate) fn principal_axes(points: &[DVec3]) -> DMat3 {
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut covariance = DMat3::ZERO;
    for &point in points {
        let offset = point - mean;
        covariance += DMat3::from_cols(offset * offset.x, offset * offset.y, offset * offset.z);
    }
    let mut axes = DMat3::IDENTITY;
    // Convergence is quadratic: five sweeps reach machine precision.
    for _ in 0..5 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off_diagonal = covariance.col(q)[p];
            if off_diagonal == 0.0 {
                continue;
            }
            let angle = 0.5 * (2.0 * off_diagonal).atan2(covariance.col(q)[q] - covariance.col(p)[p]);
            let (sin, cos) = angle.sin_cos();
            let mut columns = [DVec3::X, DVec3::Y, DVec3::Z];
            columns[p] = DVec3::ZERO.with(p, cos).with(q, -sin);
            columns[q] = DVec3::ZERO.with(p, sin).with(q, cos);
            let rotation = DMat3::from_cols(columns[0], columns[1], columns[2]);
            covariance = rotation.transpose() * covariance * rotation;
            axes *= rotation;
        }
    }
    axes
}

/// Replaces one coordinate of a vector, by index.
trait With {
    fn with(self, axis: usize, value: f64) -> Self;
}

impl With for DVec3 {
    fn with(mut self, axis: usize, value: f64) -> Self {
        self[axis] = value;
        self
    }
}
