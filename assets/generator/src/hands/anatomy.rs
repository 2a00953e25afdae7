//! The figures of an adult right hand: bone lengths, widths, where the bones lie, what the joints can do.
//!
//! Sources are named next to the figures and in `assets/PROVENANCE.md`. Everything without a source is this project's
//! own choice, made so that the hand keeps the sourced overall measures (length, breadth, palm length, tip heights).

/// Lengths of the metacarpals of index, middle, ring and little finger in millimetres (X-ray means of 66 adults,
/// Buryanov and Kotiuk 2010). Longer metacarpals move the knuckles away from the wrist.
pub(super) const METACARPAL_MM: [f32; 4] = [68.12, 64.60, 58.00, 53.69];

/// Lengths of the three links of each digit in millimetres, thumb first (same source). The last link is the distal
/// phalanx with the pulp, so that it ends at the skin of the fingertip; the thumb's first link is its metacarpal.
pub(super) const LINK_MM: [[f32; 3]; 5] = [
    [46.22, 31.57, 21.67 + 5.67],
    [39.78, 22.38, 15.82 + 3.84],
    [44.63, 26.33, 17.40 + 3.95],
    [41.37, 25.65, 17.30 + 3.95],
    [32.74, 18.11, 15.96 + 3.73],
];

/// Diameters of the joint between the first two phalanges in millimetres, thumb (IP) first (male means, Greiner
/// 1991).
const PIP_DIAMETER_MM: [f32; 5] = [23.0, 21.8, 22.2, 20.7, 18.4];

/// Diameters of the last joint of the fingers in millimetres (male means, Greiner 1991).
const DIP_DIAMETER_MM: [f32; 4] = [18.3, 18.4, 17.1, 15.7];

/// The widths belong to hands of 194.5 mm from the tip of the middle finger to the wrist (Greiner 1991), the bones to
/// one of 190 mm.
const WIDTH_SCALE: f32 = 190.0 / 194.5;

/// Where the metacarpals of index, middle, ring and little finger start, in millimetres in the wrist frame. The
/// carpal bones take up the first 30 mm; the arch is open to the palm.
pub(super) const METACARPAL_START_MM: [[f32; 3]; 4] = [
    [12.5, 29.5, 0.0],
    [2.0, 33.0, -1.5],
    [-8.5, 33.0, -1.0],
    [-18.0, 30.5, 1.0],
];

/// Across (x) and out of the palm (z) of the knuckles in millimetres; their y follows from the bones' lengths. The
/// breadth over the skin is that of ANSUR II and Greiner, 85 to 90 mm.
pub(super) const KNUCKLE_XZ_MM: [[f32; 2]; 4] = [[27.0, 0.0], [4.5, -2.0], [-16.5, -1.0], [-35.0, 1.5]];

/// How far each stretched finger points away from the middle finger's direction, in degrees toward the thumb.
pub(super) const FAN_DEGREES: [f32; 4] = [4.0, 0.0, -4.0, -9.0];

/// How far each finger is rolled about its own length, in degrees; positive turns the pad toward the little finger's
/// side. Flexed fingers converge a little toward the ball of the thumb.
pub(super) const ROLL_DEGREES: [f32; 4] = [2.0, 0.0, -2.0, -4.0];

/// The thumb's base (the CMC joint) in millimetres in the wrist frame: palmar of the other carpal bones.
pub(super) const THUMB_BASE_MM: [f32; 3] = [22.0, 21.0, 9.0];

/// The direction of the thumb next to the flat hand in degrees: away from +y in the palm's plane, and out of it.
pub(super) const THUMB_RADIAL_DEGREES: f32 = 27.0;
/// See [`THUMB_RADIAL_DEGREES`].
pub(super) const THUMB_PALMAR_DEGREES: f32 = 5.0;
/// The direction of the thumb's pad next to the flat hand in degrees: from the palm's normal toward the little
/// finger's side. It contains the 17 degrees by which a thumb turns about its own length when it opposes the fingers
/// (Cooney 1981), because the model has no roll. With smaller angles the thumb flexes out of the palm instead of across
/// it, with larger ones into the palm.
pub(super) const THUMB_PAD_DEGREES: f32 = 73.0 + 17.0;

/// The length in millimetres from wrist to tip of the stretched middle finger in the rig `thesis` (thesis 4.3).
pub(super) const THESIS_REACH_MM: f32 = 220.0;

/// Diameters of the links in millimetres: at the first phalanx that of its far joint, then the mean of both joints,
/// then a little less than the last joint.
pub(super) fn link_diameters_mm(digit: usize) -> [f32; 3] {
    let [_, middle, last] = joint_diameters_mm(digit);
    if digit == 0 {
        // The thumb's metacarpal lies in the ball of the thumb; its own width is that of its far joint.
        let [first, second, third] = joint_diameters_mm(0);
        return [first, 0.5 * (second + third), 0.92 * third];
    }
    [middle, 0.5 * (middle + last), 0.95 * last]
}

/// Diameters of the three joints of a digit in millimetres: a finger's knuckle, PIP and DIP, the thumb's CMC, MCP and
/// IP.
pub(super) fn joint_diameters_mm(digit: usize) -> [f32; 3] {
    let pip = PIP_DIAMETER_MM[digit] * WIDTH_SCALE;
    if digit == 0 {
        // The ball of the thumb is thicker than its last joint.
        return [1.24 * pip, 1.1 * pip, pip];
    }
    // The knuckle is covered by the palm's pad: 27 to 22 mm from back to front.
    [1.22 * pip, pip, DIP_DIAMETER_MM[digit - 1] * WIDTH_SCALE]
}

/// Distance from the tip joint to the sides of the fingertip in millimetres.
pub(super) fn tip_radius_mm(digit: usize) -> f32 {
    0.42 * joint_diameters_mm(digit)[2]
}

/// Distance from the palm joint to the palm's skin in millimetres: half of the palm's thickness of about 28 mm.
pub(super) const PALM_RADIUS_MM: f32 = 14.0;
/// Limits of one digit in degrees: base yaw, base pitch, second pitch, third pitch.
pub(super) type LimitsDegrees = [[f32; 2]; 4];

/// Thesis Table 4.1; the third pitch is two thirds of the second.
pub(super) const THESIS_LIMITS: [LimitsDegrees; 5] = {
    const FINGER: LimitsDegrees = [[-5.0, 5.0], [0.0, 90.0], [0.0, 90.0], [0.0, 60.0]];
    [
        [[0.0, 45.0], [0.0, 60.0], [-45.0, 45.0], [-30.0, 30.0]],
        FINGER,
        FINGER,
        FINGER,
        FINGER,
    ]
};

/// Anatomical limits (AAOS and others): knuckles ±20 sideways and 0 to 90, PIP 0 to 100, DIP 0 to 90; the thumb's CMC
/// 0 to 70 off the palm's plane and -20 to 15 across the palm, MCP 0 to 50, IP 0 to 80. The IP may also be stretched
/// 15 further, as every thumb does that presses with its pad; without it pads meet only in curled hands.
pub(super) const ADULT_LIMITS: [LimitsDegrees; 5] = {
    const FINGER: LimitsDegrees = [[-20.0, 20.0], [0.0, 90.0], [0.0, 100.0], [0.0, 90.0]];
    [
        [[0.0, 70.0], [-20.0, 15.0], [0.0, 50.0], [-15.0, 80.0]],
        FINGER,
        FINGER,
        FINGER,
        FINGER,
    ]
};
