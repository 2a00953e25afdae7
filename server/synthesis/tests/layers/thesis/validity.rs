//! Grasps are valid by an independent judge, and collisions are those of palm or fingers.

use crate::fixtures::oracle::crosses_mesh;
use crate::prelude::*;
use grasp_synthesis::rating::scoring::comfort;
use grasp_synthesis::thesis::collision_and_contact_validation::collision;
use grasp_synthesis::thesis::finger_posing::PosedDigit;
use grasp_synthesis::thesis::wrist_placement::WristFrame;

use super::placement_and_posing::is_in_range;

/// Judges a grasp with plain kinematics, brute force and double precision.
fn assert_valid(grasp: &Grasp, search: &Search<'_>) {
    let (holdout, rig) = (search.holdout, simple_rig());
    let query = &search.settings.query;
    let object = &holdout.object;
    let mesh = object.surface.mesh();
    let wrist = grasp.pose.frame_from_wrist;
    assert!(is_in_range(holdout, rig, wrist, query.strategy));

    // Anatomy.
    for (angles, digit) in grasp.pose.digits.iter().zip(&rig.digits) {
        let limits = &digit.limits;
        assert!(limits.base_yaw.contains(angles.base_yaw, 1e-5));
        assert!(limits.base_pitch.contains(angles.base_pitch, 1e-5));
        assert!(limits.second_pitch.contains(angles.second_pitch, 1e-5));
        assert!((angles.third_pitch - angles.second_pitch * 2.0 / 3.0).abs() < 1e-5);
    }

    // Contacts: thumb and finger, one per link, on the touch segments and on their triangles, none forbidden.
    let touches = |digit| touches(&grasp.contacts, digit);
    assert!(touches(Digit::Thumb) && Digit::ALL[1..].iter().any(|&digit| touches(digit)));
    let frames = hand_frames(rig, &grasp.pose);
    for (index, contact) in grasp.contacts.iter().enumerate() {
        let HandPart::Phalanx(touching, phalanx) = contact.part else {
            panic!("in the thesis, palms do not touch");
        };
        let link = phalanx.index();
        let digit = rig.digit(touching);
        let local = frames.digits[touching.index()].links[link]
            .inverse()
            .transform_point(contact.position);
        assert!(local.x.abs() < 1e-5 && (local.z - digit.diameters[link] / 2.0).abs() < 1e-5);
        assert!(local.y > -1e-5 && local.y < digit.lengths[link] + 1e-5);
        let [a, ..] = mesh.corners(contact.triangle as usize);
        assert!((contact.position - a).dot(contact.normal).abs() < 1e-5);
        assert!(contact.normal.dot(mesh.normal(contact.triangle as usize)) > 0.999);
        assert!(!object.is_forbidden(contact.triangle));
        assert!(
            grasp.contacts[..index]
                .iter()
                .all(|other| other.part < contact.part)
        );
    }
    for digit in Digit::ALL {
        assert_eq!(grasp.bend_ratios[digit.index()].is_some(), touches(digit));
    }

    // Collisions of all 25 segments with both meshes.
    let place = |point: Vec3| wrist.transform_point(point);
    let palm = rig.palm_segments.iter();
    let palm = palm.map(|segment| Segment::new(place(segment.start), place(segment.end)));
    let bones = frames.digits.iter().flat_map(|digit| {
        let [a, b, c] = digit.links.map(|link| link.position);
        [[a, b], [b, c], [c, digit.tip]].map(|[from, to]| Segment::new(from, to))
    });
    let giver = holdout
        .presenting_hand
        .as_ref()
        .and_then(|hand| Some(hand.surface()?.mesh()));
    for segment in palm.chain(bones) {
        for mesh in std::iter::once(mesh).chain(giver) {
            assert!(crosses_mesh(mesh, segment).nearest.is_none());
            assert!(winding_number(mesh, segment.start).abs() < 0.5);
        }
    }

    // Forces: in their cones, summed to a wrench of gravity's size that opposes gravity within 5°.
    let weight = 9.81 * f64::from(object.mass);
    let (mut force_sum, mut torque_sum) = (DVec3::ZERO, DVec3::ZERO);
    for (force, contact) in grasp.forces.iter().zip(&grasp.contacts) {
        let (force, inward) = (force.as_dvec3(), -contact.normal.as_dvec3());
        assert!(
            force.dot(inward) > force.length() * (f64::from(query.friction.expect("it is given")) - 1e-3)
        );
        // All four lines of force of a contact meet in the cone's tip, 3 mm outside the surface.
        let tip = contact.position.as_dvec3() - inward * 0.003 - object.centre_of_mass.as_dvec3();
        force_sum += force;
        torque_sum += tip.cross(force);
    }
    let magnitude = (force_sum.length_squared() + torque_sum.length_squared()).sqrt();
    assert!((magnitude / weight - 1.0).abs() < 1e-4, "{magnitude} {weight}");
    let angle = (force_sum.dot(holdout.up.as_dvec3()) / magnitude).acos();
    assert!(angle < 5.001_f64.to_radians() && (angle - f64::from(grasp.wrench_angle)).abs() < 1e-3);
    assert!((0.0..0.5).contains(&grasp.comfort));
}

