//! Shared by every layer and dependent on none: poses, the clock, stops, random streams, the stopwatch, rejections, and the
//! switches of the default search's mechanisms.

pub mod clock;
pub mod mechanisms;
pub mod pose;
pub mod ramp;
pub mod random;
pub mod rejection;
pub mod stop;
pub mod stopwatch;
