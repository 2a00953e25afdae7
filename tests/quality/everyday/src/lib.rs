//! Everyday objects, from a needle to a chair: meshes of a few kinds of shapes, with the sizes and masses of real ones and the friction
//! of skin on their materials.
//!
//! The judge measures how many of them the service takes. The README next to this crate lists the objects and their sources.

mod about;
mod mesh_builder;
mod objects;
mod sketch;
#[cfg(test)]
mod tests;

pub use about::{EverydayObject, Fill, Hands, Part, Source, Surface, table};
pub use objects::everyday_objects;
