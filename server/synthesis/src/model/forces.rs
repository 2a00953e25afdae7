//! Constants of the forces that a hand applies and resists.

/// Gravitational acceleration, in m/s² (thesis 2.6).
pub const GRAVITY: f32 = 9.81;

/// D: the shares of the total force that the digits apply comfortably, thumb first; they sum to one (thesis 2.5,
/// after Radwin et al.).
pub const COMFORTABLE_SHARES: [f32; 5] = [0.25, 0.25, 0.25, 0.125, 0.125];
