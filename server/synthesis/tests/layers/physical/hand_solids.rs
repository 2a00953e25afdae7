//! Hands as solids.

use crate::prelude::*;
use grasp_assets::hands::Hand;
use grasp_synthesis::physical::solids::{PALM_SOLIDS, SPHERES, TRACKED_SOLIDS, TrackedPalm};

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

/// Evenly spread directions on a Fibonacci lattice.
fn directions() -> impl Iterator<Item = Vec3> {
    const COUNT: usize = 300;
    const GOLDEN_ANGLE: f32 = 2.399_963;
    (0..COUNT).map(|i| {
        let z = 1.0 - (2 * i + 1) as f32 / COUNT as f32;
        let (sine, cosine) = (GOLDEN_ANGLE * i as f32).sin_cos();
        (1.0 - z * z).sqrt() * Vec3::new(cosine, sine, 0.0) + Vec3::Z * z
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

/// The palm's share of a vertex' weights.
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

/// Except for a dip between the bases of neighbouring metacarpals that is shallower than the clearance kept from a
/// giver, and nowhere thinner than fitted.
#[test]
fn tracked_hand_solids_are_as_thick_as_the_joints_report() {
    let hand = built_in_hand("adult", Handedness::Right);
    for more in [0.0, 0.004, 0.02] {
        let mut joints = HandJoints::of_pose(&hand.rig, &posed(relaxed()));
        for joint in &mut joints.joints {
            joint.radius += more;
        }
        let fitted = HandSolids::of_joints(&joints);
        let tracked = TrackedSolids::of_joints(&joints);
        let solids: Vec<TaperedCapsule> = tracked.iter().copied().collect();
        // The deepest dip below the balls swept from joint to joint.
        let dip = |[a, b]: [Joint; 2]| {
            let mut deepest = f32::NEG_INFINITY;
            for step in 0..=10 {
                let along = step as f32 / 10.0;
                let place = a.pose.position.lerp(b.pose.position, along);
                let radius = a.radius + (b.radius - a.radius) * along;
                for out in directions() {
                    let skin = place + out * radius;
                    let distances = solids.iter().map(|solid| solid.signed_distance(skin));
                    deepest = deepest.max(distances.fold(f32::INFINITY, f32::min));
                }
            }
            deepest
        };
        let bone = |pair: [usize; 2]| pair.map(|joint| joints.joints[joint]);
        // OpenXR's metacarpals of the four fingers; from knuckle to knuckle; from the wrist to the metacarpals' bases.
        let along = [[6, 7], [11, 12], [16, 17], [21, 22]];
        let knuckles = [[7, 12], [12, 17], [17, 22]];
        let from_wrist = [[1, 2], [1, 6], [1, 11], [1, 16], [1, 21]];
        for pair in along.into_iter().chain(knuckles).chain(from_wrist) {
            let dip = dip(bone(pair));
            assert!(dip < 1e-5, "{more} more, {pair:?}: {dip}");
        }
        for pair in [[6, 11], [11, 16], [16, 21]] {
            let dip = dip(bone(pair));
            assert!(dip < 0.8 * GIVER_CLEARANCE, "{more} more, {pair:?}: {dip}");
        }
        // OpenXR's z of the wrist points away from the fingers.
        let wrist = joints.joints[index::WRIST];
        let mut behind = wrist;
        behind.pose.position += wrist.pose.orientation * Vec3::Z * 0.25;
        let dip = dip([wrist, behind]);
        assert!(dip < 1e-5, "{more} more, forearm: {dip}");

        for solid in &fitted.palm {
            for along in [0.0, 0.3, 1.0] {
                let (middle, radius) = (solid.at(along), solid.radius_at(along));
                let depths = tracked.palm.iter().map(|solid| -solid.signed_distance(middle));
                assert!(depths.fold(f32::NEG_INFINITY, f32::max) >= radius - 1e-6);
            }
        }
        assert_eq!(tracked.hand, fitted);
    }
}

/// A receiver is as thick as a giver with the same joints.
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
        for (ours, theirs) in of_rig.iter().zip(of_joints.iter()) {
            assert!(ours.start.distance(theirs.start) < 1e-6, "{ours:?} {theirs:?}");
            assert!(ours.end.distance(theirs.end) < 1e-6, "{ours:?} {theirs:?}");
            let off =
                (ours.start_radius - theirs.start_radius).abs() + (ours.end_radius - theirs.end_radius).abs();
            assert!(off < 1e-6, "{ours:?} {theirs:?}");
        }
    }
}

/// The palm's skin is swept by balls from joint to joint, with the joints' radii.
#[test]
fn distances_to_a_tracked_palm_match_its_swept_balls() {
    const STEPS: usize = 200;
    let hand = built_in_hand("adult", Handedness::Right);
    let joints = HandJoints::of_pose(&hand.rig, &posed(relaxed()));
    let metacarpals = [(6, 7), (11, 12), (16, 17), (21, 22)];
    let across = [(6, 11), (11, 16), (16, 21), (7, 12), (12, 17), (17, 22)];
    let from_wrist = [(1, 2), (1, 6), (1, 11), (1, 16), (1, 21)];
    let bones = metacarpals.iter().chain(&across).chain(&from_wrist);
    let balls: Vec<(Vec3, f32)> = bones
        .flat_map(|&(a, b)| {
            let [a, b] = [a, b].map(|joint| joints.joints[joint]);
            (0..=STEPS).map(move |step| {
                let along = step as f32 / STEPS as f32;
                (
                    a.pose.position.lerp(b.pose.position, along),
                    a.radius + (b.radius - a.radius) * along,
                )
            })
        })
        .collect();
    let mut random = Random::new(31);
    let middle = joints.joints[11].pose.position;
    for _ in 0..300 {
        let point = middle + 0.08 * random.in_cube();
        let expected = balls
            .iter()
            .map(|(ball, radius)| ball.distance(point) - radius)
            .fold(f32::INFINITY, f32::min);
        let found = TrackedPalm::of_joints(&joints).distance_to_skin(point);
        assert!(
            (found - expected.abs()).abs() < 3e-4,
            "{point}: {found}, not {expected}"
        );
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

/// A solid near `middle`, up to so long and so thick.
fn solid(random: &mut Random, middle: Vec3, length: f32, thick: f32) -> TaperedCapsule {
    let start = middle + random.direction() * random.between(0.0, 0.1);
    let way = random.direction() * random.between(0.0, length);
    let radii = [0.3 * thick, thick].map(|least| random.between(least, thick));
    TaperedCapsule::new(start, start + way, radii[0], radii[1])
}

/// [`hand`] as tracked hand solids, which are thicker.
fn tracked_hand(random: &mut Random, middle: Vec3) -> TrackedSolids {
    TrackedSolids {
        hand: hand(random, middle),
        palm: [(); PALM_SOLIDS].map(|()| solid(random, middle, 0.07, 0.019)),
        tracked: [(); TRACKED_SOLIDS].map(|()| solid(random, middle, 0.07, 0.017)),
    }
}

/// Random solids near `middle`, as long and as thick as a person's.
fn hand(random: &mut Random, middle: Vec3) -> HandSolids {
    let mut solid = |length: f32, thick: f32| solid(random, middle, length, thick);
    HandSolids {
        phalanges: [[(); 3]; 5].map(|links| links.map(|()| solid(0.05, 0.01))),
        palm: [(); PALM_SOLIDS].map(|()| solid(0.07, 0.017)),
        thenar: [(); 4].map(|()| solid(0.05, 0.017)),
        forearm: [(); 2].map(|()| solid(0.3, 0.06)),
    }
}

/// Eight balls moved together are near a hand exactly where one of them, moved by itself, is.
#[test]
fn moved_balls_are_near_where_any_one_of_them_is() {
    let mut random = Random::new(32);
    let (mut near, mut far, mut close) = (0, 0, 0);
    for case in 0..2000 {
        let solids = tracked_hand(&mut random, Vec3::ZERO);
        let giver = PreparedHand::new(&solids);
        let middles: [Vec3; SPHERES] =
            std::array::from_fn(|_| random.direction() * random.between(0.1, 0.2) + Vec3::X * 0.1);
        let radii: [f32; SPHERES] = std::array::from_fn(|_| random.between(0.004, 0.012));
        let turn = Quat::from_axis_angle(random.direction(), random.between(-3.0, 3.0));
        let way = Pose::new(random.direction() * random.between(0.0, 0.1), turn);
        let balls = Spheres::new(|i| (middles[i], radii[i])).transformed(way);
        let nears = |distance: f32| {
            let mut each = middles.iter().zip(radii);
            each.any(|(middle, radius)| {
                giver.certainly_within(way.transform_point(*middle), radius, distance)
            })
        };
        // Where rounding decides, either answer is right.
        let (surely, perhaps) = (nears(0.001 - 1e-6), nears(0.001 + 1e-6));
        let found = giver.any_certainly_within(&balls, 0.001);
        assert!(found || !surely, "case {case}: one of them is near");
        assert!(!found || perhaps, "case {case}: none of them is near");
        if found {
            near += 1;
        } else {
            far += 1;
        }

        // Each ball's upper bound holds.
        let bounds = giver.distance_upper_bounds(&balls);
        for (ball, (middle, radius)) in middles.into_iter().zip(radii).enumerate() {
            let middle = way.transform_point(middle);
            let distances = solids.iter().map(|solid| solid.signed_distance(middle) - radius);
            let least = distances.fold(f32::INFINITY, f32::min);
            let bound = bounds[ball];
            assert!(bound >= least - 1e-6, "{case} {ball} {bound} {least}");
            close += usize::from(bound < least + 1e-3);
        }
    }
    assert!(near > 300 && far > 300, "{near} near, {far} far");
    assert!(close > 4_000, "{close} bounds are within a millimetre");
}

#[test]
fn upper_bounds_of_point_distances_hold_and_are_tight() {
    let mut random = Random::new(37);
    let mut excess = Vec::new();
    for _ in 0..2000 {
        let giver = tracked_hand(&mut random, Vec3::ZERO);
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
