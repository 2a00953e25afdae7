//! The experiments of the thesis' chapter 5, on the crate that the server searches with.

pub mod plot;
