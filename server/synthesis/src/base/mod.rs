//! What every layer uses and what knows of none: poses, the clock, random streams, the stopwatch, rejections.

pub mod clock;
pub mod mechanisms;
pub mod pose;
pub mod random;
pub mod rejection;
pub mod stopwatch;
