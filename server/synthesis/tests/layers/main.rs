//! Tests of the core, grouped by its layers. What several of them need is built in [`fixtures`], and only there.

mod base;
mod fixtures;
mod geometry;
mod known;
mod model;
mod physical;
mod prelude;
mod propose;
mod rating;
mod search;
mod thesis;
