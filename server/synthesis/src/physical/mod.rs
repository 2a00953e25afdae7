//! `PHYSICAL` validity: grasps that a person would believe.
//!
//! Where the thesis tests a few segments, the hand is solid here ([`solids`]), and digits close until their flesh touches
//! ([`closing`]); where it draws force distributions until one is lucky, forces are solved for ([`immobility`]). A hand closed on an
//! object is a [`grip`].

mod closer;
pub mod closing;
pub mod contacts;
pub mod finger_subset;
pub mod flexing;
pub mod grip;
pub mod immobility;
pub mod obstacle;
pub mod scene;
pub mod shape;
pub mod solids;
