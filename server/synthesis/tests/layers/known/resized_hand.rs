//! Hands that somebody posed, on the same object at another size.

use grasp_synthesis::{known::resized_hand::on_resized, physical::grip::PosedDigits};

use crate::prelude::*;

/// Half the edges of the bar, in metres.
const HALF: Vec3 = Vec3::new(0.015, 0.08, 0.015);

#[test]
fn a_hand_follows_the_surface_with_the_same_digits() {
    let own = Arc::new(bar());
    let grown = grown_to(&own, right(), 60).kept();
    let scene = object_scene(&own);
    let mut gripper = Gripper::default();
    for scale in [0.8, 1.05, 1.2, 1.5] {
        let other = resized(&own, scale);
        let on_other = object_scene(&other);
        let (mut all, mut held, mut alike) = (0, 0, 0);
        for entry in grown.atlas.entries().iter().step_by(3) {
            let pose = &entry.grip.pose;
            let hand = on_resized([&scene, &on_other], scale, right(), pose);
            all += 1;
            let Ok((grip, _)) =
                gripper.hold_posed(&on_other, right(), &hand, &NO_GIVER, PosedDigits::Settled)
            else {
                continue;
            };
            held += 1;
            alike += usize::from(grip.holding_digits() == entry.grip.holding_digits());
            for contact in &gripper.contacts {
                let beyond = contact.position.abs() - scale * HALF;
                assert!(beyond.max_element().abs() < 1e-4, "{scale}: {beyond}");
            }
            // The wrist keeps its place at the surface, but for what the digits need.
            let grown_by = (scale - 1.0).abs() * pose.frame_from_wrist.position.length();
            let shift = hand
                .frame_from_wrist
                .position
                .distance(pose.frame_from_wrist.position);
            assert!(shift < grown_by + 0.02, "{scale}: {shift} m");
        }
        println!("{scale}: {held} of {all} hold, {alike} with the same digits");
        assert!(10 * held >= 9 * all, "{scale}: {held} of {all}");
    }
}
