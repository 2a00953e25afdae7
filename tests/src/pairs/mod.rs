//! Pairs of valid grasps of one holdout: one that a person would plausibly choose, and one that a person would not.
//!
//! The score decides which valid grasp is answered, by weights that are the project's choice. Pairs check them: rules of their own
//! ([`reasons`]), which read joints, contacts and the named parts of the [`catalogue`]'s objects but no term of the score, say which
//! of two grasps is implausible and why, and the plausible one should score higher.

pub mod catalogue;
pub mod gathering;
pub mod pairing;
pub mod reasons;

#[cfg(test)]
mod tests;
