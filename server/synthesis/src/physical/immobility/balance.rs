//! Force balance: contact forces that hold the object against gravity.

use super::{
    Balance, Buffers, ContactCone, FrictionUse, Load, MAX_CONTACTS, ScaledWrench, SoftContact, TorqueScale,
    UnitPush, dot,
    least_squares::{Column, ConicLeastSquares},
    prepared_cones,
};
use crate::model::grasp::{COMFORTABLE_SHARES, GRAVITY};

/// Largest force at a contact, in newtons: peak force of a finger (thesis 2.5, after Didomenico and Nussbaum).
/// Smaller values reject heavy objects.
pub const MAX_CONTACT_FORCE: f32 = 27.0;

/// Largest unbalanced wrench, as a share of the weight. The thesis' 5 degrees are 9 %, and objects held like that
/// fall in simulation. Smaller values reject more grasps.
pub const BALANCE_TOLERANCE: f32 = 0.02;

/// Firm sum of the digits' normal forces times friction, over the weight, with a margin (Westling and Johansson 1984).
const FIRMNESS: f64 = 5.0;

/// Part of the firm force that does not depend on the weight, in newtons: even a 20 g scalpel is held as firmly as a pen.
const BASE_GRIP_FORCE: f64 = 8.0;

/// The firm sum puts no digit beyond this share of [`MAX_CONTACT_FORCE`]: people do not grip at full strength.
const FIRM_SHARE_OF_MAX: f64 = 0.5;

/// Usable shares of friction and torsion, by [`FrictionUse`]: twice the load holds, 1.5 times the load holds, and all but rounding.
const SHARES: [f64; 3] = [0.45, 0.7, 1.0 - 2e-6];

/// Digits press firmly from this share of the firm sum.
const FIRM_ENOUGH: f64 = 0.5;

/// Weight of deviations from the comfortable shares (of the firm sum) against unbalanced wrench.
const SHARE_WEIGHT: f64 = 0.04;

/// Weight of missing firmness (as a share of the firm sum) against unbalanced wrench.
const FIRMNESS_WEIGHT: f64 = 0.04;

/// Weight of a contact's force limit against unbalanced wrench.
const LIMIT_WEIGHT: f64 = 30.0;

/// The search for any balance ends once the residual is below this share of [`BALANCE_TOLERANCE`].
const FOUND: f64 = 0.5;

/// A push that gains less than this along the residual does not improve balance.
const NEGLIGIBLE_GAIN: f64 = 1e-6;

/// A push that gains less than this share of the first newton's gain in firmness does not improve comfort.
const NEGLIGIBLE_COMFORT: f64 = 0.01;

/// Limit on the columns added per solve. Most grasps need a dozen.
const MAX_COLUMNS: usize = 60;

/// Leading rows: the wrench.
const WRENCH_ROWS: usize = 6;

/// Trailing rows: the digits' shares and their sum.
const COMFORT_ROWS: usize = 6;

/// Groups of four rows: without force limits, and with those of up to [`MAX_CONTACTS`].
const UNLIMITED_FOURS: usize = (WRENCH_ROWS + COMFORT_ROWS).div_ceil(4);
const LIMITED_FOURS: usize = (WRENCH_ROWS + MAX_CONTACTS + COMFORT_ROWS).div_ceil(4);

/// The least-squares solvers, kept for their memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Solvers {
    unlimited: ConicLeastSquares<UNLIMITED_FOURS>,
    limited: ConicLeastSquares<LIMITED_FOURS>,
    column: Vec<f64>,
}

/// Forces inside the friction limits, each at most [`MAX_CONTACT_FORCE`], that balance gravity within
/// [`BALANCE_TOLERANCE`]; `None` if there are none. Forces that are firm and keep off the friction limits are
/// preferred. The digits' shares are as close to the comfortable ones (Eq. 4.6) as balance allows, and their sum to
/// the firm force; the palm is free.
///
/// Limits hold exactly. At the very edge of the balance tolerance, forces may be missed.
///
/// # Panics
/// There are more than [`MAX_CONTACTS`].
pub fn balance(contacts: &[SoftContact], load: &Load, buffers: &mut Buffers) -> Option<Balance> {
    balance_with(contacts, load, FrictionUse::Low, buffers)
}

/// [`balance`] starting from `least_use`, for contacts known not to press firmly with less friction under a similar load.
///
/// # Panics
/// As [`balance`].
pub fn balance_with(
    contacts: &[SoftContact],
    load: &Load,
    least_use: FrictionUse,
    buffers: &mut Buffers,
) -> Option<Balance> {
    let found = solved(contacts, load, (least_use, true), buffers);
    (found.residual <= BALANCE_TOLERANCE).then_some(found)
}

