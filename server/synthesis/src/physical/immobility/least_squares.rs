//! Non-negative least squares after Lawson and Hanson (1974, chapter 23), one column at a time.
//!
//! The columns are not a matrix that is there from the start: whoever asks looks at the residual, finds the column of a
//! cone that goes with it best, and adds it. What is kept is the passive set, the columns with a positive weight; the
//! weights always solve the least-squares problem over it.

use super::contact_model::UnitPush;

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

/// Numbers that are worked on side by side; what there are fewer of is filled up with zeros.
type Four = [f64; 4];

/// The smallest |A x − b| over x ≥ 0, for the columns added so far, which have at most four times `FOURS` rows.
#[derive(Clone, Debug)]
pub(super) struct ConicLeastSquares<const FOURS: usize> {
    rows: usize,
    /// b.
    target: [Four; FOURS],
    /// A by columns.
    entries: Vec<[Four; FOURS]>,
    columns: Vec<Column>,
    /// x.
    weights: Vec<f64>,
    /// b − A x.
    residual: [Four; FOURS],
    factor: Factor<FOURS>,
    /// The solution without regard to signs.
    free: [Four; FOURS],
}

/// The Cholesky factor L of `AᵀA`, and what is solved with it. Each number that is found is at once taken off all that wait
/// for it: to sum up what one number waits for would take as long for each as for all.
#[derive(Clone, Debug)]
struct Factor<const FOURS: usize> {
    /// How many rows of it belong to the columns that are there now.
    count: usize,
    /// L by rows, without its diagonal: zeros from there on.
    by_rows: Vec<[Four; FOURS]>,
    /// L by columns; above the diagonal, anything.
    by_columns: Vec<[Four; FOURS]>,
    /// One over its diagonal: a division takes as long as multiplying four columns.
    inverse_diagonal: Vec<f64>,
    /// The solution of L y = Aᵀb.
    forward: [Four; FOURS],
}

impl<const FOURS: usize> Default for ConicLeastSquares<FOURS> {
    fn default() -> Self {
        let none = [[0.0; 4]; FOURS];
        Self {
            rows: 0,
            target: none,
            entries: Vec::new(),
            columns: Vec::new(),
            weights: Vec::new(),
            residual: none,
            factor: Factor {
                count: 0,
                by_rows: Vec::new(),
                by_columns: Vec::new(),
                inverse_diagonal: Vec::new(),
                forward: none,
            },
            free: none,
        }
    }
}

impl<const FOURS: usize> ConicLeastSquares<FOURS> {
    /// Starts anew, without columns.
    ///
    /// # Panics
    /// There are more rows than there is room for.
    pub(super) fn reset(&mut self, target: &[f64]) {
        self.rows = target.len();
        self.target = filled_up(target);
        self.residual = self.target;
        self.entries.clear();
        self.columns.clear();
        self.weights.clear();
        self.factor.count = 0;
        // There are never more columns than rows, as columns are independent.
        self.entries.reserve(self.rows);
        self.columns.reserve(self.rows);
        self.weights.reserve(self.rows);
        self.factor.reserve(self.rows);
    }

    /// b − A x.
    pub(super) fn residual(&self) -> &[f64] {
        &self.residual.as_flattened()[..self.rows]
    }

    /// The passive columns and their weights.
    pub(super) fn weighted_columns(&self) -> impl Iterator<Item = (f64, &Column)> {
        self.weights.iter().copied().zip(&self.columns)
    }

    /// Adds a column and solves again. False, and nothing is changed, if it depends on those that are there or would
    /// get no positive weight.
    pub(super) fn add(&mut self, entries: &[f64], column: Column) -> bool {
        debug_assert_eq!(entries.len(), self.rows, "a column has other rows");
        let newest = self.columns.len();
        if newest == self.rows {
            return false;
        }
        self.entries.push(filled_up(entries));
        self.columns.push(column);
        self.weights.push(0.0);
        if !self.solve_freely() || self.free()[newest] <= 0.0 {
            self.remove(newest);
            return false;
        }
        // Lawson and Hanson's inner loop: as far toward the free solution as no weight becomes negative; the columns
        // whose weight vanishes leave the passive set.
        while self.free().iter().any(|&weight| weight <= 0.0) {
            let mut step = 1.0_f64;
            let mut blocking = 0;
            for (k, (&weight, &free)) in self.weights.iter().zip(self.free()).enumerate() {
                if free <= 0.0 && weight < step * (weight - free) {
                    step = weight / (weight - free);
                    blocking = k;
                }
            }
            for (weight, &free) in self.weights.iter_mut().zip(self.free.as_flattened()) {
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
                self.free = filled_up(&self.weights);
            }
        }
        let free = self.free.as_flattened();
        for (weight, &free) in self.weights.iter_mut().zip(free) {
            *weight = free;
        }
        self.update_residual();
        true
    }

