//! `PHYSICAL` validity: physically plausible grasps.
//!
//! The thesis tests a few line segments; here the hand is solid ([`solids`]) and digits close until their flesh
//! touches ([`closing`]). The thesis samples force distributions; here contact forces are solved for
//! ([`immobility`]). A [`grip`] is a hand closed on an object, or fingers in which it hangs ([`hanging`]), clear of
//! [`barriers`]; [`both_hands`] hold objects too large for one. In [`closer`], digits close, and make way.

pub mod barriers;
pub mod both_hands;
pub mod closer;
pub mod closing;
pub mod contacts;
pub mod grip;
pub mod hanging;
pub mod immobility;
pub mod presented;
pub mod receiver;
pub mod shape;
pub mod solids;
