//! The built-in objects, hands and holdouts, embedded so that a server or a test runs from anywhere.
//!
//! `PROVENANCE.md` says where the files in this folder come from.

pub mod atlases;
pub mod hands;
pub mod holdouts;
pub mod objects;
