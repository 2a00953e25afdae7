//! Wrist Placement against the plain order of checks and against brute force.

use crate::prelude::*;
use grasp_synthesis::geometry::mesh_bvh::MeshPoint;
use grasp_synthesis::thesis::finger_posing::{PosedDigit, find_touching_finger_pose, hand_motion};
use grasp_synthesis::thesis::wrist_placement::{WRIST_DISTANCE, WristFrame, WristPlacer};

fn place(holdout: &Holdout, rig: &Rig, strategy: Strategy, attempt: u64) -> (Pose, u64) {
    let mut pruned = 0;
    let wrist = WristPlacer::new(holdout, rig, strategy)
        .place(&mut AttemptStream::new(11, attempt), Stop::NEVER, &mut pruned)
        .expect("nothing interrupts");
    (wrist.object_from_wrist, pruned)
}

fn scenes() -> [Holdout; 4] {
    [floating(bar()), held(bar()), held(plate()), held(rod())]
}

/// Both orders of checks return the same placement of a stream, after the same number of prunes.
#[test]
fn the_cheap_order_of_checks_accepts_the_same_as_the_plain_order() {
    let rig = simple_rig();
    let mut compared = 0;
    for holdout in scenes() {
        let snug = &holdout.object.bounding_box;
        for strategy in [Strategy::B, Strategy::C] {
            for attempt in 0..150 {
                let (pose, pruned) = place(&holdout, rig, strategy, attempt);
                let mut stream = AttemptStream::new(11, attempt);
                let mut expected_prunes = 0;
                let plain = loop {
                    // The same draws: a position in C - B, then a rotation unless the position is already out of range.
                    let position = loop {
                        let position = stream.in_cube() * (snug.half_extents + rig.reach);
                        let outside = (position.abs() - snug.half_extents).max(Vec3::ZERO).length();
                        if outside > 0.0 && outside <= rig.reach {
                            break snug.object_from_box.transform_point(position);
                        }
                    };
                    let position_measure = snug.distance(position);
                    if position_measure <= WRIST_DISTANCE[1] + 1e-5 {
                        let pose = Pose {
                            position,
                            orientation: (snug.object_from_box.orientation * stream.rotation()).normalize(),
                        };
                        compared += 1;
                        if is_in_range(&holdout, rig, pose, strategy) {
                            break pose;
                        }
                    }
                    expected_prunes += 1;
                };
                assert_eq!((plain, expected_prunes), (pose, pruned), "{attempt} {strategy:?}");
            }
        }
    }
    assert!(compared > 10_000, "only {compared} placements compared");
}

/// True if the strategy accepts a wrist, by the ranges of Table 5.3, ends included. A palm straight above or below the centre of
/// mass is on nobody's side.
pub(super) fn is_in_range(holdout: &Holdout, rig: &Rig, wrist: Pose, strategy: Strategy) -> bool {
    let object = &holdout.object;
    let closest = |point: Vec3| object.surface.closest_point_within(point, f32::INFINITY);
    let palm = wrist.transform_point(rig.palm);
    let (of_wrist, of_palm) = (closest(wrist.position), closest(palm));
    let (of_wrist, of_palm) = of_wrist.zip(of_palm).expect("an object has a surface");
    let angle = |a: Vec3, b: Vec3| a.cross(b).length().atan2(a.dot(b)).to_degrees();
    let to_object = of_palm.position - wrist.position;
    let upward = angle(wrist.transform_vector(Vec3::Y), to_object);
    let forward = angle(wrist.transform_vector(Vec3::Z), to_object);
    let by_object = (0.0075..=0.12).contains(&of_wrist.distance)
        && of_palm.distance <= 0.08
        && upward <= 55.0
        && (35.0..=95.0).contains(&forward)
        && upward + forward <= 115.0;
    let on_ground = |point: Vec3| (point - object.centre_of_mass).reject_from_normalized(holdout.up);
    let by_giver = holdout.presenting_hand.as_ref().is_none_or(|giver| {
        let (giver, receiver) = (on_ground(giver.palm), on_ground(palm));
        giver == Vec3::ZERO || receiver == Vec3::ZERO || angle(giver, receiver) >= 90.0
    });
    (strategy < Strategy::B || by_object) && (strategy < Strategy::C || by_giver)
}

#[derive(Debug, PartialEq)]
struct Closed {
    angles: DigitAngles,
    ratio: Option<f32>,
    hits: [Option<MeshPoint>; 3],
}

/// Where the links touch in a pose.
fn hits(object: &GraspObject, digit: &DigitRig, wrist: Pose, angles: DigitAngles) -> [Option<MeshPoint>; 3] {
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
    let same_hit = |(a, b): (&Option<MeshPoint>, &Option<MeshPoint>)| match (a, b) {
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
