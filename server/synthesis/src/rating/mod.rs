//! Rates valid grasps: score, taxonomy type and comfort.

pub mod assessment;
pub mod scoring;
pub mod stiffness;
pub mod taxonomy;
