//! Finger Posing against a slow reference: plain stepping, plain forward kinematics, no culls.

use grasp_synthesis::{
    geometry::mesh_bvh::SegmentHit,
    thesis::{
        finger_posing::{PosedDigit, find_touching_finger_pose, hand_motion, missing_contacts},
        wrist_placement::{WristFrame, WristPlacer},
    },
};

use crate::prelude::*;

/// The end of closing.
#[derive(Debug, PartialEq)]
struct Closed {
    angles: DigitAngles,
    ratio: Option<f32>,
    hits: [Option<SegmentHit>; 3],
}

/// Where the links touch in a pose.
fn hits(object: &GraspObject, digit: &DigitRig, wrist: Pose, angles: DigitAngles) -> [Option<SegmentHit>; 3] {
    let frames = digit_frames(digit, wrist, angles);
    std::array::from_fn(|link| {
        let offset = digit.diameters[link] / 2.0;
        object.surface.first_hit(Segment::new(
            frames.links[link].transform_point(Vec3::new(0.0, 0.0, offset)),
            frames.links[link].transform_point(Vec3::new(0.0, digit.lengths[link], offset)),
        ))
    })
}

/// Thesis 4.4, step by step.
fn close_slowly(object: &GraspObject, digit: &DigitRig, wrist: Pose, yaw: f32, ratios: &[f32]) -> Closed {
    let limits = &digit.limits;
    let pose = |base: f32, bend: f32, ratio: f32| {
        let second =
            (limits.second_pitch.min.to_degrees() + ratio * bend).min(limits.second_pitch.max.to_degrees());
        DigitAngles::coupled(yaw, base.to_radians(), second.to_radians())
    };
    let (first, last) = (
        limits.base_pitch.min.to_degrees(),
        limits.base_pitch.max.to_degrees(),
    );
    for &ratio in ratios {
        let mut bend = 0.0;
        while first + bend < last - 0.01 {
            let angles = pose(first + bend, bend, ratio);
            let touching = hits(object, digit, wrist, angles);
            let closed = |angles, hits| Closed {
                angles,
                ratio: Some(ratio),
                hits,
            };
            if touching[1].is_some() || touching[2].is_some() {
                return closed(angles, touching);
            }
            if touching[0].is_some() {
                // The base stays.
                let base = first + bend;
                let mut angles = angles;
                let mut outer = [None; 2];
                while outer == [None; 2] && angles.second_pitch < limits.second_pitch.max - 1e-4 {
                    bend += 5.0;
                    angles = pose(base, bend, ratio);
                    let [_, second, third] = hits(object, digit, wrist, angles);
                    outer = [second, third];
                }
                return closed(angles, [touching[0], outer[0], outer[1]]);
            }
            bend += 5.0;
        }
    }
    Closed {
        angles: pose(first, 0.0, 1.0),
        ratio: None,
        hits: [None; 3],
    }
}

fn near(posed: &PosedDigit, slow: &Closed) -> bool {
    let angles = |a: DigitAngles| Vec3::new(a.base_pitch, a.second_pitch, a.third_pitch);
    let same_hit = |(a, b): (&Option<SegmentHit>, &Option<SegmentHit>)| match (a, b) {
        (None, None) => true,
        // At an edge either neighbour may be hit.
        (Some(a), Some(b)) => a.position.distance(b.position) < 1e-5,
        _ => false,
    };
    posed.bend_ratio == slow.ratio
        && (angles(posed.angles) - angles(slow.angles)).length() < 1e-5
        && posed.angles.base_yaw == slow.angles.base_yaw
        && posed.hits.iter().zip(&slow.hits).all(same_hit)
}

/// Wrists placed by strategies A and B; hands of B touch more often.
fn wrists(holdout: &Holdout) -> Vec<WristFrame> {
    let placed = [(Strategy::A, 100), (Strategy::B, 400)].map(|(strategy, count)| {
        let placer = WristPlacer::new(holdout, simple_rig(), strategy);
        let place = |attempt| placer.place(&mut AttemptStream::new(4, attempt), Stop::NEVER, &mut 0);
        let placed = (0..count).map(|attempt| place(attempt).expect("nothing interrupts"));
        placed.collect::<Vec<_>>()
    });
    placed.concat()
}

