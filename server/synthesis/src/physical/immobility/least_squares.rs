//! Non-negative least squares after Lawson and Hanson (1974, chapter 23), one column at a time.
//!
//! The matrix is not known in advance: the caller looks at the residual, finds the column of a cone that best matches
//! it, and adds it. The solver keeps the passive set, the columns with positive weights, and the weights that solve
//! the least-squares problem over it.
//!
//! For the matrix A of passive columns it keeps a matrix T for which A T has orthonormal columns, the directions.
//! Gram-Schmidt orthogonalisation splits a new column into a part along the directions and a new direction. When a
//! column leaves, a Householder reflection concentrates it in one direction, which leaves with it. Either way the
//! solution moves along a single direction, and hardly any number depends on another being computed first.

use super::UnitPush;

/// A column depends on the others if its orthogonal part has less than this share of its squared length.
const DEPENDENT_SHARE: f64 = 1e-11;

/// Below this share, the projection is repeated once against rounding ("twice is enough": Parlett 1980, section 6-9).
const REPEATED_SHARE: f64 = 1e-4;

/// Meaning of a column.
#[derive(Clone, Copy, Debug)]
pub(super) enum Column {
    /// A push of a contact.
    Push {
        /// Index of the contact.
        contact: usize,
        /// Force and torsion per unit of weight.
        push: UnitPush,
    },
    /// The unused part of an upper limit.
    Slack,
}

/// Four numbers processed together; short vectors are padded with zeros.
type Four = [f64; 4];

/// One number per row, or per column: the columns are independent, so there are never more of them than rows.
type Fours<const FOURS: usize> = [Four; FOURS];

/// Minimises |A x − b| over x ≥ 0 for the columns added so far, of at most four times `FOURS` rows.
#[derive(Clone, Debug)]
pub(super) struct ConicLeastSquares<const FOURS: usize> {
    rows: usize,
    /// The passive set.
    columns: Vec<Column>,
    /// As many as columns, in any order.
    directions: Vec<Direction<FOURS>>,
    solution: Solution<FOURS>,
}

/// A combination of the columns with unit length, orthogonal to the other directions.
#[derive(Clone, Copy, Debug)]
struct Direction<const FOURS: usize> {
    /// One number per row: a column of A T.
    unit: Fours<FOURS>,
    /// The share of each column in it: a column of T.
    weights: Fours<FOURS>,
}

/// Weights, and the residual they leave of the target.
#[derive(Clone, Copy, Debug)]
struct Solution<const FOURS: usize> {
    /// x.
    weights: Fours<FOURS>,
    /// b − A x.
    residual: Fours<FOURS>,
}

impl<const FOURS: usize> Default for ConicLeastSquares<FOURS> {
    fn default() -> Self {
        Self {
            rows: 0,
            columns: Vec::new(),
            directions: Vec::new(),
            solution: Solution {
                weights: zeros(),
                residual: zeros(),
            },
        }
    }
}

impl<const FOURS: usize> ConicLeastSquares<FOURS> {
    /// Starts over with a new target and no columns.
    pub(super) fn reset(&mut self, target: &[f64]) {
        self.rows = target.len();
        self.columns.clear();
        self.columns.reserve(self.rows);
        self.directions.clear();
        self.directions.reserve(self.rows);
        self.solution = Solution {
            weights: zeros(),
            residual: padded(target),
        };
    }

    /// b − A x.
    pub(super) fn residual(&self) -> &[f64] {
        &self.solution.residual.as_flattened()[..self.rows]
    }

    /// The passive columns and their weights.
    pub(super) fn weighted_columns(&self) -> impl Iterator<Item = (f64, &Column)> {
        let weights = self.solution.weights.as_flattened();
        weights.iter().copied().zip(&self.columns)
    }

