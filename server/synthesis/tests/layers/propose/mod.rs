//! Where hands are placed.

mod handles;
mod placements;
mod transferred_grips;
