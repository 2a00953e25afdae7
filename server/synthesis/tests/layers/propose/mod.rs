//! Where hands are placed.

mod hooks;
mod mirror;
mod oppositions;
mod placement_cache;
mod success_prior;
mod transferred_grips;
