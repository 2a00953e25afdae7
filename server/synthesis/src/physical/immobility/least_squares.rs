//! Non-negative least squares after Lawson and Hanson (1974, chapter 23), one column at a time.
//!
//! The columns are not a matrix that is there from the start: whoever asks looks at the residual, finds the column of a
//! cone that goes with it best, and adds it. What is kept is the passive set, the columns with a positive weight; the
//! weights always solve the least-squares problem over it.

use super::contact_model::{UnitPush, dot};

/// A pivot of the Cholesky factorisation below this share of its diagonal means that a column depends on the others.
const DEPENDENT_PIVOT: f64 = 1e-11;

/// What a column stands for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Column {
    /// A push of a contact.
    Push {
        /// Index of the contact.
        contact: usize,
        /// Force and torsion per unit of weight.
        push: UnitPush,
    },
    /// What is left below an upper limit.
    Slack,
}

/// The smallest |A x − b| over x ≥ 0, for the columns added so far.
#[derive(Clone, Debug, Default)]
pub(super) struct ConicLeastSquares {
    /// b.
    target: Vec<f64>,
    /// A by columns.
    entries: Vec<f64>,
    columns: Vec<Column>,
    /// x.
    weights: Vec<f64>,
    /// b − A x.
    residual: Vec<f64>,
    /// The Cholesky factor L of `AᵀA`, the rows of its lower triangle.
    factor: Vec<f64>,
    /// One over its diagonal: a division takes as long as multiplying four columns.
    inverse_diagonal: Vec<f64>,
    /// How many rows of it belong to the columns that are there now.
    factored: usize,
    /// The solution of L y = Aᵀb.
    forward: Vec<f64>,
    /// The solution without regard to signs.
    free: Vec<f64>,
}

impl ConicLeastSquares {
    /// Starts anew, without columns.
    pub(super) fn reset(&mut self, target: &[f64]) {
        self.target.clear();
        self.target.extend_from_slice(target);
        self.residual.clear();
        self.residual.extend_from_slice(target);
        self.entries.clear();
        self.columns.clear();
        self.weights.clear();
        self.factored = 0;
        // There are hardly more columns than rows, as columns are independent: room for them at once.
        let most = target.len();
        self.entries.reserve(most * most);
        self.columns.reserve(most);
        self.weights.reserve(most);
        self.factor.reserve(first_of_row(most));
    }

    /// b − A x.
    pub(super) fn residual(&self) -> &[f64] {
        &self.residual
    }

    /// The passive columns and their weights.
    pub(super) fn weighted_columns(&self) -> impl Iterator<Item = (f64, &Column)> {
        self.weights.iter().copied().zip(&self.columns)
    }

    /// Adds a column and solves again. False, and nothing is changed, if it depends on those that are there or would
    /// get no positive weight.
    pub(super) fn add(&mut self, entries: &[f64], column: Column) -> bool {
        debug_assert_eq!(entries.len(), self.target.len(), "a column has other rows");
        self.entries.extend_from_slice(entries);
        self.columns.push(column);
        self.weights.push(0.0);
        let newest = self.columns.len() - 1;
        if !self.solve_freely() || self.free[newest] <= 0.0 {
            self.remove(newest);
            return false;
        }
        // Lawson and Hanson's inner loop: as far toward the free solution as no weight becomes negative; the columns
        // whose weight vanishes leave the passive set.
        while self.free.iter().any(|&weight| weight <= 0.0) {
            let mut step = 1.0_f64;
            let mut blocking = 0;
            for (k, (&weight, &free)) in self.weights.iter().zip(&self.free).enumerate() {
                if free <= 0.0 && weight < step * (weight - free) {
                    step = weight / (weight - free);
                    blocking = k;
                }
            }
            for (weight, &free) in self.weights.iter_mut().zip(&self.free) {
                *weight += step * (free - *weight);
            }
            self.weights[blocking] = 0.0;
            for k in (0..self.weights.len()).rev() {
                if self.weights[k] <= 0.0 {
                    self.remove(k);
                }
            }
            if !self.solve_freely() {
                // Columns of an independent set are independent; only rounding comes here. The weights stand.
                self.free.clone_from(&self.weights);
            }
        }
        self.weights.clone_from(&self.free);
        self.update_residual();
        true
    }

    fn remove(&mut self, column: usize) {
        let rows = self.target.len();
        let last = self.columns.len() - 1;
        self.factored = self.factored.min(column);
        self.columns.swap_remove(column);
        self.weights.swap_remove(column);
        self.entries
            .copy_within(last * rows..(last + 1) * rows, column * rows);
        self.entries.truncate(last * rows);
    }

    fn update_residual(&mut self) {
        self.residual.copy_from_slice(&self.target);
        for (column, &weight) in self.entries.chunks_exact(self.target.len()).zip(&self.weights) {
            for (residual, entry) in self.residual.iter_mut().zip(column) {
                *residual -= weight * entry;
            }
        }
    }

