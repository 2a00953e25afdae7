//! Tests of the geometry against brute force in double precision.

mod capsule;
mod closest_point;
mod containment;
mod crossing;
mod files;
mod holdout;
mod mesh;
mod meshes;
mod oracle;
mod oriented_box;
mod random;
