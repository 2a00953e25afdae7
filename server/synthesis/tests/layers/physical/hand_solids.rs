//! Hands as solids.

use crate::prelude::*;
use grasp_assets::hands::Hand;
use grasp_synthesis::physical::solids::TrackedPalm;

/// Below this height, in metres from the wrist's crease, the skin of the forearm ends in a rounded stump.
const STUMP: f32 = -0.012;

fn posed(digits: [DigitAngles; 5]) -> HandPose {
    hand_pose(Pose::IDENTITY, digits)
}

/// A hand about to take something: fingers bent increasingly from index to little finger, thumb abducted.
fn relaxed() -> [DigitAngles; 5] {
    [0.0_f32, 15.0, 20.0, 25.0, 30.0].map(|bend| {
        if bend == 0.0 {
            DigitAngles::coupled(35_f32.to_radians(), 0.0, 20_f32.to_radians())
        } else {
            DigitAngles::coupled(0.0, bend.to_radians(), bend.to_radians())
        }
    })
}

fn signed_distance(solids: &HandSolids, point: Vec3) -> f32 {
    let distances = solids.iter().map(|solid| solid.signed_distance(point));
    distances.fold(f32::INFINITY, f32::min)
}

/// The 95th percentile of the distances between skin and solids, in metres, over the vertices of a part.
fn misfit(hand: &Hand, digits: [DigitAngles; 5], is_of: impl Fn(usize, Vec3) -> bool) -> f32 {
    let pose = posed(digits);
    let solids = HandSolids::of_pose(&hand.rig, &pose);
    let skin = hand.skin.posed(&HandJoints::of_pose(&hand.rig, &pose));
    let mut distances: Vec<f32> = skin
        .iter()
        .enumerate()
        .filter(|&(vertex, &point)| point.y > STUMP && is_of(vertex, point))
        .map(|(_, &point)| signed_distance(&solids, point).abs())
        .collect();
    assert!(distances.len() > 300, "only {} vertices", distances.len());
    distances.sort_by(f32::total_cmp);
    distances[distances.len() * 95 / 100]
}

fn palm_share(hand: &Hand, vertex: usize) -> f32 {
    let rows = hand.skin.joint_indices[vertex]
        .iter()
        .zip(hand.skin.weights[vertex]);
    rows.filter(|&(&joint, _)| joint < 3 || index::FIRST_OF_DIGIT.contains(&usize::from(joint)))
        .map(|(_, weight)| weight)
        .sum()
}

#[test]
fn solids_end_at_the_skin() {
    for hand in all_hands() {
        // A millimetre of an adult's hand at the scale of this one.
        let mm = 1e-3 * hand.rig.reach / 0.19;
        for digits in [hand.rig.stretched(), relaxed()] {
            let whole = misfit(hand, digits, |_, _| true);
            assert!(whole < 1.9 * mm, "{}: {} mm", hand.rig.name, whole / mm);
            let palm = misfit(hand, digits, |vertex, point| {
                point.z > 0.002 && palm_share(hand, vertex) > 0.5
            });
            assert!(palm < 2.3 * mm, "{}: {} mm at the palm", hand.rig.name, palm / mm);
        }
    }
}

#[test]
fn tracked_hand_solids_of_a_rig_match_those_of_its_joints() {
    for hand in all_hands() {
        let pose = hand_pose(
            Pose::new(Vec3::new(0.1, 0.2, -0.3), Quat::from_rotation_x(1.0)),
            relaxed(),
        );
        let fitted = HandSolids::of_pose(&hand.rig, &pose);
        let way = Vec3::new(0.01, -0.02, 0.03);
        let of_rig = TrackedSolids::of_rig(&hand.rig, pose.frame_from_wrist, &fitted).moved(way);
        let mut elsewhere = pose;
        elsewhere.frame_from_wrist.position += way;
        let of_joints = TrackedSolids::of_joints(&HandJoints::of_pose(&hand.rig, &elsewhere));
        assert_eq!(of_rig.iter().count(), of_joints.iter().count());
        let ends = |solid: &TaperedCapsule| {
            [(solid.start, solid.start_radius), (solid.end, solid.end_radius)]
                .map(|(at, radius)| at.extend(radius))
        };
        for (ours, theirs) in of_rig.iter().zip(of_joints.iter()) {
            let [(a, b), (c, d)] = [0, 1].map(|end| (ends(ours)[end], ends(theirs)[end]));
            assert!(
                a.distance(b) < 1e-6 && c.distance(d) < 1e-6,
                "{ours:?} {theirs:?}"
            );
        }
    }
}

