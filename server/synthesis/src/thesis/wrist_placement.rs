//! Step 1, Wrist Placement: Algorithm 2 (`PLACEWRISTFRAME`) and, from strategy B on, Algorithm 11
//! (`MODIFIEDPLACEWRISTFRAME`).
//!
//! Positions are uniform in C - B and rotations uniform among all rotations, where B is the object's bounding box and C
//! is everything within the hand's reach of B. From strategy B on, placements are drawn until all measures of one are
//! in range. O is the wrist, H the centre of the palm's skin; O' and H' are the closest points of the object.
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

/// Margin in metres by which a bound must be violated to prune a placement: well above rounding error.
const BOUND_SLACK: f32 = 1e-5;

/// Positions drawn between two checks of the stop signal, which are some microseconds apart.
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

impl<'a> WristPlacer<'a> {
    /// Prepares placements at a holdout under a strategy.
    pub fn new(holdout: &'a Holdout, rig: &Rig, strategy: Strategy) -> Self {
        let object = &*holdout.object;
        let box_from_object = object.bounding_box.object_from_box.inverse();
        let toward_giver = holdout
            .presenting_hand
            .as_ref()
            .filter(|_| strategy >= Strategy::C)
            .map(|hand| {
                let arm = hand.palm - object.centre_of_mass;
                box_from_object.transform_vector(arm - holdout.up * arm.dot(holdout.up))
            });
        let cos = |degrees: f32| degrees.to_radians().cos();
        let max_distance = if strategy >= Strategy::B {
            rig.reach.min(WRIST_DISTANCE[1] + BOUND_SLACK)
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
                upward_max: cos(MAX_UPWARD_DEGREES),
                forward_min: cos(FORWARD_DEGREES[0]),
                forward_max: cos(FORWARD_DEGREES[1]),
                sum_max: cos(MAX_SUM_DEGREES),
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
                    let accepted = self.accept(position, squared.sqrt(), stream.rotation());
                    if let Some(wrist) = accepted {
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

    /// The placement in the object's frame, if its measures are in range; `position` is in the frame of B. Cheap tests come first.
    fn accept(&self, position: Vec3, box_distance: f32, box_from_wrist: Quat) -> Option<WristFrame> {
        let axes = Mat3::from_quat(box_from_wrist);
        let palm = position + axes * self.palm;
        if self.is_on_givers_side(palm)
            || self.strategy >= Strategy::B && self.is_ruled_out_by_box(position, box_distance, &axes, palm)
        {
            return None;
        }
        let wrist = WristFrame::new(Pose {
            position: self.object_from_box.transform_point(position),
            orientation: (self.object_from_box.orientation * box_from_wrist).normalize(),
        });
        (self.strategy < Strategy::B || self.is_in_range_of_object(&wrist, box_distance)).then_some(wrist)
    }

    /// True if the palm-CoM-palm angle is below 90°: the dot product of the arms' ground-plane projections is positive.
    fn is_on_givers_side(&self, palm: Vec3) -> bool {
        self.toward_giver
            .is_some_and(|toward_giver| (palm - self.centre_of_mass).dot(toward_giver) > 0.0)
    }

    /// True if the box alone proves a measure out of range, given that H' lies in the box. All in the frame of B.
    fn is_ruled_out_by_box(&self, position: Vec3, box_distance: f32, axes: &Mat3, palm: Vec3) -> bool {
        let outside = (palm.abs() - self.half_extents).max(Vec3::ZERO);
        let max_palm_distance = MAX_PALM_DISTANCE + BOUND_SLACK;
        if outside.length_squared() > max_palm_distance * max_palm_distance {
            return true;
        }
        // Largest and smallest possible axis · (H' - O).
        let highest = |axis: Vec3| axis.abs().dot(self.half_extents) - axis.dot(position);
        let lowest = |axis: Vec3| -axis.abs().dot(self.half_extents) - axis.dot(position);
        // |H' - O| is at least the distance from O to the box, and at most this.
        let farthest = self.palm.length() + max_palm_distance;
        highest(axes.y_axis) < self.cosines.upward_max * box_distance - BOUND_SLACK
            || highest(axes.z_axis) < self.cosines.forward_max * farthest - BOUND_SLACK
            || lowest(axes.z_axis) > self.cosines.forward_min * farthest + BOUND_SLACK
    }

    /// True if the five measures relative to the object are in range.
    fn is_in_range_of_object(&self, wrist: &WristFrame, box_distance: f32) -> bool {
        let surface = &self.object.surface;
        let position = wrist.object_from_wrist.position;
        let palm = wrist.transform_point(self.palm);
        let Some(closest) = surface.closest_point_within(palm, MAX_PALM_DISTANCE) else {
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
        (distance <= WRIST_DISTANCE[1]
            || surface
                .closest_point_within(position, WRIST_DISTANCE[1])
                .is_some())
            && (box_distance > WRIST_DISTANCE[0] + BOUND_SLACK
                || surface
                    .closest_point_within(position, WRIST_DISTANCE[0])
                    .is_none_or(|closest| closest.distance >= WRIST_DISTANCE[0]))
    }
}

impl AngleCosines {
    /// True if both wrist angles and their sum are in range, for the length of H' - O and its components along +y and +z.
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

/// Range of the distance in metres from the wrist O to the object (Table 5.3). A wider range prunes fewer placements, and
/// finger posing fails on more of them.
pub const WRIST_DISTANCE: [f32; 2] = [0.0075, 0.12];

/// Largest distance in metres from the palm H to the object (Table 5.3; the text of 5.3 gives two other ranges).
const MAX_PALM_DISTANCE: f32 = 0.08;

/// Largest angle in degrees between the wrist's upward vector +y and H' - O (Table 5.3).
const MAX_UPWARD_DEGREES: f32 = 55.0;

/// Range of the angle in degrees between the wrist's forward vector +z and H' - O (Table 5.3).
const FORWARD_DEGREES: [f32; 2] = [35.0, 95.0];

/// Largest sum of these two angles in degrees (Table 5.3). The least, 90, always holds, since +y and +z are perpendicular.
const MAX_SUM_DEGREES: f32 = 115.0;
