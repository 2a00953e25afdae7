//! Where hands are placed.

mod handles;
mod hooks;
mod mirror;
mod oppositions;
mod placement_cache;
mod success_prior;
mod transferred_grips;
