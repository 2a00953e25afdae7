//! The built-in assets: their files parse, agree with one another and with the thesis, and are sound.

mod hands;
mod holdouts;
mod objects;
