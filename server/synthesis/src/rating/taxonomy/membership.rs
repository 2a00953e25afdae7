//! Fuzzy membership functions, from 0 to 1.

/// Smoothstep: 0 up to `from`, 1 above `to`.
pub(super) fn rising(x: f32, [from, to]: [f32; 2]) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The complement of [`rising`]: 1 up to the start of the range, 0 above its end.
pub(super) fn falling(x: f32, range: [f32; 2]) -> f32 {
    1.0 - rising(x, range)
}
