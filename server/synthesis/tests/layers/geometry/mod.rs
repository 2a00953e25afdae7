//! Geometry against brute force in double precision.

mod capsule;
mod closest_point;
mod containment;
mod crossing;
mod crowded;
mod inner_balls;
mod local_shape;
mod local_thickness;
mod opposed;
mod oriented_box;
mod sharp;
mod solid_box;
mod triangle_mesh;
mod zone;
