//! `PHYSICAL` validity: grasps that a person would believe.
//!
//! Where the thesis tests a few segments, the hand is solid here ([`solids`]); where it draws force distributions until
//! one is lucky, forces are solved for ([`immobility`]).

pub mod immobility;
pub mod solids;
