//! Oppositions of the built-in hands: pads lie on the skin of the hand's solids.

use grasp_synthesis::propose::opposition::Oppositions;

use crate::prelude::*;

/// Widths in metres: a blade, a pen, a box, a bottle.
const WIDTHS: [f32; 4] = [0.004, 0.010, 0.025, 0.06];

/// How far pads may be from the width, in metres.
const ROOM: f32 = 0.004;

fn distance_from_skin(links: &[TaperedCapsule], point: Vec3) -> f32 {
    links
        .iter()
        .map(|link| link.signed_distance(point).abs())
        .fold(f32::INFINITY, f32::min)
}

#[test]
fn pads_oppose_at_every_width_and_lie_on_the_skin() {
    for side in [Handedness::Left, Handedness::Right] {
        let rig = adult(side);
        let known = Oppositions::of(rig);
        for width in WIDTHS {
            let mut seen = Vec::new();
            for draw in 0..200 {
                let room = [width - ROOM, width + ROOM];
                let drawn = known.draw(room, &mut AttemptStream::new(5, draw));
                let drawn = drawn.unwrap_or_else(|| panic!("none at {width} m"));
                assert!((room[0]..=room[1]).contains(&drawn.width()), "{drawn:?}");
                let pose = hand_pose(
                    Pose::IDENTITY,
                    Digit::ALL.map(|digit| {
                        let closed = drawn.closed[usize::from(digit != Digit::Thumb)];
                        drawn.shape.flexing(rig, digit).closed_by(closed)
                    }),
                );
                let [thumb, index, middle, ..] = HandSolids::of_pose(rig, &pose).phalanges;
                assert!(distance_from_skin(&thumb, drawn.thumb) < 0.0015, "{drawn:?}");
                // On a finger, or between two: within half the gap of spread fingers.
                let distance =
                    distance_from_skin(&index, drawn.fingers).min(distance_from_skin(&middle, drawn.fingers));
                assert!(distance < 0.012, "{distance} m off: {drawn:?}");
                for digit in [0, 1] {
                    assert!(drawn.shape.preshape[digit] <= drawn.closed[digit], "{drawn:?}");
                }
                assert!(drawn.shape.closing[0] && drawn.shape.closing[1], "{drawn:?}");
                if !seen.contains(&drawn.shape.closing) {
                    seen.push(drawn.shape.closing);
                }
            }
            assert!(seen.len() >= 3, "only {seen:?} at {width} m");
        }
    }
}
