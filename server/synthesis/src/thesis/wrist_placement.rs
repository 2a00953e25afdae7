//! Step 1, Wrist Placement: Algorithm 2 (`PLACEWRISTFRAME`) and, from strategy B on, Algorithm 11
//! (`MODIFIEDPLACEWRISTFRAME`).
//!
//! Positions are uniform in C - B and rotations uniform among all rotations, where B is the object's bounding box and C
//! is everything within the hand's reach of B. From strategy B on, placements are drawn until all measures of one are
//! in range ([`PlacementMeasures`]).
//!
//! Erratum: Algorithm 11 as printed rejects positions outside the box; this follows 4.3, which describes the opposite.

use glam::{Mat3, Quat, Vec3};

use crate::{
    base::{
        pose::Pose,
        random::AttemptStream,
        stop::{Stop, Stopped},
    },
    model::{hand::rig::Rig, holdout::Holdout, object::GraspObject, strategy::Strategy},
};

/// Margin in metres by which a bound must be violated to prune a placement without computing the measure: well above
/// rounding error, so that no placement is pruned that the exact measures accept.
const BOUND_SLACK: f32 = 1e-5;

/// Positions drawn between two checks of the stop signal, which are some microseconds apart. More make stopping slower,
/// fewer make searching slower.
const DRAWS_PER_STOP_CHECK: u32 = 256;

/// A placed wrist: the frame F0 in the object's frame, as a pose and a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WristFrame {
    /// The pose of the wrist, in metres.
    pub object_from_wrist: Pose,
    /// Its rotation; the columns are the wrist's axes.
    pub rotation: Mat3,
}

impl WristFrame {
    /// The wrist frame at a pose.
    pub fn new(object_from_wrist: Pose) -> Self {
        Self {
            object_from_wrist,
            rotation: Mat3::from_quat(object_from_wrist.orientation),
        }
    }

    /// Transforms a point from the wrist's frame to the object's.
    #[inline]
    pub fn transform_point(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.object_from_wrist.position
    }
}

/// Draws wrist placements for one object, rig and presenting hand.
#[derive(Clone, Debug)]
pub struct WristPlacer<'a> {
    object: &'a GraspObject,
    strategy: Strategy,
    palm: Vec3,
    reach: f32,
    squared_reach: f32,
    /// Squared distance from B beyond which a position is pruned before drawing a rotation.
    squared_max_distance: f32,
    object_from_box: Pose,
    half_extents: Vec3,
    /// The centre of mass in the frame of B.
    centre_of_mass: Vec3,
    /// From the centre of mass to the giver's palm, projected onto the ground plane, in the frame of B; `None` if the
    /// palm-CoM-palm angle is not tested.
    toward_giver: Option<Vec3>,
    cosines: AngleCosines,
}

/// Cosines of the limits of Table 5.3's angle ranges.
#[derive(Clone, Copy, Debug)]
struct AngleCosines {
    upward_max: f32,
    forward_min: f32,
    forward_max: f32,
    sum_max: f32,
}

/// A drawn position in the frame of B.
#[derive(Clone, Copy, Debug)]
struct Draft {
    position: Vec3,
    /// Distance from the box in metres; positive, as positions inside it are rejected.
    box_distance: f32,
}

impl<'a> WristPlacer<'a> {
    /// Prepares placements at a holdout under a strategy.
    pub fn new(holdout: &'a Holdout, rig: &Rig, strategy: Strategy) -> Self {
        let object = &*holdout.object;
        let box_from_object = object.bounding_box.object_from_box.inverse();
        let toward_giver = holdout
            .presenting_hand
            .as_ref()
            .filter(|_| strategy.prunes_by_presenting_hand())
            .map(|hand| {
                let arm = hand.palm - object.centre_of_mass;
                box_from_object.transform_vector(arm - holdout.up * arm.dot(holdout.up))
            });
        let cos = |degrees: f32| degrees.to_radians().cos();
        let max_distance = if strategy.prunes_by_object() {
            rig.reach.min(WRIST_DISTANCE.max + BOUND_SLACK)
        } else {
            rig.reach
        };
        Self {
            object,
            strategy,
            palm: rig.palm,
            reach: rig.reach,
            squared_reach: rig.reach * rig.reach,
            squared_max_distance: max_distance * max_distance,
            object_from_box: object.bounding_box.object_from_box,
            half_extents: object.bounding_box.half_extents,
            centre_of_mass: box_from_object.transform_point(object.centre_of_mass),
            toward_giver,
            cosines: AngleCosines {
                upward_max: cos(UPWARD_WRIST_ANGLE_DEGREES.max),
                forward_min: cos(FORWARD_WRIST_ANGLE_DEGREES.min),
                forward_max: cos(FORWARD_WRIST_ANGLE_DEGREES.max),
                sum_max: cos(WRIST_ANGLE_SUM_DEGREES.max),
            },
        }
    }

