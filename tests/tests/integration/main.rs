//! The server over real gRPC, in one binary that is linked once.

mod atlases;
mod barriers;
mod both_hands;
mod budget;
mod constraints;
mod conventions;
mod fixtures;
mod health;
mod hooks;
mod invalid;
mod invalid_barriers;
mod key_frames;
mod limits;
mod load;
mod objects;
mod objects_directory;
mod physical;
mod real_input;
mod reflection;
mod reported;
mod reported_grasps;
mod reproducible;
mod shutdown;
mod tracked_hands;
mod uploads;
