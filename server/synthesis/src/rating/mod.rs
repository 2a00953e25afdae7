//! Rates valid grasps: [`assessment`] combines the [`scoring`] of terms, the type by [`taxonomy`], comfort and [`stiffness`].

pub mod assessment;
pub mod scoring;
pub mod stiffness;
pub mod taxonomy;
