//! The atlases of built-in objects and hands that are embedded, so that a server knows them from its first start.

use grasp_synthesis::model::hand::{Handedness, rig::Rig};

/// The files by name.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/atlases.rs"));

/// What the file of an object's and a hand's atlas is called, without its extension: "remote-adult-right".
pub fn file_name(object: &str, rig: &Rig) -> String {
    let side = match rig.handedness {
        Handedness::Left => "left",
        Handedness::Right => "right",
    };
    format!("{object}-{}-{side}", rig.name)
}

/// The embedded atlas of a built-in object and a hand, to be read by `grasp_synthesis::known::codec::decode`; none if
/// there is none.
pub fn atlas(object: &str, rig: &Rig) -> Option<&'static [u8]> {
    let name = file_name(object, rig);
    FILES
        .iter()
        .find(|(file, _)| *file == name)
        .map(|(_, bytes)| *bytes)
}
