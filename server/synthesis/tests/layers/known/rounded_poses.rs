//! Contacts of grips whose poses were rounded, as on the way to a client and back.

use crate::prelude::*;

/// Rounding of a pose of coordinates below a metre.
const ROUNDING: f32 = 6e-8;

/// The parts of a posed hand that touch the scissors.
fn touching(gripper: &mut Gripper, rig: &Rig, pose: &HandPose) -> Vec<HandPart> {
    let scene = object_scene(object("scissors"));
    let _ = gripper.hold_as_posed(&scene, rig, pose, &NO_GIVER, |_, _| true);
    gripper.contacts.iter().map(|contact| contact.part).collect()
}

#[test]
fn rounded_poses_touch_with_the_same_parts() {
    let mut gripper = Gripper::default();
    for side in [Handedness::Left, Handedness::Right] {
        let rig = adult(side);
        for (place, entry) in shipped_atlas_of("scissors", rig).entries().iter().enumerate() {
            let own = touching(&mut gripper, rig, &entry.grip.pose);
            let mut stream = AttemptStream::new(7, place as u64);
            for _ in 0..4 {
                let mut some =
                    || Vec3::from_array(std::array::from_fn(|_| stream.between(-ROUNDING, ROUNDING)));
                let wrist = entry.grip.pose.frame_from_wrist;
                let rounded = HandPose {
                    frame_from_wrist: Pose::new(
                        wrist.position + some(),
                        (Quat::from_scaled_axis(some()) * wrist.orientation).normalize(),
                    ),
                    ..entry.grip.pose
                };
                assert_eq!(touching(&mut gripper, rig, &rounded), own, "{side:?} {place}");
            }
        }
    }
}