/// The palm's skin is swept by balls from joint to joint, with the joints' radii. Solids are nowhere thinner, nor thinner
/// than fitted, except for a dip between the bases of neighbouring metacarpals, which is shallower than a clearance.
#[test]
fn tracked_palms_are_as_thick_as_the_balls_that_sweep_them() {
    const STEPS: usize = 200;
    let metacarpals = [(6, 7), (11, 12), (16, 17), (21, 22)];
    let knuckles = [(7, 12), (12, 17), (17, 22)];
    let from_wrist = [(1, 2), (1, 6), (1, 11), (1, 16), (1, 21)];
    let firm = [&metacarpals[..], &knuckles, &from_wrist].concat();
    let dips = [(6, 11), (11, 16), (16, 21)];
    let mut random = Random::new(31);
    for more in [0.0, 0.004, 0.02] {
        let mut joints = HandJoints::of_pose(right(), &posed(relaxed()));
        for joint in &mut joints.joints {
            joint.radius += more;
        }
        let distance = |bones: &[(usize, usize)], point: Vec3| {
            let distances = bones.iter().flat_map(|&(a, b)| {
                let [a, b] = [a, b].map(|joint| joints.joints[joint]);
                (0..=STEPS).map(move |step| {
                    let along = step as f32 / STEPS as f32;
                    let ball = a.pose.position.lerp(b.pose.position, along);
                    ball.distance(point) - (a.radius + (b.radius - a.radius) * along)
                })
            });
            distances.fold(f32::INFINITY, f32::min)
        };
        let (fitted, tracked) = (HandSolids::of_joints(&joints), TrackedSolids::of_joints(&joints));
        assert_eq!(tracked.hand, fitted);
        let middle = joints.joints[11].pose.position;
        for _ in 0..300 {
            let point = middle + (0.08 + more) * random.in_cube();
            let (of_firm, of_dips) = (distance(&firm, point), distance(&dips, point));
            let found = TrackedPalm::of_joints(&joints).distance_to_skin(point);
            let expected = of_firm.min(of_dips);
            assert!(
                (found - expected.abs()).abs() < 3e-4,
                "{point}: {found}, not {expected}"
            );
            let of_palm = fitted.palm.iter().map(|solid| solid.signed_distance(point));
            let thickest = of_palm
                .fold(of_firm, f32::min)
                .min(of_dips + 0.8 * GIVER_CLEARANCE);
            let solids = tracked.iter().map(|solid| solid.signed_distance(point));
            let found = solids.fold(f32::INFINITY, f32::min);
            assert!(found < thickest + 1e-5, "{more} {point} {found} {thickest}");
        }
        // OpenXR's z of the wrist points away from the fingers.
        let wrist = joints.joints[index::WRIST];
        for _ in 0..100 {
            let along = wrist.pose.orientation * Vec3::Z * random.between(0.0, 0.25);
            let skin = wrist.pose.position + along + random.direction() * wrist.radius;
            let solids = tracked.iter().map(|solid| solid.signed_distance(skin));
            assert!(solids.fold(f32::INFINITY, f32::min) < 1e-5, "{more} {along}");
        }
    }
}

#[test]
fn relaxed_hands_do_not_touch_themselves() {
    for hand in all_hands() {
        for digits in [hand.rig.stretched(), relaxed()] {
            let solids = HandSolids::of_pose(&hand.rig, &posed(digits));
            let clearance = self_clearance(&hand.rig, &solids);
            assert!(clearance > 0.0, "{}: {clearance}", hand.rig.name);
        }
    }
}

#[test]
fn fingers_through_fingers_or_the_palm_are_detected() {
    let hand = built_in_hand("adult", Handedness::Right);
    let clearance_of = |digits| self_clearance(&hand.rig, &HandSolids::of_pose(&hand.rig, &posed(digits)));
    let mut crossed = hand.rig.stretched();
    crossed[1].base_yaw = 20_f32.to_radians();
    crossed[2].base_yaw = -20_f32.to_radians();
    assert!(clearance_of(crossed) < -0.005);
    let mut thumb_through = hand.rig.stretched();
    // Beyond its limits: across the palm at the height of the metacarpals.
    thumb_through[0] = DigitAngles::coupled(0.0, 60_f32.to_radians(), 40_f32.to_radians());
    assert!(clearance_of(thumb_through) < -0.005);
    // As deep as the deepest pair, less the soft flesh.
    let mut solids = HandSolids::of_pose(&hand.rig, &posed(crossed));
    for [first, ..] in &mut solids.phalanges[1..] {
        // A knuckle shares its flesh with its neighbour: it counts as 3 % thicker than the finger's end.
        assert!(first.start_radius > 1.1 * first.end_radius);
        first.start_radius = 1.03 * first.end_radius;
    }
    let deepest = pair_distance(&solids.phalanges[1], &solids.phalanges[2]);
    assert!((clearance_of(crossed) - deepest - SOFT_CONTACT).abs() < 1e-6);
}

#[test]
fn upper_bounds_of_point_distances_hold_and_are_tight() {
    let mut random = Random::new(37);
    let mut excess = Vec::new();
    for _ in 0..2000 {
        let giver = tracked(&posed(random.angles(right())));
        let point = random.direction() * random.between(0.0, 0.3);
        let bound = PreparedHand::new(&giver).point_distance_upper_bound(point);
        let least = giver.iter().map(|solid| solid.signed_distance(point));
        let least = least.fold(f32::INFINITY, f32::min);
        assert!(bound >= least - 1e-5, "{bound} is less than {least}");
        excess.push(bound - least);
    }
    excess.sort_by(f32::total_cmp);
    assert!(
        excess[1000] < 1e-4 && excess[1800] < 2e-3,
        "{} and {}",
        excess[1000],
        excess[1800]
    );
}
