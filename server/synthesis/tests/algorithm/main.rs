//! Tests of the synthesis algorithm and of the search, on simple bodies and a simple hand.

mod constraints;
mod forces;
mod placement;
mod posing;
mod race;
mod random;
mod stopping;
mod support;
mod validity;
