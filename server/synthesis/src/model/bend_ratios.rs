//! Bend ratios: how a closing digit distributes flexion over its joints (Algorithm 4, Figure 5.20).

use serde::{Deserialize, Serialize};

/// The bend ratios of Algorithm 4: degrees of the second joint per degree of the base joint.
pub const BEND_RATIOS: [f32; 3] = [0.7, 1.0, 1.42];

/// Which bend ratios a digit tries: the columns of Figure 5.20.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BendRatioChoice {
    /// (a) 0.7, 1 and 1.42 in turn.
    All,
    /// (b) As (a), but the fingers skip 0.7.
    AllFingersWithoutLow,
    /// (c) One of the three, at random.
    OneRandom,
    /// (d) As (c), but the fingers skip 0.7.
    OneRandomFingersWithoutLow,
    /// (e) Only 1.
    OnlyOne,
    /// (f) Only 1.42.
    OnlyHigh,
}

/// The bend ratios that a digit (0 is the thumb) may try, as indices into [`BEND_RATIOS`] (Figure 5.20). The thumb
/// keeps 0.7 where only the fingers skip it.
pub(crate) fn allowed_ratios(choice: BendRatioChoice, digit: usize) -> &'static [usize] {
    match choice {
        BendRatioChoice::All | BendRatioChoice::OneRandom => &[0, 1, 2],
        BendRatioChoice::AllFingersWithoutLow | BendRatioChoice::OneRandomFingersWithoutLow => {
            if digit == 0 {
                &[0, 1, 2]
            } else {
                &[1, 2]
            }
        }
        BendRatioChoice::OnlyOne => &[1],
        BendRatioChoice::OnlyHigh => &[2],
    }
}
