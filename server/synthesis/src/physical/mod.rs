//! `PHYSICAL` validity: grasps that a person would believe.
//!
//! Where the thesis tests a few segments, the hand is solid here ([`solids`]), and digits close until their flesh touches
//! ([`closing`]); where it draws force distributions until one is lucky, forces are solved for ([`immobility`]). Placing
//! the wrist is common to both; [`attempt`] is the rest of Algorithm 1.

pub mod attempt;
pub mod closing;
pub mod immobility;
pub mod solids;
