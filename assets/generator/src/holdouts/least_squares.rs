//! Levenberg–Marquardt for a few dozen bounded parameters (Nocedal and Wright, Numerical Optimization, 10.3), with
//! forward differences: the same input gives the same bits.

/// Step of the forward differences, in units of the parameters: small compared with the 0.1 rad over which residuals
/// bend, large compared with the rounding of f32 geometry.
const DIFFERENCE: f64 = 1e-3;

/// The descent ends once an iteration lowers the cost by less than this share.
const RELATIVE_PROGRESS: f64 = 1e-6;

/// Where a descent ended.
#[derive(Clone, Debug)]
pub(crate) struct Minimum {
    /// The parameters.
    pub(crate) parameters: Vec<f64>,
    /// Half the sum of squared residuals there.
    pub(crate) cost: f64,
}

/// Descends from `start` within `bounds` (one closed range per parameter) for at most `iterations` steps.
/// `residuals` must always return the same number of values.
pub(crate) fn minimise(
    start: &[f64],
    bounds: &[(f64, f64)],
    iterations: usize,
    residuals: &dyn Fn(&[f64]) -> Vec<f64>,
) -> Minimum {
    let clamped = |parameters: &[f64]| -> Vec<f64> {
        parameters
            .iter()
            .zip(bounds)
            .map(|(&p, &(low, high))| p.clamp(low, high))
            .collect()
    };
    let mut parameters = clamped(start);
    let mut values = residuals(&parameters);
    let mut cost = half_square(&values);
    let mut damping = 1e-2;
    for _ in 0..iterations {
        let jacobian = jacobian(&parameters, bounds, &values, residuals);
        let (normal, gradient) = normal_equations(&jacobian, &values);
        let before = cost;
        // Raise the damping until a step descends.
        for _ in 0..12 {
            let Some(step) = solve_damped(&normal, &gradient, damping) else {
                damping *= 4.0;
                continue;
            };
            let moved: Vec<f64> = parameters.iter().zip(&step).map(|(p, s)| p - s).collect();
            let candidate = clamped(&moved);
            let candidate_values = residuals(&candidate);
            let candidate_cost = half_square(&candidate_values);
            if candidate_cost < cost {
                (parameters, values, cost) = (candidate, candidate_values, candidate_cost);
                damping = (damping * 0.3).max(1e-9);
                break;
            }
            damping *= 4.0;
        }
        if before - cost <= RELATIVE_PROGRESS * before {
            break;
        }
    }
    Minimum { parameters, cost }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn half_square(values: &[f64]) -> f64 {
    0.5 * dot(values, values)
}

/// One column per parameter.
fn jacobian(
    parameters: &[f64],
    bounds: &[(f64, f64)],
    values: &[f64],
    residuals: &dyn Fn(&[f64]) -> Vec<f64>,
) -> Vec<Vec<f64>> {
    (0..parameters.len())
        .map(|i| {
            let mut moved = parameters.to_vec();
            // Into the range, so that a parameter on its bound still has a slope.
            let step = if parameters[i] + DIFFERENCE <= bounds[i].1 {
                DIFFERENCE
            } else {
                -DIFFERENCE
            };
            moved[i] += step;
            residuals(&moved)
                .iter()
                .zip(values)
                .map(|(after, before)| (after - before) / step)
                .collect()
        })
        .collect()
}

/// J^T J and J^T r.
fn normal_equations(columns: &[Vec<f64>], values: &[f64]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let normal = columns
        .iter()
        .map(|a| columns.iter().map(|b| dot(a, b)).collect())
        .collect();
    let gradient = columns.iter().map(|a| dot(a, values)).collect();
    (normal, gradient)
}

/// Solves (N + damping (diag N + 1)) x = g by Cholesky; none if it is not positive definite.
fn solve_damped(normal: &[Vec<f64>], gradient: &[f64], damping: f64) -> Option<Vec<f64>> {
    let n = gradient.len();
    let mut lower = vec![vec![0.0; n]; n];
    for row in 0..n {
        for column in 0..=row {
            let mut sum = normal[row][column];
            if row == column {
                sum += damping * (normal[row][row] + 1.0);
            }
            sum -= dot(&lower[row][..column], &lower[column][..column]);
            if row == column {
                // NaN is not positive either.
                if sum.is_nan() || sum <= 0.0 {
                    return None;
                }
                lower[row][row] = sum.sqrt();
            } else {
                lower[row][column] = sum / lower[column][column];
            }
        }
    }
    let mut x = gradient.to_vec();
    for row in 0..n {
        for k in 0..row {
            x[row] -= lower[row][k] * x[k];
        }
        x[row] /= lower[row][row];
    }
    for row in (0..n).rev() {
        for k in row + 1..n {
            x[row] -= lower[k][row] * x[k];
        }
        x[row] /= lower[row][row];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::minimise;

    #[test]
    fn finds_the_minimum_of_rosenbrocks_valley() {
        let residuals = |p: &[f64]| vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]];
        let minimum = minimise(&[-1.2, 1.0], &[(-5.0, 5.0); 2], 200, &residuals);
        assert!(minimum.cost < 1e-8, "{minimum:?}");
        assert!((minimum.parameters[0] - 1.0).abs() < 1e-3, "{minimum:?}");
    }

    #[test]
    fn stays_inside_the_bounds() {
        // The free minimum is at (3, -2); the bounds allow only (1, -2).
        let residuals = |p: &[f64]| vec![p[0] - 3.0, p[1] + 2.0];
        let minimum = minimise(&[0.0, 0.0], &[(-1.0, 1.0), (-5.0, 5.0)], 50, &residuals);
        assert!((minimum.parameters[0] - 1.0).abs() < 1e-9, "{minimum:?}");
        assert!((minimum.parameters[1] + 2.0).abs() < 1e-4, "{minimum:?}");
    }
}
