//! Grasp types, and how far a held object gives way.

mod grasp_types;
mod scoring;