/// Poses, ratios and contacts, for all ways of choosing ratios.
#[test]
fn closing_matches_the_slow_reference() {
    let rig = simple_rig();
    let motion = hand_motion(rig);
    let choices = [
        (BendRatioChoice::All, [&[0.7, 1.0, 1.42][..], &[0.7, 1.0, 1.42]]),
        (
            BendRatioChoice::AllFingersWithoutLow,
            [&[0.7, 1.0, 1.42], &[1.0, 1.42]],
        ),
        (BendRatioChoice::OnlyOne, [&[1.0], &[1.0]]),
        (BendRatioChoice::OnlyHigh, [&[1.42], &[1.42]]),
    ];
    let (mut touching, mut proximal, mut proximal_only, mut free) = (0, 0, 0, 0);
    for holdout in [floating(bar()), floating(plate()), floating(rod())] {
        for (attempt, wrist) in wrists(&holdout).iter().enumerate() {
            let (choice, ratios) = choices[attempt % choices.len()];
            for digit in Digit::ALL {
                let seed = attempt as u64 * 5 + digit.index() as u64;
                let posed = find_touching_finger_pose(
                    &holdout.object,
                    wrist,
                    &motion[digit.index()],
                    digit,
                    choice,
                    &mut AttemptStream::new(8, seed),
                );
                let yaw = rig.digit(digit).limits.base_yaw;
                let slow = close_slowly(
                    &holdout.object,
                    rig.digit(digit),
                    wrist.object_from_wrist,
                    AttemptStream::new(8, seed).between(yaw.min, yaw.max),
                    ratios[usize::from(digit != Digit::Thumb)],
                );
                assert!(near(&posed, &slow), "{digit:?}: {posed:?}\n{slow:?}");
                let [first, second, third] = posed.hits.map(|hit| hit.is_some());
                touching += u32::from(second || third);
                proximal += u32::from(first && (second || third));
                proximal_only += u32::from(first && !second && !third);
                free += u32::from(!posed.touches());
            }
        }
    }
    // The comparison covers every way for closing to end.
    assert!(touching > 500 && proximal > 20 && proximal_only > 20 && free > 500);
}

#[test]
fn each_choice_uses_its_own_bend_ratios() {
    // A wall close in front of the stretched hand: every digit touches it with any ratio.
    let wall = object_of(cuboid(Vec3::new(0.5, 0.5, 0.01), 2), &[]);
    let wrist = WristFrame::new(Pose::from_position(Vec3::new(0.0, 0.0, -0.045)));
    let motion = hand_motion(simple_rig());
    let used = |choice: BendRatioChoice, digit: Digit| {
        let mut counts = [0_u32; 3];
        for attempt in 0..300 {
            let mut stream = AttemptStream::new(6, attempt);
            let posed =
                find_touching_finger_pose(&wall, &wrist, &motion[digit.index()], digit, choice, &mut stream);
            match posed.bend_ratio {
                Some(0.7) => counts[0] += 1,
                Some(1.0) => counts[1] += 1,
                Some(1.42) => counts[2] += 1,
                other => panic!("{digit:?} touches with {other:?}"),
            }
        }
        counts.map(|count| count > 0)
    };
    for digit in [Digit::Thumb, Digit::Index, Digit::Little] {
        let thumb = digit == Digit::Thumb;
        // Tried in turn, the first succeeds here.
        for (choice, expected) in [
            (BendRatioChoice::All, [true, false, false]),
            (BendRatioChoice::AllFingersWithoutLow, [thumb, !thumb, false]),
            (BendRatioChoice::OneRandom, [true; 3]),
            (BendRatioChoice::OneRandomFingersWithoutLow, [thumb, true, true]),
            (BendRatioChoice::OnlyOne, [false, true, false]),
            (BendRatioChoice::OnlyHigh, [false, false, true]),
        ] {
            assert_eq!(used(choice, digit), expected, "{choice:?} {digit:?}");
        }
    }
}

/// `GRASPINGCONTACTSEXIST` for every combination.
#[test]
fn missing_contacts_are_rejected_by_kind() {
    let free = PosedDigit::default();
    let mut touching = free;
    touching.hits[2] = Some(SegmentHit {
        position: Vec3::ZERO,
        distance: 0.0,
        triangle: 0,
    });
    for strategy in Strategy::LADDER {
        let missing = |thumb, finger| missing_contacts(strategy, &[thumb, free, free, finger, free]);
        let is_early = strategy >= Strategy::D;
        let of_thumb = |later| {
            Some(if is_early {
                Rejection::NoThumbEarlyStop
            } else {
                later
            })
        };
        assert_eq!(missing(touching, touching), None);
        assert_eq!(missing(touching, free), Some(Rejection::NoFingers));
        assert_eq!(missing(free, touching), of_thumb(Rejection::NoThumb));
        assert_eq!(missing(free, free), of_thumb(Rejection::NoContacts));
        assert!(!is_early || missing_contacts(strategy, &[free]) == Some(Rejection::NoThumbEarlyStop));
    }
}
