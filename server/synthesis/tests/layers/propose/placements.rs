//! Hands where opposed pads fit the object.

use grasp_synthesis::propose::{
    both_hands::Mirror,
    prepared::ROWS,
    proposal::Candidate,
    success_prior::{INPUTS, MAX_DEVIATION, ObjectFeatures, TRAINED, UNITS},
};

use crate::prelude::*;
use grasp_synthesis::physical::shape::Proposal;

#[test]
fn mirror_image_of_a_hand_is_the_other_hand() {
    let centre = Vec3::new(0.0, -0.05, -0.03);
    let object = GraspObject::new(cuboid(Vec3::splat(0.2), 1), 4.0, centre, None, &[]);
    let object = object.expect("it is sound");
    let turn = Quat::from_axis_angle(Vec3::new(0.36, 0.48, 0.8), 1.1);
    let wrist = Pose::new(Vec3::new(0.3, 0.1, -0.2), turn);
    let mirror = Mirror::facing(&object, Vec3::Y, wrist.position).expect("it is aside");
    let image = mirror.wrist(wrist);
    // The plane's normal is horizontal and points from the centre of mass at the wrist. The thumb's side is the other one.
    let normal = (wrist.position - centre).with_y(0.0).normalize_or_zero();
    let reflected = |p: Vec3| p - 2.0 * (p - centre).dot(normal) * normal;
    for point in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
        let other = image.transform_point(point * Vec3::new(-1.0, 1.0, 1.0));
        assert!(
            other.distance(reflected(wrist.transform_point(point))) < 1e-5,
            "{point}"
        );
    }
}

/// How deep a digit may reach into a thin part, in metres; a palm less.
const DEEPEST: f32 = 0.0075;

/// A candidate's hand in the object's frame, with opposed pads.
fn solids_of(rig: &PreparedRig, candidate: &Candidate<'_>) -> HandSolids {
    let pose = hand_pose(
        candidate.object_from_wrist,
        Digit::ALL.map(|digit| {
            let closed = candidate.opposition.closed[usize::from(digit != Digit::Thumb)];
            candidate.opposition.shape.flexing(rig, digit).closed_by(closed)
        }),
    );
    HandSolids::of_pose(rig, &pose)
}

#[test]
fn cached_placements_leave_the_hand_room() {
    let rig = adult(Handedness::Left);
    for name in OBJECT_NAMES {
        let object = object(name);
        let cache = prepared(object).placement_cache(rig);
        let mut count = 0;
        for row in 0..ROWS {
            for candidate in cache.row(row, rig) {
                count += 1;
                let solids = solids_of(rig, &candidate);
                let closing = (0..5).filter(|&digit| candidate.opposition.shape.closing[digit]);
                let tips = closing.map(|digit| &solids.phalanges[digit][2]);
                for &vertex in object.surface.mesh().positions() {
                    let is_deep =
                        |middle: Vec3, radius: f32| middle.distance(vertex) < radius - DEEPEST - 1e-5;
                    for tip in tips.clone() {
                        assert!(!is_deep(tip.end, tip.radius_at(1.0)), "{name}: {candidate:?}");
                    }
                    for solid in solids.palm.iter().chain(&solids.forearm) {
                        let is_deep = is_deep(solid.at(0.6), solid.radius_at(0.6));
                        assert!(!is_deep, "{name}: {candidate:?}");
                    }
                }
                // Its pads are about as far apart as the object is thick there.
                let apart = candidate.opposition.width() - candidate.pair.thickness;
                assert!((-0.006..=0.012).contains(&apart), "{name}: {apart}");
            }
        }
        assert!(count > 8 * ROWS, "{name}: only {count}");
        assert_eq!(cache.row(ROWS, rig).count(), 0);
    }
}

