//! Linear transitions between "not at all" and "fully".

/// 0 up to the start of a range, 1 from its end, linear between.
#[inline]
pub fn ramp(value: f32, [from, to]: [f32; 2]) -> f32 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}
