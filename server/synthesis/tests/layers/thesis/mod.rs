//! Algorithm 1 on simple bodies with a simple hand.

mod placement_and_posing;
mod validity;
