//! Pictures (PNG) and scenes (GLB) of hands holding objects.
//!
//! A [`Scene`] of coloured meshes is rendered on the CPU ([`render::render`]) or written as a binary glTF file
//! ([`glb::to_glb`]). [`handover::HandoverScene`] builds one from an object, hands, contacts and forces.
//!
//! Right-handed, +Y up, metres. Colours are linear, not sRGB, unless a name says otherwise. The same scene gives the
//! same bytes for any number of threads.

pub mod camera;
mod font;
pub mod glb;
pub mod handover;
pub mod image;
mod normals;
mod occlusion;
pub mod primitives;
pub mod raster;
pub mod render;
pub mod scene;
mod shading;
mod shadow;
mod skin_look;
mod sleeve;
mod surface;
pub mod views;

pub use camera::Camera;
pub use glb::{GlbWriter, to_glb};
pub use handover::{ArmJoints, ContactMark, HandoverScene, PosedHand};
pub use image::{Image, contact_sheet, side_by_side};
pub use render::{RenderOptions, render, render_png};
pub use scene::{Finish, Part, Scene, linear_from_srgb};