/// [`balance`] or, if it fails, the forces closest to balance, with their residual; takes longer.
pub(crate) fn nearest_balance(contacts: &[SoftContact], load: &Load, buffers: &mut Buffers) -> Balance {
    solved(contacts, load, (FrictionUse::Low, false), buffers)
}

/// The best forces found; the search may give up once balance is impossible.
fn solved(
    contacts: &[SoftContact],
    load: &Load,
    (least_use, gives_up): (FrictionUse, bool),
    buffers: &mut Buffers,
) -> Balance {
    let Buffers { cones, solvers, .. } = buffers;
    let mut problem = Problem::new(contacts, load, prepared_cones(contacts, load, cones));
    problem.gives_up = gives_up;
    // Contacts with closure hold nearly any load.
    if let Some(found) = problem.lowest_friction_balance(least_use, solvers) {
        return found;
    }
    let mut found = problem.best(solvers);
    if (found.residual <= BALANCE_TOLERANCE || !gives_up) && exceeds_limit(&found) {
        problem.limited = true;
        found = problem.best(solvers);
    }
    problem.keep_limits(&mut found);
    found
}

/// Sum of the digits' normal forces, in newtons, that holds a weight in newtons firmly.
pub(crate) fn firm_force(weight: f64, friction: f64) -> f64 {
    BASE_GRIP_FORCE + FIRMNESS / friction * weight
}

/// The least-squares problem of one grasp. Forces are in units of the weight.
///
/// Rows: the wrench; if limited, one per contact that equates its force and a slack with the limit; if comfortable,
/// one per digit for its share and one for the sum of all.
struct Problem<'a> {
    contacts: &'a [SoftContact],
    cones: &'a [ContactCone],
    /// In newtons.
    weight: f64,
    /// Length of the torque scale, in metres.
    length: f64,
    /// The wrench that holds one newton of weight.
    needed: ScaledWrench,
    /// Comfortable shares of the touching digits, scaled to sum to one.
    shares: [f64; 5],
    /// Target sum of the digits' normal forces.
    firm_sum: f64,
    /// Weights of one weight's force in the rows of shares and of firmness.
    share_weight: f64,
    firmness_weight: f64,
    friction_use: FrictionUse,
    limited: bool,
    comfortable: bool,
    gives_up: bool,
}

impl<'a> Problem<'a> {
    fn new(contacts: &'a [SoftContact], load: &Load, cones: &'a [ContactCone]) -> Self {
        let weight = f64::from(load.mass * GRAVITY);
        let mut shares = [0.0; 5];
        let mut friction = f64::INFINITY;
        for contact in contacts {
            if let Some(digit) = contact.digit {
                shares[digit.index()] = f64::from(COMFORTABLE_SHARES[digit.index()]);
                friction = friction.min(f64::from(contact.friction));
            }
        }
        let sum: f64 = shares.iter().sum();
        let largest = shares.iter().fold(0.0, |a: f64, &b| a.max(b));
        let max_firm_force = FIRM_SHARE_OF_MAX * f64::from(MAX_CONTACT_FORCE) / weight;
        let firm_sum = if sum > 0.0 {
            (firm_force(weight, friction) / weight).min(max_firm_force * sum / largest)
        } else {
            0.0
        };
        Self {
            contacts,
            cones,
            weight,
            length: f64::from(load.torque_scale.length),
            needed: needed_wrench(load),
            shares: shares.map(|share| if sum > 0.0 { share / sum } else { 0.0 }),
            firm_sum,
            share_weight: SHARE_WEIGHT / firm_sum.max(1.0),
            firmness_weight: FIRMNESS_WEIGHT / firm_sum.max(1.0),
            friction_use: FrictionUse::Full,
            limited: false,
            comfortable: false,
            gives_up: true,
        }
    }

    /// The comfortable balance that is firm with the least friction use from `least_use` on, or else the firmest.
    fn lowest_friction_balance(&mut self, least_use: FrictionUse, solvers: &mut Solvers) -> Option<Balance> {
        let mut firmest: Option<(f64, Balance)> = None;
        for friction_use in FrictionUse::ALL {
            if friction_use < least_use {
                continue;
            }
            let Some(found) = self.comfortable_balance(friction_use, solvers) else {
                continue;
            };
            let sum = self.sum_of_digits(&found);
            if sum >= FIRM_ENOUGH * self.firm_sum {
                return Some(found);
            }
            if firmest.as_ref().is_none_or(|&(firmer, _)| sum > firmer) {
                firmest = Some((sum, found));
            }
        }
        firmest.map(|(_, found)| found)
    }

    /// Sum of the digits' normal forces over the weight.
    fn sum_of_digits(&self, found: &Balance) -> f64 {
        let pressed = self.contacts.iter().zip(&found.forces);
        let sum: f32 = pressed
            .filter(|(contact, _)| contact.digit.is_some())
            .map(|(contact, force)| -force.dot(contact.normal))
            .sum();
        f64::from(sum) / self.weight
    }

