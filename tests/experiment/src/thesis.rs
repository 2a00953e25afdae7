//! The thesis' measurements, on one thread of an Intel Core i7-5700HQ in Unity (5.1).
//!
//! Figures by holdout are in the order of the built-in holdouts: remote, scalpel and scissors, each with `GenHold1` to
//! 3 and `Hold1` to 2.

use grasp_synthesis::model::strategy::Strategy;

/// Attempts and milliseconds per valid grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerGrasp {
    /// Attempts.
    pub attempts: f64,
    /// Milliseconds.
    pub milliseconds: f64,
}

const fn per_grasp(attempts: f64, milliseconds: f64) -> PerGrasp {
    PerGrasp {
        attempts,
        milliseconds,
    }
}

/// Figure 5.5a: the naive synthesis.
pub const SET_A: [PerGrasp; 15] = [
    per_grasp(515_593.0, 147_335.0),
    per_grasp(2_214_064.0, 642_242.0),
    per_grasp(139_860.0, 40_525.0),
    per_grasp(1_971_821.0, 661_714.0),
    per_grasp(134_359.0, 48_915.0),
    per_grasp(380_771.0, 95_681.0),
    per_grasp(161_882.0, 41_362.0),
    per_grasp(5_529.0, 1_415.0),
    per_grasp(1_206_705.0, 340_163.0),
    per_grasp(16_541.0, 6_075.0),
    per_grasp(10_649.0, 3_022.0),
    per_grasp(3_890.0, 1_095.0),
    per_grasp(20_506.0, 5_718.0),
    per_grasp(10_453.0, 3_145.0),
    per_grasp(51_689.0, 18_660.0),
];

/// Figure 5.16a: with the early stop at a thumb without contact.
pub const SET_D: [PerGrasp; 15] = [
    per_grasp(11_964.0, 9_806.0),
    per_grasp(90_882.0, 77_770.0),
    per_grasp(4_186.0, 3_605.0),
    per_grasp(71_477.0, 50_009.0),
    per_grasp(3_986.0, 2_611.0),
    per_grasp(17_350.0, 11_319.0),
    per_grasp(2_316.0, 1_538.0),
    per_grasp(118.0, 90.0),
    per_grasp(24_933.0, 14_910.0),
    per_grasp(457.0, 245.0),
    per_grasp(250.0, 148.0),
    per_grasp(133.0, 106.0),
    per_grasp(464.0, 327.0),
    per_grasp(194.0, 140.0),
    per_grasp(2_433.0, 1_086.0),
];

/// Figure 5.20, last row: column (a), and the differences of the others from it.
pub const BEND_RATIO_COLUMNS: [PerGrasp; 6] = [
    per_grasp(18_122.0, 12_939.0),
    per_grasp(-2_071.0, -4_133.0),
    per_grasp(-3_505.0, -7_777.0),
    per_grasp(-3_223.0, -7_701.0),
    per_grasp(2_292.0, -5_500.0),
    per_grasp(-2_593.0, -7_028.0),
];

/// Mean over all holdouts for a set of the ladder: the last rows of Figures 5.5a and 5.16a, and the text for the others
/// (5.3, 5.4; E is column (c) of Figure 5.20). None for sets beyond the thesis.
pub const fn ladder(strategy: Strategy) -> Option<PerGrasp> {
    Some(match strategy {
        Strategy::A => per_grasp(456_287.0, 137_138.0),
        Strategy::B => per_grasp(30_302.0, 52_000.0),
        Strategy::C => per_grasp(15_931.0, 28_000.0),
        Strategy::D => per_grasp(15_410.0, 11_581.0),
        Strategy::E => per_grasp(14_617.0, 5_162.0),
        // "One in 15000", "5s" (end of 5.6).
        Strategy::F => per_grasp(15_000.0, 5_000.0),
        Strategy::Guided => return None,
    })
}

/// By holdout, where the thesis has it.
pub fn by_holdout(strategy: Strategy, holdout: usize) -> Option<PerGrasp> {
    match strategy {
        Strategy::A => SET_A.get(holdout).copied(),
        Strategy::D => SET_D.get(holdout).copied(),
        Strategy::B | Strategy::C | Strategy::E | Strategy::F | Strategy::Guided => None,
    }
}

/// Figure 5.19: contacts lost when a digit that touched with one ratio (first index: 0.7, 1, 1.42) closes with another
/// (second index); by digit, thumb first.
pub const LOST_CONTACTS: [[[u64; 3]; 3]; 5] = [
    [[0, 25, 27], [37, 0, 30], [46, 52, 0]],
    [[0, 0, 6], [45, 0, 31], [49, 30, 0]],
    [[0, 2, 3], [15, 0, 14], [37, 23, 0]],
    [[0, 1, 1], [14, 0, 9], [18, 11, 0]],
    [[0, 0, 1], [6, 0, 1], [11, 8, 0]],
];

/// "An average of 18 satisfactory force distributions is found in a set of 100 tries" (5.6).
pub const SUFFICIENT_DISTRIBUTIONS: f64 = 18.0;

/// "We have not seen grasps that have more than 6 contacts" (5.5).
pub const MAX_CONTACTS: u32 = 6;

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against errors in copied figures.
    #[test]
    fn means_over_the_holdouts_match_the_printed_ones() {
        for (set, strategy) in [(SET_A, Strategy::A), (SET_D, Strategy::D)] {
            let mean = |of: fn(&PerGrasp) -> f64| set.iter().map(of).sum::<f64>() / 15.0;
            let printed = ladder(strategy).expect("the thesis has it");
            assert!(
                (mean(|grasp| grasp.attempts) - printed.attempts).abs() <= 1.0,
                "{strategy:?}"
            );
            assert!(
                (mean(|grasp| grasp.milliseconds) - printed.milliseconds).abs() <= 1.0,
                "{strategy:?}"
            );
        }
    }

    #[test]
    fn set_e_matches_column_c() {
        let [a, _, c, ..] = BEND_RATIO_COLUMNS;
        let set = ladder(Strategy::E).expect("the thesis has it");
        assert_eq!(a.attempts + c.attempts, set.attempts);
        assert_eq!(a.milliseconds + c.milliseconds, set.milliseconds);
    }

    #[test]
    fn lost_contacts_sum_to_the_printed_totals() {
        let lost_on = |digits: &[[[u64; 3]; 3]], new: usize| -> u64 {
            digits.iter().flatten().map(|old| old[new]).sum()
        };
        assert_eq!([0, 1, 2].map(|new| lost_on(&LOST_CONTACTS, new)), [278, 152, 123]);
        assert_eq!(
            [0, 1, 2].map(|new| lost_on(&LOST_CONTACTS[1..], new)),
            [195, 75, 66]
        );
    }
}