#[test]
fn grasps_are_valid_by_an_independent_judge() {
    let mut found = 0;
    for holdout in [floating(bar()), held(bar()), held(plate()), held(rod())] {
        for (strategy, rounds) in [(Strategy::B, 2), (Strategy::D, 3), (Strategy::F, 8)] {
            for seed in 0..rounds {
                let search = thesis(&holdout, strategy).seed(seed);
                let outcome = search.run();
                assert_eq!(outcome.end, SearchEnd::Found, "{strategy:?}, seed {seed}");
                assert_valid(&outcome.grasp.expect("it was found"), &search);
                found += 1;
            }
        }
    }
    assert_eq!(found, 4 * 13);
}

/// The stretched hand at a wrist, in the form that Finger Posing returns.
fn stretched_hand(rig: &Rig, wrist: &WristFrame) -> [PosedDigit; 5] {
    let pose = hand_pose(wrist.object_from_wrist, rig.stretched());
    hand_frames(rig, &pose).digits.map(|digit| PosedDigit {
        joints: [
            digit.links[0].position,
            digit.links[1].position,
            digit.links[2].position,
            digit.tip,
        ],
        ..PosedDigit::default()
    })
}

#[test]
fn collisions_are_reported_by_part() {
    let rig = simple_rig();
    let [of_palm, of_finger] = [Rejection::PalmCollision, Rejection::FingerCollision].map(Some);
    let (palm, fingers, far) = (Vec3::Y * 0.05, Vec3::Y * 0.18, Vec3::Z);
    let holdout = |half: f32, giver: Option<Vec3>| {
        let mut holdout = held(object_of(cuboid(Vec3::splat(half), 2), &[]));
        let presenting = holdout.presenting_hand.take();
        holdout.presenting_hand = presenting.zip(giver).map(|(hand, at)| PresentingHand {
            skin: Some(box_at(at, Vec3::splat(0.02), 2)),
            ..hand
        });
        holdout
    };
    for (half, giver, wrist, expected) in [
        // The object, or the giver if the object is far away, is in the palm or around the fingertips.
        (0.02, None, far, None),
        (0.02, None, -palm, of_palm),
        (0.02, None, -fingers, of_finger),
        (0.02, Some(far + palm), far, of_palm),
        (0.02, Some(far + fingers), far, of_finger),
        // The palm is checked first, against object and giver.
        (0.02, Some(palm - fingers), -fingers, of_palm),
        // A body around the whole hand is crossed by nothing.
        (0.5, None, Vec3::ZERO, of_palm),
    ] {
        let wrist = WristFrame::new(Pose::from_position(wrist));
        let digits = stretched_hand(rig, &wrist);
        let found = collision(&holdout(half, giver), rig, &wrist, &digits);
        assert_eq!(found, expected, "{giver:?} {wrist:?}");
    }
    // Nor do bones that lie entirely inside the object or the giver cross anything.
    let wrist = WristFrame::new(Pose::from_position(far));
    for (half, giver, inside) in [(0.02, None, Vec3::ZERO), (0.001, Some(-palm), -palm)] {
        let mut digits = stretched_hand(rig, &wrist);
        digits[3].joints = [-0.01, -0.005, 0.0, 0.01].map(|x| inside + Vec3::new(x, 0.002, 0.003));
        assert_eq!(collision(&holdout(half, giver), rig, &wrist, &digits), of_finger);
    }
}

/// Eq. 4.6 by hand.
#[test]
fn comfort_matches_hand_computed_examples() {
    let near =
        |value: f32, expected: f32| assert!((value - expected).abs() < 1e-6, "{value}, not {expected}");
    // The comfortable distribution itself, in any unit.
    near(comfort([0.25, 0.25, 0.25, 0.125, 0.125]), 0.0);
    near(comfort([2.0, 2.0, 2.0, 1.0, 1.0]), 0.0);
    // Thumb and index alone: D' = (½, ½).
    near(comfort([3.0, 3.0, 0.0, 0.0, 0.0]), 0.0);
    // f = (¾, ¼): 2 · (¼)² = 0.125.
    near(comfort([3.0, 1.0, 0.0, 0.0, 0.0]), 0.125);
    // Thumb and little finger: Z = 0.375, D' = (⅔, ⅓); f = (½, ½): 2 · (⅙)² = 1/18.
    near(comfort([1.0, 0.0, 0.0, 0.0, 1.0]), 1.0 / 18.0);
    // Thumb, ring, little: Z = ½, D' = (½, ¼, ¼); f = (0.2, 0.4, 0.4): 0.09 + 2 · 0.0225 = 0.135.
    near(comfort([1.0, 0.0, 0.0, 2.0, 2.0]), 0.135);
}
