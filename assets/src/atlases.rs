//! Grips of the built-in objects that ship with the server.
//!
//! Only the grips on an atlas's shortlists are embedded: some hundreds, enough for first answers. A server grows the rest
//! in the background. Tests, benches and experiments that need complete atlases take them from
//! [`crate::atlas_folder`].

use grasp_synthesis::model::hand::{Handedness, rig::Rig};

/// The embedded files by name.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/atlases.rs"));

/// Name of the embedded file for an object and a hand, without extension: "remote-adult-right".
pub fn file_name(object: &str, rig: &Rig) -> String {
    let side = match rig.handedness {
        Handedness::Left => "left",
        Handedness::Right => "right",
    };
    format!("{object}-{}-{side}", rig.name)
}

/// The embedded grips of a built-in object and a hand, to be read by `grasp_synthesis::known::codec::decode`; `None` for hands
/// that ship without.
pub fn shipped_atlas(object: &str, rig: &Rig) -> Option<&'static [u8]> {
    let name = file_name(object, rig);
    FILES
        .iter()
        .find(|(file, _)| *file == name)
        .map(|(_, bytes)| *bytes)
}