    /// Adds a column and solves again. Returns false and changes nothing if the column depends on the others or would
    /// get no positive weight.
    pub(super) fn add(&mut self, entries: &[f64], column: Column) -> bool {
        debug_assert_eq!(entries.len(), self.rows, "a column needs one entry per row");
        let newest = self.columns.len();
        if newest == self.rows {
            return false;
        }
        let Some(direction) = orthogonal_direction(&self.directions, padded(entries)) else {
            return false;
        };
        // The solution without sign constraints. The residual is orthogonal to all directions but the new one.
        let mut free = self.solution;
        free.step(dot(&direction.unit, &free.residual), &direction);
        if free.weights.as_flattened()[newest] <= 0.0 {
            return false;
        }
        self.columns.push(column);
        self.directions.push(direction);
        // Lawson and Hanson's inner loop: move toward the free solution until a weight would become negative; a
        // column whose weight vanishes leaves the passive set.
        while let Some((vanishing, share)) = self.first_to_vanish(&free) {
            let weights = self.solution.weights.as_flattened_mut().iter_mut();
            for (weight, free) in weights.zip(free.weights.as_flattened()) {
                *weight += share * (free - *weight);
            }
            self.remove(vanishing, &mut free);
        }
        self.solution = free;
        true
    }

    /// The column whose weight vanishes first on the way to another solution, and the share of that way; `None` without one.
    fn first_to_vanish(&self, free: &Solution<FOURS>) -> Option<(usize, f64)> {
        let weights = self.solution.weights.as_flattened().iter();
        let pairs = weights.zip(free.weights.as_flattened());
        let mut first = None;
        for (k, (&weight, &free)) in pairs.take(self.columns.len()).enumerate() {
            if free <= 0.0 {
                let share = if weight > 0.0 {
                    weight / (weight - free)
                } else {
                    0.0
                };
                if first.is_none_or(|(_, least)| share < least) {
                    first = Some((k, share));
                }
            }
        }
        first
    }

    /// Removes a column. `free` is the solution without sign constraints, and is updated.
    fn remove(&mut self, column: usize, free: &mut Solution<FOURS>) {
        let Some((share, leaving)) = self.isolate_direction(column) else {
            return;
        };
        // As far along it as brings the column's weight to zero.
        free.step(-free.weights.as_flattened()[column] / share, &leaving);

        self.columns.swap_remove(column);
        let last = self.columns.len();
        let of_directions = self.directions.iter_mut().map(|direction| &mut direction.weights);
        for weights in of_directions.chain([&mut free.weights, &mut self.solution.weights]) {
            let weights = weights.as_flattened_mut();
            weights[column] = weights[last];
            weights[last] = 0.0;
        }
    }

    /// Reflects the directions so that only one contains a column, and removes it. Returns the column's share and the direction.
    fn isolate_direction(&mut self, column: usize) -> Option<(f64, Direction<FOURS>)> {
        // The Householder reflection without cancellation that moves the column's whole row of T into its last entry.
        let mut normal = zeros::<FOURS>();
        for (place, direction) in normal.as_flattened_mut().iter_mut().zip(&self.directions) {
            *place = direction.weights.as_flattened()[column];
        }
        let length = dot(&normal, &normal).sqrt();
        let last = &mut normal.as_flattened_mut()[self.directions.len().checked_sub(1)?];
        let scale = (length * (length + last.abs())).recip();
        let share = -length.copysign(*last);
        *last -= share;
        let mut sum = Direction {
            unit: zeros(),
            weights: zeros(),
        };
        for (part, direction) in normal.as_flattened().iter().zip(&self.directions) {
            add_multiple(&mut sum.unit, part * scale, &direction.unit);
            add_multiple(&mut sum.weights, part * scale, &direction.weights);
        }
        for (part, direction) in normal.as_flattened().iter().zip(&mut self.directions) {
            add_multiple(&mut direction.unit, -part, &sum.unit);
            add_multiple(&mut direction.weights, -part, &sum.weights);
        }
        let leaving = self.directions.pop()?;
        Some((share, leaving))
    }
}

impl<const FOURS: usize> Solution<FOURS> {
    /// Moves `length` along a direction, from the residual into the weights.
    #[inline]
    fn step(&mut self, length: f64, direction: &Direction<FOURS>) {
        add_multiple(&mut self.weights, length, &direction.weights);
        add_multiple(&mut self.residual, -length, &direction.unit);
    }
}