    /// Solves `AᵀA x = Aᵀb` by Cholesky into `free`, from the first row on that has changed. False if columns are
    /// dependent.
    fn solve_freely(&mut self) -> bool {
        let count = self.columns.len();
        let rows = self.target.len();
        self.factor.resize(first_of_row(count), 0.0);
        self.forward.resize(count, 0.0);
        self.inverse_diagonal.resize(count, 0.0);
        for i in self.factored..count {
            let column = &self.entries[i * rows..(i + 1) * rows];
            let (before, of_i) = self.factor.split_at_mut(first_of_row(i));
            for j in 0..i {
                let of_j = &before[first_of_row(j)..=first_of_row(j) + j];
                let product = dot(column, &self.entries[j * rows..(j + 1) * rows]);
                of_i[j] = (product - dot(&of_i[..j], &of_j[..j])) * self.inverse_diagonal[j];
            }
            let product = dot(column, column);
            let rest = product - dot(&of_i[..i], &of_i[..i]);
            if rest <= DEPENDENT_PIVOT * product {
                return false;
            }
            of_i[i] = rest.sqrt();
            let inverse = of_i[i].recip();
            self.inverse_diagonal[i] = inverse;
            self.forward[i] = (dot(column, &self.target) - dot(&of_i[..i], &self.forward[..i])) * inverse;
            self.factored = i + 1;
        }
        self.free.clone_from(&self.forward);
        for i in (0..count).rev() {
            let row = &self.factor[first_of_row(i)..=first_of_row(i) + i];
            let value = self.free[i] * self.inverse_diagonal[i];
            self.free[i] = value;
            for (above, entry) in self.free[..i].iter_mut().zip(row) {
                *above -= value * entry;
            }
        }
        true
    }
}

/// Where row i of a lower triangle starts.
fn first_of_row(i: usize) -> usize {
    i * (i + 1) / 2
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    const ROWS: usize = 6;

    /// The residual's length when the best of some columns is added again and again.
    fn solved(columns: &[[f64; ROWS]], target: &[f64; ROWS], solver: &mut ConicLeastSquares) -> f64 {
        solver.reset(target);
        loop {
            let gain = |column: &[f64; ROWS]| dot(column, solver.residual());
            let best = columns
                .iter()
                .max_by(|a, b| gain(a).total_cmp(&gain(b)))
                .copied()
                .unwrap_or_default();
            if gain(&best) < 1e-10 || !solver.add(&best, Column::Slack) {
                break;
            }
        }
        assert!(solver.weighted_columns().all(|(weight, _)| weight > 0.0));
        dot(solver.residual(), solver.residual()).sqrt()
    }

    /// The least residual over all sets of columns whose own solution has no negative weight.
    fn least_residual(columns: &[[f64; ROWS]], target: &[f64; ROWS]) -> f64 {
        let mut least = dot(target, target).sqrt();
        for set in 1_u32..1 << columns.len() {
            let chosen: Vec<&[f64; ROWS]> = (0..columns.len())
                .filter(|k| set >> k & 1 == 1)
                .map(|k| &columns[k])
                .collect();
            let Some(weights) = unconstrained(&chosen, target) else {
                continue;
            };
            if weights.iter().all(|&weight| weight >= 0.0) {
                let mut left = *target;
                for (weight, column) in weights.iter().zip(&chosen) {
                    for (left, entry) in left.iter_mut().zip(*column) {
                        *left -= weight * entry;
                    }
                }
                least = least.min(dot(&left, &left).sqrt());
            }
        }
        least
    }

    /// Least squares by Gauss and Jordan on the normal equations with pivots; `None` for dependent columns.
    fn unconstrained(columns: &[&[f64; ROWS]], target: &[f64; ROWS]) -> Option<Vec<f64>> {
        let count = columns.len();
        let mut rows: Vec<Vec<f64>> = columns
            .iter()
            .map(|a| {
                let products = columns.iter().map(|b| dot(*a, *b));
                products.chain([dot(*a, target)]).collect()
            })
            .collect();
        for column in 0..count {
            let pivot =
                (column..count).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
            rows.swap(column, pivot);
            if rows[column][column].abs() < 1e-9 {
                return None;
            }
            let of_pivot = rows[column].clone();
            for (index, row) in rows.iter_mut().enumerate() {
                if index != column {
                    let factor = row[column] / of_pivot[column];
                    for (x, p) in row.iter_mut().zip(&of_pivot) {
                        *x -= factor * p;
                    }
                }
            }
        }
        Some((0..count).map(|k| rows[k][count] / rows[k][k]).collect())
    }

    #[test]
    fn agrees_with_all_sets_of_columns() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
        let mut solver = ConicLeastSquares::default();
        let (mut exact, mut inexact) = (0, 0);
        for case in 0..2000 {
            let mut vector =
                || -> [f64; ROWS] { std::array::from_fn(|_| random.random::<f64>() * 2.0 - 1.0) };
            let mut columns: Vec<_> = (0..=case % 9).map(|_| vector()).collect();
            let target = vector();
            if case % 4 == 0 {
                // Columns that depend on others.
                columns.push(columns[0].map(|x| 2.0 * x));
                columns.push(std::array::from_fn(|k| {
                    columns[0][k] + columns[columns.len() / 2][k]
                }));
            }
            let found = solved(&columns, &target, &mut solver);
            let least = least_residual(&columns, &target);
            assert!((found - least).abs() < 1e-7, "case {case}: {found}, not {least}");
            if least < 1e-7 { exact += 1 } else { inexact += 1 }
        }
        assert!(exact > 50 && inexact > 50, "{exact} exact, {inexact} not");
    }
}
