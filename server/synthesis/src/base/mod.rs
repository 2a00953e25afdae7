//! Shared by every layer and dependent on none: poses, the clock, stops, random streams, the stopwatch and rejections.

pub mod clock;
pub mod pose;
pub mod ramp;
pub mod random;
pub mod rejection;
pub mod stop;
pub mod stopwatch;
