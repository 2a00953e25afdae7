//! The built-in objects, hands and holdouts, embedded so that a server or a test runs from anywhere.
//!
//! The files beside this crate are made by `grasp-assets-generator`; see `PROVENANCE.md`.

pub mod atlases;
pub mod hands;
pub mod holdouts;
pub mod objects;
pub mod primitives;
