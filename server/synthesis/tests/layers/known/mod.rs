//! Atlases of the built-in objects and hands: their files and their order.

mod codec;
mod finger_subsets;
mod kept;
mod learned_grips;
mod mirrored;
mod order;
mod palm_contacts;
mod resized_grips;
mod resized_hand;
mod rounded_poses;
mod seeds;
