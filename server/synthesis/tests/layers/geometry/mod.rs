//! Geometry against brute force in double precision.

mod boxes;
mod capsule;
mod mesh_queries;
mod shape;
