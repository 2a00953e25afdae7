//! Atlases of the built-in objects and hands: their files and their order.

mod codec;
mod kept;
mod learned_grips;
mod mirrored;
mod order;
mod resized_grips;
mod resized_hand;
mod rounded_poses;
mod seeds;