    /// The comfortable balance within this friction use, if there is one.
    fn comfortable_balance(&mut self, friction_use: FrictionUse, solvers: &mut Solvers) -> Option<Balance> {
        let was_limited = self.limited;
        self.comfortable = true;
        self.friction_use = friction_use;
        let mut found = self.best(solvers);
        if !self.limited && exceeds_limit(&found) {
            self.limited = true;
            found = self.best(solvers);
        }
        self.keep_limits(&mut found);
        self.comfortable = false;
        self.friction_use = FrictionUse::Full;
        self.limited = was_limited;
        (found.residual <= BALANCE_TOLERANCE).then_some(found)
    }

    /// Largest force at a contact, over the weight.
    fn limit(&self) -> f64 {
        f64::from(MAX_CONTACT_FORCE) / self.weight
    }

    fn limit_rows(&self) -> usize {
        if self.limited { self.contacts.len() } else { 0 }
    }

    /// The best forces for the current rows.
    fn best(&self, solvers: &mut Solvers) -> Balance {
        let Solvers {
            unlimited,
            limited,
            column,
        } = solvers;
        if self.limited {
            self.solve(limited, column);
            self.balance(limited)
        } else {
            self.solve(unlimited, column);
            self.balance(unlimited)
        }
    }

    /// Adds pushes until none improves the solution. `entries` is a buffer.
    fn solve<const FOURS: usize>(&self, solver: &mut ConicLeastSquares<FOURS>, entries: &mut Vec<f64>) {
        let rows = WRENCH_ROWS + self.limit_rows() + if self.comfortable { COMFORT_ROWS } else { 0 };
        entries.clear();
        entries.resize(rows, 0.0);
        entries[..WRENCH_ROWS].copy_from_slice(&self.needed);
        entries[WRENCH_ROWS..WRENCH_ROWS + self.limit_rows()].fill(LIMIT_WEIGHT);
        if self.comfortable {
            entries[rows - 1] = self.firmness_weight * self.firm_sum;
        }
        solver.reset(entries);
        let strength = (self.limit() + 1.0) * self.contacts.len() as f64;
        let share = SHARES[self.friction_use as usize];
        for contact in 0..self.limit_rows() {
            entries.fill(0.0);
            entries[WRENCH_ROWS + contact] = LIMIT_WEIGHT;
            solver.add(entries, Column::Slack);
        }
        for _ in 0..MAX_COLUMNS {
            let residual = solver.residual();
            let unbalanced: ScaledWrench = std::array::from_fn(|k| residual[k]);
            let length = dot(&unbalanced, &unbalanced).sqrt();
            if !self.comfortable && length < FOUND * f64::from(BALANCE_TOLERANCE) {
                return;
            }
            let mut best_gain = if self.comfortable {
                NEGLIGIBLE_COMFORT * self.firmness_weight.powi(2) * self.firm_sum.max(1.0)
            } else {
                NEGLIGIBLE_GAIN
            };
            let mut best = None;
            let comfort_gains = self.comfort_gains(solver.residual());
            for (contact, cone) in self.cones.iter().enumerate() {
                // The residual times the push's column, without writing that column; without limits, without
                // computing the push either.
                let (mut gain, push) = if self.limited {
                    let (gain, push) = self.best_push(contact, solver.residual());
                    (gain, Some(push))
                } else {
                    (cone.reach(&unbalanced, share), None)
                };
                if let Some(digit) = self.contacts[contact].digit {
                    gain += comfort_gains[digit.index()];
                }
                if gain > best_gain {
                    best_gain = gain;
                    best = Some((contact, push));
                }
            }
            let slack = (0..self.limit_rows())
                .map(|row| (LIMIT_WEIGHT * solver.residual()[WRENCH_ROWS + row], row))
                .fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a });
            // The residual is perpendicular to the solution, so pushes and slacks, together at most `strength`, can
            // shorten it by no more than they gain along it.
            let gained = strength * best_gain.max(slack.0);
            let gives_up = self.gives_up && !self.comfortable;
            if gives_up && length - gained / length > f64::from(BALANCE_TOLERANCE) {
                return;
            }
            if slack.0 > best_gain {
                entries.fill(0.0);
                entries[WRENCH_ROWS + slack.1] = LIMIT_WEIGHT;
                if solver.add(entries, Column::Slack) {
                    continue;
                }
            }
            let Some((contact, push)) = best else {
                return;
            };
            let push = push.unwrap_or_else(|| self.cones[contact].farthest_push(&unbalanced, share).1);
            self.write_entries(contact, &push, entries);
            if !solver.add(entries, Column::Push { contact, push }) {
                return;
            }
        }
    }

    /// The most useful push of a contact where forces are limited, and its gain apart from comfort.
    fn best_push(&self, contact: usize, residual: &[f64]) -> (f64, UnitPush) {
        let unbalanced: ScaledWrench = std::array::from_fn(|k| residual[k]);
        // Once a contact's forces exceed its limit, each further newton has a price.
        let price = (-residual[WRENCH_ROWS + contact] * LIMIT_WEIGHT / self.limit()).max(0.0);
        self.cones[contact].best_push_at_price(&unbalanced, SHARES[self.friction_use as usize], price)
    }

    /// Gain of a push of each digit in the comfort rows.
    fn comfort_gains(&self, residual: &[f64]) -> [f64; 5] {
        if !self.comfortable {
            return [0.0; 5];
        }
        let rows = &residual[residual.len() - COMFORT_ROWS..];
        let common = self.firmness_weight * rows[5] - self.share_weight * dot(&rows[..5], &self.shares);
        std::array::from_fn(|digit| common + self.share_weight * rows[digit])
    }

    /// The column of a push.
    fn write_entries(&self, contact: usize, push: &UnitPush, entries: &mut [f64]) {
        entries[..WRENCH_ROWS].copy_from_slice(&self.cones[contact].wrench(push));
        let (limits, comfort) = entries[WRENCH_ROWS..].split_at_mut(self.limit_rows());
        limits.fill(0.0);
        if let Some(row) = limits.get_mut(contact) {
            // The length of a sum of forces is at most the sum of their lengths.
            *row = LIMIT_WEIGHT * push.force.length() / self.limit();
        }
        comfort.fill(0.0);
        if let (true, Some(digit)) = (self.comfortable, self.contacts[contact].digit) {
            // Row of digit d: its normal force minus its share of the sum of all digits.
            for (row, share) in comfort.iter_mut().zip(self.shares) {
                *row = -self.share_weight * share;
            }
            comfort[digit.index()] += self.share_weight;
            comfort[5] = self.firmness_weight;
        }
    }

    fn balance<const FOURS: usize>(&self, solver: &ConicLeastSquares<FOURS>) -> Balance {
        let mut pushes = vec![UnitPush::default(); self.contacts.len()];
        for (factor, column) in solver.weighted_columns() {
            if let Column::Push { contact, push } = column {
                pushes[*contact].force += push.force * factor;
                pushes[*contact].torsion += push.torsion * factor;
            }
        }
        Balance {
            residual: self.residual(&pushes),
            forces: pushes
                .iter()
                .map(|push| (push.force * self.weight).as_vec3())
                .collect(),
            torsions: pushes
                .iter()
                .map(|push| (push.torsion * self.weight * self.length) as f32)
                .collect(),
            friction_use: self.friction_use,
        }
    }

    /// Length of the wrench that the pushes leave unbalanced, over the weight.
    fn residual(&self, pushes: &[UnitPush]) -> f32 {
        let mut left = self.needed;
        for (cone, push) in self.cones.iter().zip(pushes) {
            for (left, part) in left.iter_mut().zip(cone.wrench(push)) {
                *left -= part;
            }
        }
        dot(&left, &left).sqrt() as f32
    }

    /// Shortens forces beyond the limit, because weighted equations leave a small excess.
    fn keep_limits(&self, balance: &mut Balance) {
        if !exceeds_limit(balance) {
            return;
        }
        for (force, torsion) in balance.forces.iter_mut().zip(&mut balance.torsions) {
            let factor = MAX_CONTACT_FORCE / force.length();
            if factor < 1.0 {
                // Rounds down, so that the limit holds in single precision too.
                *force *= factor * (1.0 - f32::EPSILON * 2.0);
                *torsion *= factor;
            }
        }
        let pushes: Vec<UnitPush> = balance
            .forces
            .iter()
            .zip(&balance.torsions)
            .map(|(force, &torsion)| UnitPush {
                force: force.as_dvec3() / self.weight,
                torsion: f64::from(torsion) / (self.weight * self.length),
            })
            .collect();
        balance.residual = self.residual(&pushes);
    }
}

/// The wrench that holds one newton of weight at the centre of mass.
fn needed_wrench(load: &Load) -> ScaledWrench {
    let up = load.up.as_dvec3();
    let TorqueScale { centre, length } = load.torque_scale;
    let arm = (load.centre_of_mass.as_dvec3() - centre.as_dvec3()) / f64::from(length);
    let torque = arm.cross(up);
    [up.x, up.y, up.z, torque.x, torque.y, torque.z]
}

fn exceeds_limit(balance: &Balance) -> bool {
    balance
        .forces
        .iter()
        .any(|force| force.length() > MAX_CONTACT_FORCE)
}