    /// `PLACEWRISTFRAME` with the strategy's pruning. Adds the number of pruned placements to `pruned`, even if it fails.
    ///
    /// # Errors
    /// [`Stopped`] before a placement is accepted.
    pub fn place(
        &self,
        stream: &mut AttemptStream,
        stop: Stop<'_>,
        pruned: &mut u64,
    ) -> Result<WristFrame, Stopped> {
        let mut newly_pruned = 0;
        loop {
            for _ in 0..DRAWS_PER_STOP_CHECK {
                // Uniform in the box around C. Positions outside C - B are redrawn; positions in it but too far from the
                // box are pruned before a rotation is drawn. These two cases dominate and come in random order, so
                // they share one branch.
                let position = stream.in_cube() * (self.half_extents + self.reach);
                let outside = (position.abs() - self.half_extents).max(Vec3::ZERO);
                let squared = outside.length_squared();
                if squared <= self.squared_max_distance && squared > 0.0 {
                    let draft = Draft {
                        position,
                        box_distance: squared.sqrt(),
                    };
                    if let Some(wrist) = self.accept(&draft, stream.rotation()) {
                        *pruned += newly_pruned;
                        return Ok(wrist);
                    }
                }
                newly_pruned += u64::from(squared > 0.0) & u64::from(squared <= self.squared_reach);
            }
            if stop.is_over() {
                *pruned += newly_pruned;
                return Err(Stopped);
            }
        }
    }

    /// The placement in the object's frame, if its measures are in range. Tests run in order of cost: bounds from the box
    /// come before closest-point queries.
    fn accept(&self, draft: &Draft, box_from_wrist: Quat) -> Option<WristFrame> {
        let axes = Mat3::from_quat(box_from_wrist);
        let palm = draft.position + axes * self.palm;
        if self.is_on_givers_side(palm)
            || self.strategy.prunes_by_object() && self.is_ruled_out_by_box(draft, &axes, palm)
        {
            return None;
        }
        let wrist = WristFrame::new(Pose {
            position: self.object_from_box.transform_point(draft.position),
            orientation: (self.object_from_box.orientation * box_from_wrist).normalize(),
        });
        (!self.strategy.prunes_by_object() || self.is_in_range_of_object(&wrist, draft.box_distance))
            .then_some(wrist)
    }

    /// True if the palm-CoM-palm angle is below 90°: the ground-plane projections of the two arms then have a positive
    /// dot product, for which projecting one of them suffices. A zero arm gives 0, which is in range.
    fn is_on_givers_side(&self, palm: Vec3) -> bool {
        self.toward_giver
            .is_some_and(|toward_giver| (palm - self.centre_of_mass).dot(toward_giver) > 0.0)
    }

    /// True if the box alone proves a measure out of range, given that H' lies in the box. All in the frame of B.
    fn is_ruled_out_by_box(&self, draft: &Draft, axes: &Mat3, palm: Vec3) -> bool {
        let outside = (palm.abs() - self.half_extents).max(Vec3::ZERO);
        let max_palm_distance = PALM_DISTANCE.max + BOUND_SLACK;
        if outside.length_squared() > max_palm_distance * max_palm_distance {
            return true;
        }
        // Largest and smallest possible axis · (H' - O).
        let highest = |axis: Vec3| axis.abs().dot(self.half_extents) - axis.dot(draft.position);
        let lowest = |axis: Vec3| -axis.abs().dot(self.half_extents) - axis.dot(draft.position);
        // |H' - O| is at least the distance from O to the box, and at most this.
        let farthest = self.palm.length() + max_palm_distance;
        highest(axes.y_axis) < self.cosines.upward_max * draft.box_distance - BOUND_SLACK
            || highest(axes.z_axis) < self.cosines.forward_max * farthest - BOUND_SLACK
            || lowest(axes.z_axis) > self.cosines.forward_min * farthest + BOUND_SLACK
    }

    /// True if the five measures relative to the object are in range.
    fn is_in_range_of_object(&self, wrist: &WristFrame, box_distance: f32) -> bool {
        let surface = &self.object.surface;
        let position = wrist.object_from_wrist.position;
        let palm = wrist.transform_point(self.palm);
        let Some(closest) = surface.closest_point_within(palm, PALM_DISTANCE.max) else {
            return false;
        };
        let to_object = closest.position - position;
        let distance = to_object.length();
        if !self.cosines.admit(
            wrist.rotation.y_axis.dot(to_object),
            wrist.rotation.z_axis.dot(to_object),
            distance,
        ) {
            return false;
        }
        // The wrist's distance from the object lies between its distances from the box and from H', which usually
        // decides.
        (distance <= WRIST_DISTANCE.max
            || surface
                .closest_point_within(position, WRIST_DISTANCE.max)
                .is_some())
            && (box_distance > WRIST_DISTANCE.min + BOUND_SLACK
                || surface
                    .closest_point_within(position, WRIST_DISTANCE.min)
                    .is_none_or(|closest| closest.distance >= WRIST_DISTANCE.min))
    }
}

impl AngleCosines {
    /// True if the two wrist angles and their sum are in range, given the components of H' - O along the wrist's +y and +z
    /// and its length.
    fn admit(&self, upward: f32, forward: f32, length: f32) -> bool {
        if upward < self.upward_max * length
            || forward < self.forward_max * length
            || forward > self.forward_min * length
        {
            return false;
        }
        // cos(u + f) decreases with the sum, which is at most 55° + 95° here.
        let squared = length * length;
        let sines = ((squared - upward * upward).max(0.0) * (squared - forward * forward).max(0.0)).sqrt();
        upward * forward - sines >= self.sum_max * squared
    }
}

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
