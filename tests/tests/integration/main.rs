//! The server over real gRPC. One binary, so that it is linked once.

mod budget;
mod conventions;
mod health;
mod invalid;
mod load;
mod objects;
mod objects_directory;
mod physical;
mod real_input;
mod reflection;
mod reproducible;
mod shutdown;
mod support;
