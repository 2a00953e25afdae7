//! The built command line `grasp`, against a scripted and a real server.

mod bake;
mod call;
mod commands;
mod current;
mod files;
mod objects;
mod pictures;
mod requests;
#[path = "../../../tests/client/scripted.rs"]
mod scripted;
mod servers;
mod streams;
mod tracks;
mod verdicts;
