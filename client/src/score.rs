//! Quality of a grasp.

use serde::{Deserialize, Serialize};

/// Quality of a valid grasp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Weighted mean of the terms; higher is better.
    pub total: f32,
    /// The terms.
    pub terms: Vec<ScoreTerm>,
}

/// One term of a score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreTerm {
    /// What the term rates.
    pub name: String,
    /// From 0 to 1; 1 is best.
    pub value: f32,
    /// Weight of the term.
    pub weight: f32,
}
