//! Turns a hold so that a person current at -Z could hold it out toward +Z.

use glam::{Quat, Vec3};
use grasp_synthesis::model::hand::HandPose;

use super::halton::halton;

/// Orientations tried, about 9° apart.
const TRIED: u32 = 6000;

/// Where the forearm of a right hand comes from when its owner stands at -Z and faces +Z: from behind, somewhat from
/// below (the elbow hangs lower than the hand) and from the owner's right, which is -X.
const FOREARM_FROM: Vec3 = Vec3::new(-0.25, -0.35, -1.0);

/// An orientation of a hold, and how awkward it is for the giver: 0 is best, above 1 looks odd.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GiverOrientation {
    /// The object's orientation in the world.
    pub(crate) world_from_object: Quat,
    /// How awkward it is.
    pub(crate) awkwardness: f32,
}

/// All orientations of a right hand's hold, least awkward first. `offered` is the direction that should point to the
/// receiver; it and the hand are in the object's frame.
pub(crate) fn giver_orientations(hand: &HandPose, offered: Vec3) -> Vec<GiverOrientation> {
    let orientation = hand.frame_from_wrist.orientation;
    let (forearm, thumbward) = (orientation * Vec3::NEG_Y, orientation * Vec3::X);
    let from = FOREARM_FROM.normalize_or(Vec3::NEG_Z);
    let mut orientations: Vec<GiverOrientation> = (1..=TRIED)
        .map(|i| {
            let world_from_object = spread_rotation(i);
            let forearm = world_from_object * forearm;
            let thumbward = world_from_object * thumbward;
            let offered = world_from_object * offered;
            // The wrist bends about 30° to every side before the forearm has to follow.
            let arm = (30.0_f32.to_radians().cos() - forearm.dot(from)).max(0.0);
            // A thumb that points down needs a shoulder turned inward.
            let pronation = (-thumbward.y - 0.1).max(0.0);
            let away = (1.0 - offered.z) * 0.7;
            GiverOrientation {
                world_from_object,
                awkwardness: arm * 1.5 + pronation * 1.5 + away,
            }
        })
        .collect();
    orientations.sort_by(|a, b| a.awkwardness.total_cmp(&b.awkwardness));
    orientations
}

/// Evenly spread rotations (Shoemake, Uniform Random Rotations, Graphics Gems III).
fn spread_rotation(index: u32) -> Quat {
    let (u, v, w) = (halton(index, 2), halton(index, 3), halton(index, 5));
    let tau = std::f64::consts::TAU;
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    Quat::from_xyzw(
        (a * (tau * v).sin()) as f32,
        (a * (tau * v).cos()) as f32,
        (b * (tau * w).sin()) as f32,
        (b * (tau * w).cos()) as f32,
    )
    .normalize()
}
