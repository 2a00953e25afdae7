//! `PHYSICAL` validity: grasps that a person would believe.
//!
//! Where the thesis tests a few segments, the hand is solid here ([`solids`]), and digits close until their flesh touches
//! ([`closing`]); where it draws force distributions until one is lucky, forces are solved for ([`immobility`]). Placing
//! the wrist is common to both; a hand closed on an object is a [`grip`], and one that holds what is presented a grasp
//! ([`attempt`]).

pub mod attempt;
mod closer;
pub mod closing;
pub(crate) mod contacts;
pub mod flexing;
pub mod grip;
pub mod immobility;
pub mod obstacle;
pub mod scene;
pub mod shape;
pub mod solids;
pub mod sparing;
pub mod stiffness;
