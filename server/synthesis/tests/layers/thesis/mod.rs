//! Algorithm 1 on simple bodies with a simple hand.

mod finger_posing;
mod forces;
mod validity;
mod wrist_placement;
