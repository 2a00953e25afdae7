//! Where hands are placed.

mod handles;
mod placements;
mod success_prior;
mod transferred_grips;
