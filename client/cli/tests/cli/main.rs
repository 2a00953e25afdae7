//! The built command line `grasp`, against a scripted and a real server.

mod commands;
mod harness;
mod objects;
#[path = "../../../tests/client/scripted.rs"]
mod scripted;
mod searches;