/// The direction that a column adds to the others; `None` if it depends on them.
#[inline]
fn orthogonal_direction<const FOURS: usize>(
    directions: &[Direction<FOURS>],
    entries: Fours<FOURS>,
) -> Option<Direction<FOURS>> {
    let square = dot(&entries, &entries);
    let mut own = Direction {
        unit: entries,
        weights: zeros(),
    };
    own.weights.as_flattened_mut()[directions.len()] = 1.0;
    let mut own_square = square;
    for _ in 0..2 {
        let mut reaches = zeros::<FOURS>();
        for (reach, direction) in reaches.as_flattened_mut().iter_mut().zip(directions) {
            *reach = dot(&direction.unit, &own.unit);
        }
        for (reach, direction) in reaches.as_flattened().iter().zip(directions) {
            add_multiple(&mut own.unit, -reach, &direction.unit);
            add_multiple(&mut own.weights, -reach, &direction.weights);
        }
        own_square = dot(&own.unit, &own.unit);
        if own_square > REPEATED_SHARE * square {
            break;
        }
    }
    if own_square <= DEPENDENT_SHARE * square {
        return None;
    }
    let inverse = own_square.sqrt().recip();
    for numbers in [&mut own.unit, &mut own.weights] {
        for number in numbers.as_flattened_mut() {
            *number *= inverse;
        }
    }
    Some(own)
}

#[inline]
fn zeros<const FOURS: usize>() -> Fours<FOURS> {
    [[0.0; 4]; FOURS]
}

/// A slice padded with zeros.
fn padded<const FOURS: usize>(numbers: &[f64]) -> Fours<FOURS> {
    let mut filled = zeros();
    filled.as_flattened_mut()[..numbers.len()].copy_from_slice(numbers);
    filled
}

/// Adds `factor` times `numbers` to `to`.
#[inline]
fn add_multiple<const FOURS: usize>(to: &mut Fours<FOURS>, factor: f64, numbers: &Fours<FOURS>) {
    for i in 0..FOURS {
        for k in 0..4 {
            to[i][k] += factor * numbers[i][k];
        }
    }
}

/// Dot product of two padded vectors.
#[inline]
fn dot<const FOURS: usize>(a: &Fours<FOURS>, b: &Fours<FOURS>) -> f64 {
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

    use super::{super::dot, *};

    #[test]
    fn solutions_are_optimal_when_columns_leave_or_depend() {
        const MANY: usize = 37;
        let mut random = Xoshiro256PlusPlus::seed_from_u64(12);
        let mut solver = ConicLeastSquares::<10>::default();
        let mut left = 0;
        for case in 0..40 {
            // Columns around one direction, like the pushes of a contact, so that most are nearly dependent.
            let mut vector = |around: f64| -> [f64; MANY] {
                std::array::from_fn(|k| {
                    around * (k as f64).cos() + 10_f64.powi(-(case % 4)) * random.random_range(-1.0..1.0)
                })
            };
            let (target, mut columns): (_, [_; 300]) = (vector(1.0), std::array::from_fn(|_| vector(1.0)));
            columns[1] = columns[0].map(|x| 2.0 * x);
            columns[2] = std::array::from_fn(|k| columns[0][k] + columns[3][k]);
            solver.reset(&target);
            let mut added = 0;
            for _ in 0..2_000 {
                // Any column that helps, not the best one, so that more of them leave.
                let first = random.random_range(0..columns.len());
                let helps = |k: &usize| dot(&columns[*k], solver.residual()) > 1e-9;
                let Some(next) = (first..columns.len()).chain(0..first).find(helps) else {
                    break;
                };
                let named = Column::Push {
                    contact: next,
                    push: UnitPush::default(),
                };
                if !solver.add(&columns[next], named) {
                    break;
                }
                added += 1;
            }
            // Karush-Kuhn-Tucker conditions: the reported residual is right, no column has a gain along it, and passive columns
            // are orthogonal to it.
            let mut residual = target;
            let mut passive = 0;
            for (weight, column) in solver.weighted_columns() {
                let Column::Push { contact, .. } = *column else {
                    panic!("all columns are pushes")
                };
                assert!(weight > 0.0, "case {case}: {weight}");
                let along = dot(&columns[contact], solver.residual());
                assert!(along.abs() < 1e-9, "case {case}: {along} along a passive column");
                for (left, entry) in residual.iter_mut().zip(&columns[contact]) {
                    *left -= weight * entry;
                }
                passive += 1;
            }
            for (&ours, &reported) in residual.iter().zip(solver.residual()) {
                assert!(
                    (ours - reported).abs() < 1e-9,
                    "case {case}: {reported}, not {ours}"
                );
            }
            for column in &columns {
                let gain = dot(column, &residual);
                assert!(gain < 2e-9, "case {case}: a column still gains {gain}");
            }
            left += added - passive;
        }
        assert!(left > 300, "only {left} columns left the passive set");
    }
}