    /// The free solution's weights of the columns that are there.
    fn free(&self) -> &[f64] {
        &self.free.as_flattened()[..self.columns.len()]
    }

    fn remove(&mut self, column: usize) {
        self.factor.count = self.factor.count.min(column);
        self.columns.swap_remove(column);
        self.weights.swap_remove(column);
        self.entries.swap_remove(column);
    }

    fn update_residual(&mut self) {
        let mut residual = self.target;
        for (column, &weight) in self.entries.iter().zip(&self.weights) {
            subtract(&mut residual, weight, column);
        }
        self.residual = residual;
    }

    /// Solves `AᵀA x = Aᵀb` by Cholesky into `free`, from the first row on that has changed. False if columns are
    /// dependent.
    fn solve_freely(&mut self) -> bool {
        while self.factor.count < self.columns.len() {
            if !self.factor.add_row(&self.entries, &self.target) {
                return false;
            }
        }
        self.free = self.factor.solution();
        true
    }
}

impl<const FOURS: usize> Factor<FOURS> {
    /// Makes room for so many rows.
    fn reserve(&mut self, rows: usize) {
        let more = rows.saturating_sub(self.by_rows.len());
        self.by_rows.reserve(more);
        self.by_columns.reserve(more);
        self.inverse_diagonal.reserve(more);
    }

    /// Factors the next row of `AᵀA`. False if its column depends on those before it.
    fn add_row(&mut self, columns: &[[Four; FOURS]], target: &[Four; FOURS]) -> bool {
        let i = self.count;
        // What was there was of a column that has left.
        self.by_rows.truncate(i);
        self.by_columns.truncate(i);
        self.inverse_diagonal.truncate(i);

        let (before, newest) = (&columns[..i], &columns[i]);
        let mut waiting = [[0.0; 4]; FOURS];
        for (product, column) in waiting.as_flattened_mut().iter_mut().zip(before) {
            *product = dot(newest, column);
        }
        let square = dot(newest, newest);
        let mut rest = square;
        let mut answer = dot(newest, target);
        let mut row = [[0.0; 4]; FOURS];
        let found = row.as_flattened_mut().iter_mut();
        let columns = self.by_columns.iter_mut().zip(&self.inverse_diagonal);
        for (j, (value, (of_j, inverse))) in found.zip(columns).enumerate() {
            *value = waiting.as_flattened()[j] * inverse;
            rest -= *value * *value;
            answer -= *value * self.forward.as_flattened()[j];
            subtract(&mut waiting, *value, of_j);
            of_j.as_flattened_mut()[i] = *value;
        }
        if rest <= DEPENDENT_PIVOT * square {
            return false;
        }
        let inverse = rest.sqrt().recip();
        self.by_rows.push(row);
        self.by_columns.push([[0.0; 4]; FOURS]);
        self.inverse_diagonal.push(inverse);
        self.forward.as_flattened_mut()[i] = answer * inverse;
        self.count = i + 1;
        true
    }

    /// Solves Lᵀ x = y.
    fn solution(&self) -> [Four; FOURS] {
        let mut waiting = self.forward;
        let mut solution = [[0.0; 4]; FOURS];
        let places = solution.as_flattened_mut()[..self.count].iter_mut().enumerate();
        let rows = self.by_rows.iter().zip(&self.inverse_diagonal);
        for ((i, place), (row, inverse)) in places.zip(rows).rev() {
            *place = waiting.as_flattened()[i] * inverse;
            subtract(&mut waiting, *place, row);
        }
        solution
    }
}

/// Numbers with zeros behind them.
fn filled_up<const FOURS: usize>(numbers: &[f64]) -> [Four; FOURS] {
    let mut filled = [[0.0; 4]; FOURS];
    filled.as_flattened_mut()[..numbers.len()].copy_from_slice(numbers);
    filled
}

/// Takes a multiple of some numbers off others.
#[inline]
fn subtract<const FOURS: usize>(from: &mut [Four; FOURS], factor: f64, numbers: &[Four; FOURS]) {
    for i in 0..FOURS {
        for k in 0..4 {
            from[i][k] -= factor * numbers[i][k];
        }
    }
}

/// Product of two columns.
#[inline]
fn dot<const FOURS: usize>(a: &[Four; FOURS], b: &[Four; FOURS]) -> f64 {
    let mut sums = [0.0; 4];
    for i in 0..FOURS {
        for k in 0..4 {
            sums[k] += a[i][k] * b[i][k];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::{super::contact_model::dot, *};

    const ROWS: usize = 6;

    /// The residual's length when the best of some columns is added again and again.
    fn solved(columns: &[[f64; ROWS]], target: &[f64; ROWS], solver: &mut ConicLeastSquares<2>) -> f64 {
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
        let mut solver = ConicLeastSquares::<2>::default();
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
