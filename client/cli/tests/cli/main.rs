//! The built command line `grasp`, against a scripted and a real server.

mod bake;
mod commands;
mod current;
mod experiments;
mod objects;
mod real_server;
mod receiver_options;
#[path = "../../../tests/client/scripted.rs"]
mod scripted;
mod streams;
mod tracks;
mod verdicts;
