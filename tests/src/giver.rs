//! Places a recorded hand on an object so that it holds it, as a giver would.
//!
//! A seeded random search followed by a pattern search over the wrist's pose: the hand is a set of spheres along its
//! bones, and the cost asks that digits and palm touch the surface, that nothing sinks in, and that the hand stays
//! near one end, so that a receiver finds room at the other.

use glam::{Quat, Vec3};
use grasp_synthesis::{
    hand::joints::{HandJoints, index},
    object::GraspObject,
    pose::Pose,
};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

/// A hand on an object.
#[derive(Clone, Copy, Debug)]
pub struct GiverPlacement {
    /// The wrist's `OpenXR` frame in the object's frame.
    pub object_from_wrist: Pose,
    /// How deep the hand's skin is in the object at worst, in metres.
    pub penetration: f32,
    /// How many digits come within [`TOUCH`] of the surface.
    pub touching_digits: usize,
}

/// Skin closer to the surface than this counts as touching, in metres.
pub const TOUCH: f32 = 0.004;

/// A sphere of the hand's volume.
struct Ball {
    /// In the wrist's frame.
    centre: Vec3,
    radius: f32,
    /// 0 to 4, or none for the palm.
    digit: Option<usize>,
}

/// Spheres at the joints and midway between neighbours of a digit, and across the palm.
fn balls(joints: &HandJoints) -> Vec<Ball> {
    let at = |i: usize| (joints.joints[i].pose.position, joints.joints[i].radius);
    let mut balls = Vec::new();
    for digit in 0..5 {
        let first = index::FIRST_OF_DIGIT[digit];
        for joint in first..=index::TIP_OF_DIGIT[digit] {
            let (centre, radius) = at(joint);
            // A finger's metacarpal belongs to the palm.
            let owner = (digit == 0 || joint > first).then_some(digit);
            balls.push(Ball {
                centre,
                radius,
                digit: owner,
            });
            if joint < index::TIP_OF_DIGIT[digit] {
                let (next, next_radius) = at(joint + 1);
                balls.push(Ball {
                    centre: centre.midpoint(next),
                    radius: radius.midpoint(next_radius),
                    digit: owner,
                });
            }
        }
    }
    balls
}

/// Signed distance from the surface in metres, negative inside; exact up to 5 cm.
fn signed_distance(object: &GraspObject, point: Vec3) -> f32 {
    const FAR: f32 = 0.05;
    let outside_box = object.bounding_box.distance(point);
    if outside_box > FAR {
        return outside_box;
    }
    let distance = object
        .surface
        .closest_point_within(point, FAR)
        .map_or(FAR, |closest| closest.distance);
    if object.surface.contains(point) {
        -distance
    } else {
        distance
    }
}

struct Judged {
    cost: f32,
    placement: GiverPlacement,
}

fn judge(object: &GraspObject, balls: &[Ball], object_from_wrist: Pose) -> Judged {
    let mut gap_of_digit = [f32::INFINITY; 5];
    let mut palm_gap = f32::INFINITY;
    let mut sunk = 0.0;
    let mut penetration: f32 = 0.0;
    for ball in balls {
        let gap = signed_distance(object, object_from_wrist.transform_point(ball.centre)) - ball.radius;
        let slot = ball.digit.map_or(&mut palm_gap, |digit| &mut gap_of_digit[digit]);
        *slot = slot.min(gap);
        if gap < 0.0 {
            sunk += gap * gap;
            penetration = penetration.max(-gap);
        }
    }
    // The thumb and the two best fingers should touch; the palm may.
    let mut fingers = [gap_of_digit[1], gap_of_digit[2], gap_of_digit[3], gap_of_digit[4]];
    fingers.sort_by(f32::total_cmp);
    let away = |gap: f32| gap.clamp(0.0, 0.05);
    let reach = away(gap_of_digit[0]) + away(fingers[0]) + 0.5 * away(fingers[1]) + 0.1 * away(palm_gap);
    let touching_digits = gap_of_digit.iter().filter(|&&gap| gap < TOUCH).count();
    Judged {
        // 1 mm of gap weighs as much as 1 mm of depth of ten spheres.
        cost: reach + 100.0 * sunk,
        placement: GiverPlacement {
            object_from_wrist,
            penetration,
            touching_digits,
        },
    }
}

/// The best placement that the search finds; the same for the same arguments.
pub fn place_giver(object: &GraspObject, joints: &HandJoints, seed: u64) -> GiverPlacement {
    const STARTS: usize = 1500;
    const REFINED: usize = 12;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let balls = balls(joints);
    let position = |i: usize| joints.joints[i].pose.position;
    // Where things are held: between the thumb's tip and those of index and middle finger.
    let grip = (2.0 * position(index::TIP_OF_DIGIT[0])
        + position(index::TIP_OF_DIGIT[1])
        + position(index::TIP_OF_DIGIT[2]))
        / 4.0;
    let half = object.bounding_box.half_extents;
    let long_axis = if half.x >= half.y && half.x >= half.z {
        Vec3::X
    } else if half.y >= half.z {
        Vec3::Y
    } else {
        Vec3::Z
    };
    let end = if random.random::<bool>() { 1.0 } else { -1.0 };
    let mut starts: Vec<Judged> = (0..STARTS)
        .map(|_| {
            let mut unit = || random.random::<f32>();
            let along = end * (0.3 + 0.5 * unit()) * half.dot(long_axis);
            let across = (Vec3::new(unit(), unit(), unit()) - 0.5) * half * (Vec3::ONE - long_axis);
            let target = object
                .bounding_box
                .object_from_box
                .transform_point(along * long_axis + across);
            let orientation = random_rotation(&mut random);
            judge(
                object,
                &balls,
                Pose::new(target - orientation * grip, orientation),
            )
        })
        .collect();
    starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    starts
        .into_iter()
        .take(REFINED)
        .map(|start| refine(object, &balls, start))
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
        .expect("there are starts")
        .placement
}

/// Pattern search: steps along and about each axis, halved when none helps.
fn refine(object: &GraspObject, balls: &[Ball], start: Judged) -> Judged {
    let mut best = start;
    let (mut shift, mut turn) = (0.01_f32, 0.3_f32);
    while shift > 0.0002 {
        let from = best.placement.object_from_wrist;
        let mut improved = false;
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for sign in [-1.0, 1.0] {
                let moved = Pose::new(from.position + sign * shift * axis, from.orientation);
                // Turned about the middle of the hand's balls, not about the wrist.
                let pivot =
                    from.transform_point(balls.iter().map(|b| b.centre).sum::<Vec3>() / balls.len() as f32);
                let rotation = Quat::from_axis_angle(axis, sign * turn);
                let turned = Pose::new(
                    pivot + rotation * (from.position - pivot),
                    (rotation * from.orientation).normalize(),
                );
                for candidate in [moved, turned] {
                    let judged = judge(object, balls, candidate);
                    if judged.cost < best.cost {
                        best = judged;
                        improved = true;
                    }
                }
            }
        }
        if !improved {
            shift *= 0.5;
            turn *= 0.5;
        }
    }
    best
}

/// Uniform over all rotations (Shoemake 1992, "Uniform random rotations").
pub(crate) fn random_rotation(random: &mut Xoshiro256PlusPlus) -> Quat {
    use std::f32::consts::TAU;
    let (u, v, w) = (
        random.random::<f32>(),
        TAU * random.random::<f32>(),
        TAU * random.random::<f32>(),
    );
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    Quat::from_xyzw(a * v.sin(), a * v.cos(), b * w.sin(), b * w.cos())
}
