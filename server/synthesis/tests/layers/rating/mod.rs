//! Grasp types, and how far a held object gives way.

mod choice;
mod grasp_types;
mod stiffness;
