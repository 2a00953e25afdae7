//! How good a grasp is.

use serde::{Deserialize, Serialize};

/// How good a valid grasp is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Of all terms together; more is better.
    pub total: f32,
    /// What it is made of.
    pub terms: Vec<ScoreTerm>,
}

/// One of the qualities that a score is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreTerm {
    /// What it rates.
    pub name: String,
    /// From 0 to 1, 1 is best.
    pub value: f32,
    /// How much it counts beside the others.
    pub weight: f32,
}
