//! Constants of the forces that a hand applies and bears.

/// Gravity in m/s² as the thesis has it (2.6).
pub const GRAVITY: f32 = 9.81;

/// D: the shares of force that the digits apply in comfort, thumb first (thesis 2.5, after Radwin et al.). They sum to
/// one.
pub const COMFORTABLE_SHARES: [f32; 5] = [0.25, 0.25, 0.25, 0.125, 0.125];
