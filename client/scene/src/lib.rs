//! Pictures (PNG) and scenes (GLB) of hands holding objects.
//!
//! A [`Scene`] of coloured meshes is rendered on the CPU ([`render::render`]) or written as a binary glTF file
//! ([`glb::to_glb`]). [`handover::HandoverScene`] builds one from an object, hands, contacts and forces;
//! [`moving::MovingHandover`] is one that moves, for an animation ([`glb::to_moving_glb`]) or a strip of pictures. Feature
//! `client` builds both from what clients send and receive.
//!
//! Right-handed, +Y up, metres. Colours are linear, not sRGB, unless a name says otherwise. The same scene gives the
//! same bytes for any number of threads.

pub mod camera;
#[cfg(feature = "client")]
pub mod client;
mod font;
pub mod glb;
pub mod handover;
pub mod image;
pub mod moving;
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
pub use glb::{GlbWriter, to_glb, to_moving_glb};
pub use handover::{ArmJoints, ContactMark, HandoverScene, Person, PosedHand};
pub use image::{Image, contact_sheet, side_by_side};
pub use moving::{MovingHand, MovingHandover};
pub use render::{RenderOptions, render, render_png};
pub use scene::{Finish, Part, Scene, linear_from_srgb};
