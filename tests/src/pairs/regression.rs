//! Weights that rank pairs right: logistic regression on the differences of terms, without intercept, with weights that are
//! not negative and stay near given ones.

/// Steps of the descent; more change no weight by a thousandth.
const STEPS: usize = 20_000;

/// What a fit knows and assumes.
#[derive(Clone, Copy, Debug)]
pub struct Regression<'a, const N: usize> {
    /// Of each pair, how much larger each term of the preferred grasp is.
    pub differences: &'a [[f64; N]],
    /// Of each pair, how much it counts.
    pub importances: &'a [f64],
    /// The weights to stay near.
    pub near: [f64; N],
    /// Which of them may change.
    pub is_free: [bool; N],
    /// What a squared distance from them costs, next to the mean loss of the pairs.
    pub ridge: f64,
}

impl<const N: usize> Regression<'_, N> {
    /// The weights w ≥ 0 that minimize the mean of ln(1 + exp(−w·d)) over the pairs' differences d plus half the ridge times
    /// the squared distance from the given weights, by projected gradient descent.
    pub fn weights(&self) -> [f64; N] {
        let total: f64 = self.importances.iter().sum();
        let squares = self
            .differences
            .iter()
            .zip(self.importances)
            .map(|(difference, importance)| importance * dot(difference, difference));
        // The logistic function is nowhere steeper than a quarter: a bound of the loss' curvature.
        let curvature = self.ridge + 0.25 * squares.sum::<f64>() / total.max(f64::MIN_POSITIVE);
        let mut weights = self.near;
        for _ in 0..STEPS {
            let gradient = self.gradient(&weights);
            for k in (0..N).filter(|&k| self.is_free[k]) {
                weights[k] = (weights[k] - gradient[k] / curvature).max(0.0);
            }
        }
        weights
    }

    /// The slope of what is minimized.
    fn gradient(&self, weights: &[f64; N]) -> [f64; N] {
        let total: f64 = self.importances.iter().sum();
        let mut gradient: [f64; N] = std::array::from_fn(|k| self.ridge * (weights[k] - self.near[k]));
        for (difference, importance) in self.differences.iter().zip(self.importances) {
            let doubt = 1.0 / (1.0 + dot(weights, difference).exp());
            for (slope, along) in gradient.iter_mut().zip(difference) {
                *slope -= importance / total * doubt * along;
            }
        }
        gradient
    }
}

/// The share of pairs that weights rank right.
pub fn share_right<const N: usize>(weights: &[f64; N], differences: &[[f64; N]]) -> f64 {
    let right = differences
        .iter()
        .filter(|difference| dot(weights, difference) > 0.0);
    right.count() as f64 / differences.len().max(1) as f64
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pair_settles_where_its_doubt_balances_the_ridge() {
        let fit = Regression {
            differences: &[[0.8]],
            importances: &[1.0],
            near: [1.5],
            is_free: [true],
            ridge: 0.1,
        };
        // ridge (w − near) = d / (1 + exp(w d)), by bisection.
        let (mut low, mut high) = (1.5_f64, 20.0);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if 0.1 * (middle - 1.5) < 0.8 / (1.0 + (0.8 * middle).exp()) {
                low = middle;
            } else {
                high = middle;
            }
        }
        let [weight] = fit.weights();
        assert!((weight - low).abs() < 1e-6, "{weight}, not {low}");
    }

    #[test]
    fn two_weights_are_the_best_of_a_grid() {
        let differences = [[0.5, -0.2], [-0.3, 0.4], [0.1, 0.6], [-0.4, -0.1]];
        let importances = [1.0, 2.0, 1.0, 0.5];
        let near = [1.0, 0.3];
        let fit = Regression {
            differences: &differences,
            importances: &importances,
            near,
            is_free: [true; 2],
            ridge: 0.05,
        };
        let loss = |weights: &[f64; 2]| {
            let of_pairs = differences.iter().zip(importances);
            let fits: f64 = of_pairs
                .map(|(difference, importance)| importance * (-dot(weights, difference)).exp().ln_1p())
                .sum();
            let away = [weights[0] - near[0], weights[1] - near[1]];
            fits / importances.iter().sum::<f64>() + 0.5 * 0.05 * dot(&away, &away)
        };
        let mut best = ([0.0; 2], f64::MAX);
        for i in 0..=600 {
            for j in 0..=600 {
                let weights = [f64::from(i) * 0.01, f64::from(j) * 0.01];
                let value = loss(&weights);
                if value < best.1 {
                    best = (weights, value);
                }
            }
        }
        let found = fit.weights();
        assert!(loss(&found) <= best.1, "{found:?}, not {:?}", best.0);
        assert!((found[0] - best.0[0]).abs() < 0.02 && (found[1] - best.0[1]).abs() < 0.02);
    }

    #[test]
    fn weights_that_mislead_end_at_zero_and_unused_ones_stay() {
        let fit = Regression {
            differences: &[[-1.0, 0.5, 0.0]; 3],
            importances: &[1.0; 3],
            near: [0.5, 1.0, 2.0],
            is_free: [true; 3],
            ridge: 0.01,
        };
        let [misleading, useful, unused] = fit.weights();
        assert_eq!(misleading, 0.0);
        assert!(useful > 1.0);
        assert!((unused - 2.0).abs() < 1e-9);
        let held = Regression {
            is_free: [false, true, true],
            ..fit
        };
        let [misleading, more_useful, _] = held.weights();
        assert_eq!(misleading, 0.5);
        assert!(more_useful > useful);
        assert_eq!(share_right(&[0.0, 1.0, 0.0], fit.differences), 1.0);
        assert_eq!(share_right(&[1.0, 1.0, 0.0], fit.differences), 0.0);
    }
}
