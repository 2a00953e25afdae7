//! The fingerprint of growth: written by `grasp-assets-generator algorithm`, not by hand.

/// Hash of a small reference growth and of the bounds on growth. It changes exactly when the same object and hand get
/// other grips, contacts or scores, so that older atlases are not mistaken for current ones.
pub const ALGORITHM: u64 = 0x2577_8fce_835a_2950;
