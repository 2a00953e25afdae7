//! The server over real gRPC, in one binary that is linked once.

mod atlases;
mod budget;
mod constraints;
mod conventions;
mod fixtures;
mod health;
mod hooks;
mod invalid;
mod key_frames;
mod load;
mod objects;
mod objects_directory;
mod physical;
mod real_input;
mod reflection;
mod reproducible;
mod shutdown;
