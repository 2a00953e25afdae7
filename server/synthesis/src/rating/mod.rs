//! Rates valid grasps: score, taxonomy type and comfort.

pub mod assessment;
pub mod choice;
pub mod comfort;
pub mod scoring;
pub mod shared_assessment;
pub mod stiffness;
pub mod taxonomy;
