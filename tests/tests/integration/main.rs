//! The server over real gRPC, in one binary that is linked once.

mod atlases;
mod connect;
mod conventions;
mod examples;
mod find_grasp;
mod fixtures;
mod golden;
mod known_grips;
mod load;
mod module_order;
mod objects;
mod observed;
mod own_hands;
mod real_input;
mod reported;
mod saved;
mod saved_by_0_1;
mod shutdown;
mod standard;
mod streams;
mod tracks;
mod uploads;
mod validate_grasp;
mod violations;
mod web;
mod wire;
