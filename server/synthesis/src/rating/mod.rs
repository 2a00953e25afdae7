//! How good a valid grasp is: its score, its type in the taxonomy, its comfort.

pub mod assessment;
pub mod comfort;
pub mod scoring;
pub mod stiffness;
pub mod taxonomy;
