//! Atlases of the built-in objects and hands: their files and their order.

mod atlas;
mod learned_grips;
mod moved_grips;
