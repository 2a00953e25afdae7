//! Step 1, Wrist Placement: Algorithm 2 (`PLACEWRISTFRAME`) and, from strategy B on, Algorithm 11
//! (`MODIFIEDPLACEWRISTFRAME`).
//!
//! A position is drawn uniformly from C - B and a rotation uniformly from all rotations; B is the object's box and C
//! holds everything within the hand's reach of B. From strategy B on, placements are drawn until one has all its
//! measures in range ([`super::placement_measures`]).
//!
//! Algorithm 11 as printed rejects positions outside the box; what 4.3 describes is the opposite, and that is done.

use glam::{Mat3, Quat, Vec3};

use super::placement_measures::{
    FORWARD_WRIST_ANGLE_DEGREES, PALM_DISTANCE, UPWARD_WRIST_ANGLE_DEGREES, WRIST_ANGLE_SUM_DEGREES,
    WRIST_DISTANCE,
};
use crate::{
    base::{pose::Pose, random::AttemptStream},
    model::{hand::rig::Rig, holdout::Holdout, object::GraspObject, strategy::Strategy},
};

/// Room, in metres, by which a bound must be broken before it prunes a placement in place of the measure that it
/// bounds: far more than rounding and far less than matters. Without it the cheap order of checks could reject what
/// the plain order keeps.
const BOUND_SLACK: f32 = 1e-5;

/// Draws of a position between two looks at the stop signal, while no placement is accepted. A draw takes a few
/// nanoseconds and every tenth or so leads to measures, of about 100 ns on a mesh of a few thousand triangles: some
/// microseconds between looks. More make stopping slower, fewer searching.
const DRAWS_PER_LOOK: u32 = 256;

/// A placed wrist: F0 in the object's frame, as a pose and as a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WristFrame {
    /// The pose.
    pub object_from_wrist: Pose,
    /// The rotation of the pose; its columns are the wrist's axes.
    pub rotation: Mat3,
}

impl WristFrame {
    /// The frame at a pose.
    pub fn new(object_from_wrist: Pose) -> Self {
        Self {
            object_from_wrist,
            rotation: Mat3::from_quat(object_from_wrist.orientation),
        }
    }

    /// A point of the wrist frame in the object's frame.
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
    /// Square of the distance from B up to which a position is worth a rotation.
    squared_near: f32,
    object_from_box: Pose,
    half_extents: Vec3,
    /// The centre of mass in the frame of B.
    centre_of_mass: Vec3,
    /// From the centre of mass to the giver's palm, seen on the ground plane, in the frame of B; none if the angle
    /// between the palms is not looked at.
    toward_giver: Option<Vec3>,
    cosines: AngleCosines,
}

/// The cosines of the ends of Table 5.3's angle ranges.
#[derive(Clone, Copy, Debug)]
struct AngleCosines {
    upward_max: f32,
    forward_min: f32,
    forward_max: f32,
    sum_max: f32,
}

/// A placement before its position is known in the object's frame: everything in the frame of B.
#[derive(Clone, Copy, Debug)]
struct Draft {
    position: Vec3,
    /// Distance from the box; never 0, as positions inside are not drawn.
    box_distance: f32,
}

impl<'a> WristPlacer<'a> {
    /// Prepares the drawing of placements for a strategy.
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
        let near = if strategy.prunes_by_object() {
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
            squared_near: near * near,
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

    /// `PLACEWRISTFRAME` with the strategy's pruning. None if `interrupted` says so before a placement is accepted;
    /// `pruned` counts the pruned placements in either case.
    pub fn place(
        &self,
        stream: &mut AttemptStream,
        interrupted: &impl Fn() -> bool,
        pruned: &mut u64,
    ) -> Option<WristFrame> {
        let mut refused = 0;
        loop {
            for _ in 0..DRAWS_PER_LOOK {
                // Uniform in the box around C. A position outside C - B is drawn again. One in there but too far from
                // the box is too far from the object, and pruned before it is given a rotation. As these two are most
                // of what happens here and come in random order, they share one branch.
                let position = stream.in_cube() * (self.half_extents + self.reach);
                let outside = (position.abs() - self.half_extents).max(Vec3::ZERO);
                let squared = outside.length_squared();
                if squared <= self.squared_near && squared > 0.0 {
                    let draft = Draft {
                        position,
                        box_distance: squared.sqrt(),
                    };
                    if let Some(wrist) = self.accept(&draft, stream.rotation()) {
                        *pruned += refused;
                        return Some(wrist);
                    }
                }
                refused += u64::from(squared > 0.0) & u64::from(squared <= self.squared_reach);
            }
            if interrupted() {
                *pruned += refused;
                return None;
            }
        }
    }

    /// The placement in the object's frame, if its measures are in range. The order is by cost: what the box alone can
    /// tell comes before the search for closest points. `box_from_wrist` is the rotation.
    fn accept(&self, draft: &Draft, box_from_wrist: Quat) -> Option<WristFrame> {
        let axes = Mat3::from_quat(box_from_wrist);
        let palm = draft.position + axes * self.palm;
        if self.is_on_givers_side(palm)
            || self.strategy.prunes_by_object() && self.is_hopeless(draft, &axes, palm)
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

    /// True if the palm-CoM-palm angle is below 90°: the projections of the two arms onto the ground plane then have a
    /// positive product, and it is enough to project one of them. An arm that vanishes gives 0, which is in range.
    fn is_on_givers_side(&self, palm: Vec3) -> bool {
        self.toward_giver
            .is_some_and(|toward_giver| (palm - self.centre_of_mass).dot(toward_giver) > 0.0)
    }

    /// True if the box alone shows that a measure is out of range, since H' is a point of the box. All in the frame of B.
    fn is_hopeless(&self, draft: &Draft, axes: &Mat3, palm: Vec3) -> bool {
        let outside = (palm.abs() - self.half_extents).max(Vec3::ZERO);
        let max_palm_distance = PALM_DISTANCE.max + BOUND_SLACK;
        if outside.length_squared() > max_palm_distance * max_palm_distance {
            return true;
        }
        // The largest and the smallest that axis · (H' - O) can be.
        let highest = |axis: Vec3| axis.abs().dot(self.half_extents) - axis.dot(draft.position);
        let lowest = |axis: Vec3| -axis.abs().dot(self.half_extents) - axis.dot(draft.position);
        // |H' - O| is at least the distance from O to the box, and at most this:
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
        if !self.cosines.hold(
            wrist.rotation.y_axis.dot(to_object),
            wrist.rotation.z_axis.dot(to_object),
            distance,
        ) {
            return false;
        }
        // The wrist is at most as far from the object as H' is, and at least as far as from the box: mostly that
        // settles its distance.
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
    /// True if the two wrist angles and their sum are in range for a vector H' - O with these components along the
    /// wrist's +y and +z, and this length.
    fn hold(&self, upward: f32, forward: f32, length: f32) -> bool {
        if upward < self.upward_max * length
            || forward < self.forward_max * length
            || forward > self.forward_min * length
        {
            return false;
        }
        // cos(u + f) falls with the sum, which is at most 55° + 95° here.
        let squared = length * length;
        let sines = ((squared - upward * upward).max(0.0) * (squared - forward * forward).max(0.0)).sqrt();
        upward * forward - sines >= self.sum_max * squared
    }
}
