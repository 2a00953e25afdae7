//! Pictures (PNG) and scenes (GLB) of hands holding objects.
//!
//! A [`HandoverScene`] of an object, hands, contacts and forces is drawn by tracing rays
//! ([`HandoverScene::render_best_view`]), and its [`Scene`] of coloured meshes is written as a binary glTF file
//! ([`to_glb`]). A [`MovingHandover`] is written with an animation ([`to_moving_glb`]). Feature `client` builds both from
//! what clients send and receive.
//!
//! Right-handed, +Y up, metres. Colours are linear RGB, not sRGB, unless a name says otherwise.

mod camera;
#[cfg(feature = "client")]
pub mod client;
mod font;
mod glb;
mod handover;
mod image;
mod people;
mod primitives;
mod render;
mod scene;
mod tracer;
mod views;

pub use glb::{MovingHand, MovingHandover, to_glb, to_moving_glb};
pub use handover::{ContactMark, HandoverScene, PosedHand};
pub use image::{Image, contact_sheet, side_by_side};
pub use people::{ArmJoints, Person};
pub use render::RenderOptions;
pub use scene::{Finish, Part, Scene, linear_from_srgb};
