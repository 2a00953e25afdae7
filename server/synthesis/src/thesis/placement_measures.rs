//! The six measures of a wrist placement and their allowed ranges (thesis 5.3, Table 5.3).
//!
//! This is the reference form, which computes every measure. The search needs only to know whether all are in range, and
//! tests that in a cheaper order ([`super::wrist_placement`]).

use glam::Vec3;

use crate::{
    base::pose::Pose,
    model::{hand::rig::Rig, holdout::Holdout, strategy::Strategy},
};

/// The allowed range of a measure, ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasureRange {
    /// Smallest allowed value, in metres or degrees.
    pub min: f32,
    /// Largest allowed value, in metres or degrees.
    pub max: f32,
}

impl MeasureRange {
    const fn new(min: f32, max: f32) -> Self {
        Self { min, max }
    }

    /// True if `value` is allowed.
    pub fn contains(self, value: f32) -> bool {
        value >= self.min && value <= self.max
    }
}

/// Distance in metres from the wrist O to the object (Table 5.3). A wider range prunes fewer placements, and finger posing
/// fails on more of them.
pub const WRIST_DISTANCE: MeasureRange = MeasureRange::new(0.0075, 0.12);

/// Distance in metres from the palm H to the object (Table 5.3; the text of 5.3 gives two other ranges).
pub const PALM_DISTANCE: MeasureRange = MeasureRange::new(0.0, 0.08);

/// Angle in degrees between the wrist's upward vector +y and H' - O (Table 5.3).
pub const UPWARD_WRIST_ANGLE_DEGREES: MeasureRange = MeasureRange::new(0.0, 55.0);

/// Angle in degrees between the wrist's forward vector +z and H' - O (Table 5.3).
pub const FORWARD_WRIST_ANGLE_DEGREES: MeasureRange = MeasureRange::new(35.0, 95.0);

/// Sum of the upward and forward wrist angles in degrees (Table 5.3). The lower end is not tested: it always holds, since
/// +y and +z are perpendicular.
pub const WRIST_ANGLE_SUM_DEGREES: MeasureRange = MeasureRange::new(90.0, 115.0);

/// Angle in degrees between the directions from the centre of mass to the two palms, on the ground plane (5.3).
pub const PALM_COM_PALM_ANGLE_DEGREES: MeasureRange = MeasureRange::new(90.0, 180.0);

/// The measures of one wrist placement.
///
/// O is the wrist, H the centre of the palm's skin; O' and H' are the closest points of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacementMeasures {
    /// |O' - O| in metres.
    pub wrist_distance: f32,
    /// |H' - H| in metres.
    pub palm_distance: f32,
    /// Angle between the wrist's +y and H' - O, 0 to 180 degrees.
    pub upward_angle_degrees: f32,
    /// Angle between the wrist's +z and H' - O, 0 to 180 degrees.
    pub forward_angle_degrees: f32,
    /// The palm-CoM-palm angle, 0 to 180 degrees. `None`, which counts as in range, without a presenting hand or if a
    /// palm is straight above or below the centre of mass: it then has no direction on the ground plane, and the hands
    /// are not on the same side of the object.
    pub palm_com_palm_angle_degrees: Option<f32>,
}

impl PlacementMeasures {
    /// Measures a wrist pose in the object's frame.
    pub fn of(holdout: &Holdout, rig: &Rig, object_from_wrist: Pose) -> Self {
        let surface = &holdout.object.surface;
        let wrist = object_from_wrist.position;
        let palm = object_from_wrist.transform_point(rig.palm);
        let closest = |point: Vec3| {
            surface
                .closest_point_within(point, f32::INFINITY)
                .map_or((point, f32::INFINITY), |closest| {
                    (closest.position, closest.distance)
                })
        };
        let (_, wrist_distance) = closest(wrist);
        let (closest_to_palm, palm_distance) = closest(palm);
        let to_object = closest_to_palm - wrist;
        let upward = object_from_wrist.transform_vector(Vec3::Y);
        let forward = object_from_wrist.transform_vector(Vec3::Z);
        Self {
            wrist_distance,
            palm_distance,
            upward_angle_degrees: angle_between(upward, to_object).to_degrees(),
            forward_angle_degrees: angle_between(forward, to_object).to_degrees(),
            palm_com_palm_angle_degrees: palm_com_palm_angle(holdout, palm).map(f32::to_degrees),
        }
    }

    /// Sum of the upward and forward wrist angles, in degrees.
    pub(crate) fn angle_sum_degrees(&self) -> f32 {
        self.upward_angle_degrees + self.forward_angle_degrees
    }

    /// True if the strategy accepts the placement.
    pub fn are_in_range(&self, strategy: Strategy) -> bool {
        let by_object = !strategy.prunes_by_object()
            || WRIST_DISTANCE.contains(self.wrist_distance)
                && PALM_DISTANCE.contains(self.palm_distance)
                && UPWARD_WRIST_ANGLE_DEGREES.contains(self.upward_angle_degrees)
                && FORWARD_WRIST_ANGLE_DEGREES.contains(self.forward_angle_degrees)
                && self.angle_sum_degrees() <= WRIST_ANGLE_SUM_DEGREES.max;
        let by_presenting_hand = !strategy.prunes_by_presenting_hand()
            || self
                .palm_com_palm_angle_degrees
                .is_none_or(|angle| PALM_COM_PALM_ANGLE_DEGREES.contains(angle));
        by_object && by_presenting_hand
    }
}

/// The palm-CoM-palm angle in radians: between the directions from the centre of mass to the two palms, projected onto the
/// ground plane. The thesis calls that plane "XY"; here it is perpendicular to gravity.
fn palm_com_palm_angle(holdout: &Holdout, receiving_palm: Vec3) -> Option<f32> {
    let on_ground = |point: Vec3| {
        let arm = point - holdout.object.centre_of_mass;
        arm - holdout.up * arm.dot(holdout.up)
    };
    let giver = on_ground(holdout.presenting_hand.as_ref()?.palm);
    let receiver = on_ground(receiving_palm);
    (giver != Vec3::ZERO && receiver != Vec3::ZERO).then(|| angle_between(giver, receiver))
}

/// The angle between two vectors in radians; accurate near 0 and π, where acos is not.
fn angle_between(a: Vec3, b: Vec3) -> f32 {
    a.cross(b).length().atan2(a.dot(b))
}
