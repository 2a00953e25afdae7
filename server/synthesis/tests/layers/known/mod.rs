//! Atlases of the built-in objects and hands: their files, their order and what a giver excludes.

mod codec;
mod exclusion;
mod kept;
mod learned_grips;
mod mirrored;
mod resized_grips;
mod resized_hand;
mod rounded_poses;
mod seeds;
mod shortlist;