#[test]
fn evicts_the_first_of_too_many_hands() {
    // Not the shared object, which other tests use with other hands.
    let remote = PreparedObject::new(Arc::clone(object("remote")));
    let scales = [1.0, 1.01, 1.02, 1.03, 1.04];
    let hands = scales.map(|scale| PreparedRig::new(adult(Handedness::Left).mirrored().scaled(scale)));
    let first = remote.placement_cache(&hands[0]);
    for hand in &hands[1..4] {
        remote.placement_cache(hand);
    }
    assert!(Arc::ptr_eq(&first, &remote.placement_cache(&hands[0])));
    remote.placement_cache(&hands[4]);
    let again = remote.placement_cache(&hands[0]);
    assert!(!Arc::ptr_eq(&first, &again));
    assert_eq!(first, again);
}

#[test]
fn attempts_beyond_the_cache_draw_as_without_it() {
    let scalpel = object("scalpel");
    let cache = prepared(scalpel).placement_cache(right());
    let proposed = |placements, attempt| {
        let place = ProposalContext {
            placements,
            ..place(scalpel, right())
        };
        propose(&place, &mut AttemptStream::new(3, attempt), Stop::NEVER)
    };
    let (mut cached, mut fresh) = (0, 0);
    for attempt in 0..2 * ROWS {
        let same = proposed(Some(&*cache), attempt) == proposed(None, attempt);
        if attempt < ROWS {
            cached += usize::from(!same);
        } else {
            fresh += usize::from(same);
        }
    }
    assert_eq!(fresh, ROWS as usize);
    // The others lay the palm on the object, or have no preference.
    assert!(cached > ROWS as usize / 2, "{cached}");
}

fn holds_freely(object: &GraspObject, proposal: &Proposal, gripper: &mut Gripper) -> bool {
    holds(gripper, &surroundings(object, &NO_GIVER, right()), proposal)
}

#[test]
fn hands_rated_better_hold_more_often() {
    for name in OBJECT_NAMES {
        let object = object(name);
        let bulk = ObjectFeatures::of(object);
        let mut gripper = Gripper::answering();
        let mut rated: Vec<(f32, bool)> = (0..6000)
            .filter_map(|index| {
                let candidate =
                    place(object, right()).fitting_candidate(&mut AttemptStream::new(41, index))?;
                let features = bulk.inputs(
                    right(),
                    candidate.opposition,
                    candidate.object_from_wrist,
                    Barriers::NONE,
                );
                let holds = holds_freely(object, &candidate.proposal(), &mut gripper);
                Some((TRAINED.log_odds(&features), holds))
            })
            .collect();
        rated.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let held = |rated: &[(f32, bool)]| rated.iter().filter(|(_, holds)| *holds).count();
        let (better, worse) = rated.split_at(rated.len() / 2);
        assert!(
            held(better) >= 2 * held(worse) && held(better) >= 20,
            "{name}: of {} {} hold of the half rated better, {} of the other",
            rated.len(),
            held(better),
            held(worse)
        );
    }
}

#[test]
fn the_network_matches_its_formula_in_double_precision() {
    let mut stream = AttemptStream::new(47, 0);
    for _ in 0..100 {
        let features: [f32; INPUTS] =
            std::array::from_fn(|i| TRAINED.means[i] + stream.between(-6.0, 6.0) / TRAINED.scales[i]);
        let mut answer = f64::from(TRAINED.output_bias);
        for unit in 0..UNITS {
            let mut sum = f64::from(TRAINED.biases[unit]);
            for (i, feature) in features.iter().enumerate() {
                let scaled =
                    (f64::from(*feature) - f64::from(TRAINED.means[i])) * f64::from(TRAINED.scales[i]);
                let scaled = scaled.clamp(-f64::from(MAX_DEVIATION), f64::from(MAX_DEVIATION));
                sum += scaled * f64::from(TRAINED.weights[i][unit]);
            }
            answer += sum.max(0.0) * f64::from(TRAINED.outputs[unit]);
        }
        let off = (f64::from(TRAINED.log_odds(&features)) - answer).abs();
        assert!(off < 1e-4, "{off} off {answer}");
    }
}
