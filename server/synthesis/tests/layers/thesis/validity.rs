//! Grasps are valid by an independent judge, every kind of rejection occurs where it should, and the strategies differ
//! as described.

use crate::fixtures::oracle::crosses_mesh;
use crate::prelude::*;
use grasp_synthesis::model::grasp::{COMFORTABLE_SHARES, GRAVITY};
use grasp_synthesis::rating::scoring::comfort;
use grasp_synthesis::thesis::collision_and_contact_validation::collision;
use grasp_synthesis::thesis::finger_posing::PosedDigit;
use grasp_synthesis::thesis::immobility_validation::{
    ForceDistribution, Immobility, ImmobilityBuffers, Load, Wrench, contact_counts, four_unit_wrenches,
    printed_cone_cos,
};
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

/// How often each kind of rejection occurs in a run of attempts.
fn rejections(search: &Search<'_>, attempts: u64) -> [u64; 8] {
    let mut sum = [0; 8];
    let mut done = 0;
    while done < attempts {
        let rest = search.clone().first_attempt(done).max_attempts(attempts - done);
        let report = rest.run().report;
        assert_eq!(
            report.rejections.iter().sum::<u64>() + u64::from(report.attempt().is_some()),
            report.attempts
        );
        for (sum, count) in sum.iter_mut().zip(report.rejections) {
            *sum += count;
        }
        done += report.attempts;
    }
    assert_eq!(done, attempts);
    sum
}

fn count(rejections: &[u64], kind: Rejection) -> u64 {
    rejections[kind.index()]
}

/// Up to C all digits are posed; in D and later, a thumb without contact ends the attempt.
#[test]
fn each_strategy_rejects_for_its_own_reasons() {
    let holdout = held(bar());
    let naive = rejections(&thesis(&holdout, Strategy::A), 6000);
    let pruned = rejections(&thesis(&holdout, Strategy::B), 6000);
    for counts in [&naive, &pruned] {
        for kind in [
            Rejection::NoContacts,
            Rejection::NoThumb,
            Rejection::NoFingers,
            Rejection::PalmCollision,
            Rejection::FingerCollision,
            Rejection::NotImmobilizing,
        ] {
            assert!(count(counts, kind) > 0, "no {kind:?} in {counts:?}");
        }
        assert_eq!(count(counts, Rejection::NoThumbEarlyStop), 0);
    }
    // Pruning leaves fewer placements out of reach (thesis: 95 % and 48 %).
    assert!(count(&naive, Rejection::NoContacts) > 2 * count(&pruned, Rejection::NoContacts));

    for strategy in [Strategy::D, Strategy::E, Strategy::F] {
        let counts = rejections(&thesis(&holdout, strategy), 3000);
        assert_eq!(count(&counts, Rejection::NoThumb), 0);
        assert_eq!(count(&counts, Rejection::NoContacts), 0);
        assert!(count(&counts, Rejection::NoThumbEarlyStop) > 0 && count(&counts, Rejection::NoFingers) > 0);
    }
}

/// D stops early exactly where C rejects for the thumb, and both find the same first grasp, since the draws of a
/// rejected attempt do not affect later ones.
#[test]
fn the_early_stop_changes_no_verdict() {
    let holdout = held(plate());
    let ratios = BendRatioChoice::All;
    for seed in 0..6 {
        let run = |strategy| thesis(&holdout, strategy).seed(seed).bend_ratios(ratios).run();
        let (c, d) = (run(Strategy::C), run(Strategy::D));
        assert_eq!(c.grasp, d.grasp);
        let (c, d) = (c.report, d.report);
        assert_eq!(
            (c.attempt(), c.pruned_placements),
            (d.attempt(), d.pruned_placements)
        );
        let c_thumb = count(&c.rejections, Rejection::NoThumb) + count(&c.rejections, Rejection::NoContacts);
        assert_eq!(c_thumb, count(&d.rejections, Rejection::NoThumbEarlyStop));
        assert_eq!(c.rejections[3..], d.rejections[3..]);
    }
}

