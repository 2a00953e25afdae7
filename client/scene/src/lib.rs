//! Pictures (PNG) and scenes (GLB) of hands holding objects.
//!
//! A [`Handover`] of a holdout and its grasps is drawn by tracing rays ([`Handover::draw`]), and written as a binary glTF file
//! ([`Handover::to_glb`]). A [`TrackRecording`] is written with an animation ([`TrackRecording::to_glb`]). Hands are posed by the
//! joints sent over the wire, with the skins of the built-in rigs.
//!
//! Right-handed, +Y up, metres. Colours are linear RGB, not sRGB, unless a name says otherwise.

mod camera;
mod glb;
mod handover;
mod hands;
mod image;
mod moving;
mod parts;
mod people;
mod receiver;
mod render;
mod track;

pub use handover::{CannotDraw, Handover};
pub use image::{Image, contact_sheet};
pub use parts::{Finish, Part, linear_from_srgb};
pub use render::ViewSize;
pub use track::TrackRecording;
