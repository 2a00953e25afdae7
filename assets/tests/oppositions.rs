//! The oppositions that the built-in hands know: pads are where the solids of the hand have their skin.

use grasp_assets::hands::hand;
use grasp_synthesis::{
    base::{pose::Pose, random::AttemptStream},
    model::hand::{Digit, HandPose, Handedness, rig::Rig},
    physical::solids::{HandSolids, TaperedCapsule},
    propose::opposition::Oppositions,
};

/// Widths in metres: a blade, a pen, a box, a bottle.
const WIDTHS: [f32; 4] = [0.004, 0.010, 0.025, 0.06];

const ROOM: f32 = 0.004;

fn rig(side: Handedness) -> &'static Rig {
    &hand("adult", side).expect("the rig is built in").rig
}

fn off_the_skin(links: &[TaperedCapsule], point: glam::Vec3) -> f32 {
    links
        .iter()
        .map(|link| link.signed_distance(point).abs())
        .fold(f32::INFINITY, f32::min)
}

#[test]
fn pads_meet_at_every_width_and_lie_on_the_skin() {
    for side in [Handedness::Left, Handedness::Right] {
        let rig = rig(side);
        let known = Oppositions::of(rig);
        for width in WIDTHS {
            let mut seen = Vec::new();
            for draw in 0..200 {
                let room = [width - ROOM, width + ROOM];
                let drawn = known.draw(room, &mut AttemptStream::new(5, draw));
                let drawn = drawn.unwrap_or_else(|| panic!("none at {width} m"));
                assert!((room[0]..=room[1]).contains(&drawn.width()), "{drawn:?}");
                let pose = HandPose {
                    frame_from_wrist: Pose::IDENTITY,
                    digits: Digit::ALL.map(|digit| {
                        let closed = drawn.closed[usize::from(digit != Digit::Thumb)];
                        drawn.shape.flexing(rig, digit).closed_by(closed)
                    }),
                };
                let [thumb, index, middle, ..] = HandSolids::of_pose(rig, &pose).phalanges;
                assert!(off_the_skin(&thumb, drawn.thumb) < 0.0015, "{drawn:?}");
                // Between two fingers, or on one: half the gap between spread fingers off at most.
                let off = off_the_skin(&index, drawn.fingers).min(off_the_skin(&middle, drawn.fingers));
                assert!(off < 0.012, "{off} m off: {drawn:?}");
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

#[test]
fn the_same_hand_knows_the_same() {
    let [first, second] = [(); 2].map(|()| Oppositions::of(rig(Handedness::Right)));
    for draw in 0..50 {
        let draw = |known: &Oppositions| known.draw([0.0, 0.2], &mut AttemptStream::new(9, draw)).copied();
        assert_eq!(draw(&first), draw(&second));
        assert!(draw(&first).is_some());
    }
}