/// Where the whole surface is forbidden, every grasp that gets to its contacts is rejected for them.
#[test]
fn forbidden_surfaces_give_unwanted_contacts() {
    let all = triangles_where(&bar_mesh(), |_| true);
    let holdout = held(object_of(bar_mesh(), &all));
    let counts = rejections(&thesis(&holdout, Strategy::F), 3000);
    assert!(count(&counts, Rejection::UnwantedContact) > 0);
    assert_eq!(count(&counts, Rejection::NotImmobilizing), 0);
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

fn collision_at(object: GraspObject, giver_at: Option<Vec3>, wrist: Vec3) -> Option<Rejection> {
    let mut holdout = held(object);
    match (giver_at, &mut holdout.presenting_hand) {
        (Some(at), Some(giver)) => giver.skin = Some(box_at(at, Vec3::splat(0.02), 2)),
        (_, giver) => *giver = None,
    }
    let wrist = WristFrame::new(Pose::from_position(wrist));
    let digits = stretched_hand(simple_rig(), &wrist);
    collision(&holdout, simple_rig(), &wrist, &digits)
}

/// Of palm and fingers, with the object and with the giver, by crossing and by containment.
#[test]
fn collisions_are_reported_by_part() {
    let cube = || object_of(cuboid(Vec3::splat(0.02), 2), &[]);
    let far = Vec3::Z;
    let (palm, fingers) = (Vec3::Y * 0.05, Vec3::Y * 0.18);
    let [of_palm, of_finger] = [Rejection::PalmCollision, Rejection::FingerCollision].map(Some);
    for (giver, wrist, expected) in [
        // The cube far away, in the palm, and around the fingertips.
        (None, far, None),
        (None, -palm, of_palm),
        (None, -fingers, of_finger),
        // The same with the giver, while the object is far away.
        (Some(far + Vec3::Y * 0.5), far, None),
        (Some(far + palm), far, of_palm),
        (Some(far + fingers), far, of_finger),
        // The palm is checked first, against object and giver.
        (Some(palm - fingers), -fingers, of_palm),
    ] {
        assert_eq!(collision_at(cube(), giver, wrist), expected, "{giver:?} {wrist}");
    }
    // A body around the whole hand is crossed by nothing.
    let hall = object_of(cuboid(Vec3::splat(0.5), 2), &[]);
    assert_eq!(collision_at(hall, None, Vec3::ZERO), of_palm);
    // Nor do bones that lie entirely inside the object or the giver cross anything.
    let rig = simple_rig();
    let wrist = WristFrame::new(Pose::from_position(far));
    let mut digits = stretched_hand(rig, &wrist);
    assert_eq!(collision(&floating(cube()), rig, &wrist, &digits), None);
    digits[3].joints = [-0.01, -0.005, 0.0, 0.01].map(|x| Vec3::new(x, 0.002, 0.003));
    assert_eq!(collision(&floating(cube()), rig, &wrist, &digits), of_finger);
    let mut held = held(object_of(cuboid(Vec3::splat(0.001), 1), &[]));
    digits[3].joints = digits[3]
        .joints
        .map(|joint| joint + Vec3::new(0.01, -0.07, -0.01));
    assert_eq!(collision(&held, rig, &wrist, &digits), of_finger);
    held.presenting_hand = None;
    assert_eq!(collision(&held, rig, &wrist, &digits), None);
}

/// A box of 4 cm between thumb and index finger, which press along x (the thesis' running example).
fn pinch() -> [Contact; 2] {
    [(-0.02, Digit::Thumb), (0.02, Digit::Index)].map(|(x, digit)| {
        let part = HandPart::Phalanx(digit, Phalanx::Third);
        contact(Vec3::X * x, (Vec3::X * x).normalize_or(Vec3::X), part)
    })
}

fn load(up: Vec3) -> Load {
    Load {
        gravity: Wrench::of_gravity(0.1, up),
        centre_of_mass: Vec3::ZERO,
        friction: THESIS_FRICTION,
    }
}

fn validate(
    contacts: &[Contact],
    load: &Load,
    takes_first: bool,
    seed: u64,
) -> (Immobility, ImmobilityBuffers) {
    let mut buffers = ImmobilityBuffers::default();
    let result = buffers.validate(
        contacts,
        load,
        takes_first,
        &mut AttemptStream::new(seed, 0),
        Stop::NEVER,
    );
    (result.expect("nothing stops it"), buffers)
}

/// Wrenches of unit forces have unit forces, on the boundary of a cone of 70.1° that opens into the object, spread
/// evenly, with torques of lines that meet 3 mm outside the surface.
#[test]
fn four_wrenches_lie_on_the_printed_cone_and_point_inward() {
    let mut stream = AttemptStream::new(3, 0);
    let half_angle = f64::from(THESIS_FRICTION).acos();
    assert!((half_angle.to_degrees() - 70.12).abs() < 0.01);
    for _ in 0..200 {
        let normal = stream.in_cube().normalize_or(Vec3::Y);
        let position = stream.in_cube() * 0.1;
        let centre_of_mass = stream.in_cube() * 0.05;
        let touch = contact(position, normal, HandPart::Phalanx(Digit::Thumb, Phalanx::Second));
        let wrenches = four_unit_wrenches(&touch, centre_of_mass, printed_cone_cos(THESIS_FRICTION));
        let tip = position.as_dvec3() - centre_of_mass.as_dvec3() + normal.as_dvec3() * 0.003;
        let mut sum = Vec3::ZERO;
        for wrench in wrenches {
            let force = wrench.force.as_dvec3();
            assert!((force.length() - 1.0).abs() < 1e-5);
            let inward = -normal.as_dvec3();
            assert!((force.dot(inward).acos() - half_angle).abs() < 1e-4);
            assert!((wrench.torque.as_dvec3() - tip.cross(force)).length() < 1e-6);
            sum += wrench.force;
        }
        // Evenly spread: opposite pairs cancel across the normal, neighbours stand at right angles there.
        assert!((sum + normal * 4.0 * THESIS_FRICTION).length() < 1e-5);
        let across = wrenches.map(|wrench| wrench.force + normal * THESIS_FRICTION);
        assert!(across[0].dot(across[1]).abs() < 1e-5 && across[1].dot(across[2]).abs() < 1e-5);
    }
}

/// Shares: each digit gets its noisy share, split evenly over its contacts, and every four magnitudes sum to that.
#[test]
fn distributions_split_noisy_shares_evenly_over_contacts() {
    let [thumb, index] = pinch();
    let contacts = [
        thumb,
        Contact {
            part: HandPart::Phalanx(Digit::Index, Phalanx::First),
            ..index
        },
        Contact {
            part: HandPart::Phalanx(Digit::Index, Phalanx::Second),
            ..index
        },
        index,
        Contact {
            part: HandPart::Phalanx(Digit::Little, Phalanx::Third),
            ..index
        },
    ];
    assert_eq!(contact_counts(&contacts), [1, 3, 0, 0, 1]);
    let mut stream = AttemptStream::new(5, 9);
    let mut distribution = ForceDistribution::default();
    let mut mean = [0.0_f64; 4];
    let rounds = 4000;
    for _ in 0..rounds {
        distribution.sample(&contacts, contact_counts(&contacts), &mut stream);
        assert!(distribution.magnitudes.iter().flatten().all(|&m| m >= 0.0));
        let totals = distribution.digit_totals(&contacts);
        for (digit, total) in totals.into_iter().enumerate() {
            let ratio = total / COMFORTABLE_SHARES[digit];
            let touches = matches!(digit, 0 | 1 | 4);
            assert!(if touches {
                (0.499..=1.501).contains(&ratio)
            } else {
                total == 0.0
            });
        }
        let sums: Vec<f32> = distribution.magnitudes.iter().map(|m| m.iter().sum()).collect();
        assert!((sums[1] - sums[2]).abs() < 1e-6 && (sums[1] - sums[3]).abs() < 1e-6);
        for (mean, magnitude) in mean.iter_mut().zip(distribution.magnitudes[0]) {
            *mean += f64::from(magnitude / sums[0]) / f64::from(rounds);
        }
    }
    // Flat Dirichlet of four: every weight has mean 1/4 (deviation of the mean: 0.19 / √4000 = 0.003).
    assert!(mean.iter().all(|mean| (mean - 0.25).abs() < 0.015), "{mean:?}");
}

/// The wrench sum of a pinch is as large as gravity's and within 5° of opposing it.
#[test]
fn an_immobilizing_distribution_is_scaled_to_the_weight() {
    let load = load(Vec3::Y);
    let weight = 0.1 * GRAVITY;
    for takes_first in [false, true] {
        let mut found = 0;
        for seed in 0..40 {
            let contacts = pinch();
            let (result, buffers) = validate(&contacts, &load, takes_first, seed);
            let Immobility::Immobilizing(angle) = result else {
                continue;
            };
            found += 1;
            let forces = buffers.forces();
            let force: Vec3 = forces.iter().sum();
            // The printed sum mixes newton metres with newtons, so the force alone may be slightly smaller.
            let torque_free = weight * 5.0_f32.to_radians().cos();
            assert!(force.length() <= weight * 1.0001 && force.length() >= torque_free * 0.999);
            let off = force.angle_between(Vec3::Y).to_degrees();
            assert!(off < 5.01 && off <= angle.to_degrees() + 0.05, "{off} {angle}");
            // Each force lies in its cone: the mean of forces on the boundary is inside.
            for (force, contact) in forces.iter().zip(&contacts) {
                assert!(force.dot(-contact.normal) >= force.length() * (THESIS_FRICTION - 1e-4));
            }
        }
        assert!(found >= 10, "only {found} of 40 pinches hold, {takes_first}");
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
