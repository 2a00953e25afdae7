//! The built-in hands: rig and skin of `thesis` and `adult`, left and right. To come; the interface is fixed.

use grasp_synthesis::hand::{Handedness, rig::Rig, skin::Skin};

/// The names of the built-in rigs.
pub const RIG_NAMES: [&str; 2] = ["thesis", "adult"];

/// A rig with its skin.
#[derive(Clone, Debug)]
pub struct Hand {
    /// Bones, limits, widths and collision segments.
    pub rig: Rig,
    /// The skin, bound to the 26 joints of the stretched hand in the wrist frame.
    pub skin: Skin,
    /// The same hand as a GLB file with WebXR joint names.
    pub glb: &'static [u8],
}

/// A built-in hand, parsed once.
pub fn hand(_rig: &str, _handedness: Handedness) -> Option<&'static Hand> {
    None
}
