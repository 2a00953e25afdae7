//! Smooth memberships: how surely a figure is large or small, from 0 to 1.

/// 0 up to `from`, 1 from `to` on, between them a cubic without kinks.
pub(super) fn rising(x: f32, [from, to]: [f32; 2]) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// 1 up to `from`, 0 from `to` on.
pub(super) fn falling(x: f32, range: [f32; 2]) -> f32 {
    1.0 - rising(x, range)
}
