//! Grasps are valid by an independent judge, every kind of rejection occurs where it should, and the strategies differ
//! as described.

use glam::{DVec3, Vec3};
use grasp_synthesis::{
    base::{pose::Pose, rejection::Rejection},
    geometry::mesh::TriangleMesh,
    model::{
        bend_ratios::BendRatioChoice,
        grasp::Grasp,
        hand::{Digit, HandPart, HandPose, kinematics::hand_frames, rig::Rig},
        holdout::Holdout,
        object::GraspObject,
        strategy::Strategy,
    },
    search::SearchEnd,
    thesis::{
        collision_validation::collision, finger_posing::PosedDigit, placement_measures::PlacementMeasures,
        wrist_placement::WristFrame,
    },
};

use crate::fixtures::{
    hands::simple_rig,
    holdouts::{box_at, floating, held, upright_bar_with_forbidden_ends},
    meshes::gridded_box,
    objects::{bar, bar_mesh, object_of, plate, rod},
    searches::Search,
};

fn thesis(holdout: &Holdout, strategy: Strategy) -> Search<'_> {
    Search::thesis(holdout, simple_rig(), strategy)
}

/// True if the segment crosses a triangle of the mesh (Möller and Trumbore in double precision, all triangles).
fn crosses(mesh: &TriangleMesh, from: DVec3, to: DVec3) -> bool {
    (0..mesh.triangles().len()).any(|triangle| {
        let [a, b, c] = mesh.corners(triangle).map(Vec3::as_dvec3);
        let (direction, ab, ac) = (to - from, b - a, c - a);
        let p = direction.cross(ac);
        let determinant = ab.dot(p);
        let (offset, q) = (from - a, (from - a).cross(ab));
        let (u, v, t) = (
            offset.dot(p) / determinant,
            direction.dot(q) / determinant,
            ac.dot(q) / determinant,
        );
        determinant.abs() > 1e-18 && u > 1e-6 && v > 1e-6 && u + v < 1.0 - 1e-6 && t > 1e-6 && t < 1.0 - 1e-6
    })
}

/// True if the mesh winds around the point (van Oosterom and Strackee's solid angles).
fn winds_around(mesh: &TriangleMesh, point: DVec3) -> bool {
    let solid_angle: f64 = (0..mesh.triangles().len())
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3() - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(denominator)
        })
        .sum();
    solid_angle.abs() > 2.0 * std::f64::consts::PI
}

/// Judges a grasp with plain kinematics, brute force and double precision.
fn assert_valid(grasp: &Grasp, search: &Search<'_>) {
    let (holdout, rig) = (search.holdout, search.rig);
    let object = &holdout.object;
    let mesh = object.surface.mesh();
    let wrist = grasp.pose.frame_from_wrist;
    assert!(PlacementMeasures::of(holdout, rig, wrist).are_in_range(search.strategy));

    // Anatomy.
    for (angles, digit) in grasp.pose.digits.iter().zip(&rig.digits) {
        let limits = &digit.limits;
        assert!(limits.base_yaw.contains(angles.base_yaw, 1e-5));
        assert!(limits.base_pitch.contains(angles.base_pitch, 1e-5));
        assert!(limits.second_pitch.contains(angles.second_pitch, 1e-5));
        assert!((angles.third_pitch - angles.second_pitch * 2.0 / 3.0).abs() < 1e-5);
    }

    // Contacts: thumb and finger, one per link, on the touch segments and on their triangles, none forbidden.
    let touches = |digit| {
        grasp
            .contacts
            .iter()
            .any(|contact| contact.part.digit() == Some(digit))
    };
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
    let palm = rig
        .palm_segments
        .iter()
        .map(|segment| [segment.start, segment.end].map(|point| wrist.transform_point(point).as_dvec3()));
    let bones = frames.digits.iter().flat_map(|digit| {
        let joints = [
            digit.links[0].position,
            digit.links[1].position,
            digit.links[2].position,
            digit.tip,
        ]
        .map(Vec3::as_dvec3);
        [
            [joints[0], joints[1]],
            [joints[1], joints[2]],
            [joints[2], joints[3]],
        ]
    });
    let giver = holdout
        .presenting_hand
        .as_ref()
        .and_then(|hand| Some(hand.surface()?.mesh()));
    for [from, to] in palm.chain(bones) {
        for mesh in std::iter::once(mesh).chain(giver) {
            assert!(!crosses(mesh, from, to) && !winds_around(mesh, from));
        }
    }

    // Forces: in their cones, summed to a wrench of gravity's size that opposes gravity within 5°.
    let weight = 9.81 * f64::from(object.mass);
    let (mut force_sum, mut torque_sum) = (DVec3::ZERO, DVec3::ZERO);
    for (force, contact) in grasp.forces.iter().zip(&grasp.contacts) {
        let (force, inward) = (force.as_dvec3(), -contact.normal.as_dvec3());
        assert!(force.dot(inward) > force.length() * (f64::from(search.friction) - 1e-3));
        // All four lines of force of a contact meet in the cone's tip, 3 mm outside the surface.
        let tip = contact.position.as_dvec3() - inward * 0.003 - object.centre_of_mass.as_dvec3();
        force_sum += force;
        torque_sum += tip.cross(force);
    }
    let magnitude = (force_sum.length_squared() + torque_sum.length_squared()).sqrt();
    assert!(
        (magnitude / weight - 1.0).abs() < 1e-4,
        "{magnitude} N, not {weight} N"
    );
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
                let search = Search {
                    seed,
                    ..thesis(&holdout, strategy)
                };
                let outcome = search.run();
                assert_eq!(
                    outcome.end,
                    SearchEnd::Found,
                    "{strategy:?}, seed {seed}: {:?}",
                    outcome.report
                );
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
        let rest = Search {
            first_attempt: done,
            max_attempts: attempts - done,
            ..search.clone()
        };
        let report = rest.run().report;
        assert_eq!(
            report.rejections.iter().sum::<u64>() + u64::from(report.attempt.is_some()),
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
        let run = |strategy| {
            let search = Search {
                seed,
                bend_ratios: ratios,
                ..thesis(&holdout, strategy)
            };
            search.run()
        };
        let (c, d) = (run(Strategy::C), run(Strategy::D));
        assert_eq!(c.grasp, d.grasp);
        let (c, d) = (c.report, d.report);
        assert_eq!((c.attempt, c.pruned_placements), (d.attempt, d.pruned_placements));
        let c_thumb = count(&c.rejections, Rejection::NoThumb) + count(&c.rejections, Rejection::NoContacts);
        assert_eq!(c_thumb, count(&d.rejections, Rejection::NoThumbEarlyStop));
        assert_eq!(c.rejections[3..], d.rejections[3..]);
    }
}

/// E takes the best of a hundred distributions, F the first that suffices: the same attempts are valid under both.
#[test]
fn the_first_sufficient_distribution_changes_no_verdict() {
    let holdout = held(rod());
    for seed in 0..8 {
        let run = |strategy| {
            let search = Search {
                seed,
                ..thesis(&holdout, strategy)
            };
            search.run()
        };
        let (e, f) = (run(Strategy::E), run(Strategy::F));
        assert_eq!(e.report, f.report);
        let (e, f) = (e.grasp.expect("found"), f.grasp.expect("found"));
        assert_eq!((&e.pose, &e.contacts), (&f.pose, &f.contacts));
        assert!(e.wrench_angle <= f.wrench_angle);
    }
}

/// Where the whole surface is forbidden, every grasp that gets to its contacts is rejected for them.
#[test]
fn forbidden_surfaces_give_unwanted_contacts() {
    let mesh = bar_mesh();
    let all: Vec<u32> = (0..mesh.triangles().len() as u32).collect();
    let holdout = held(object_of(mesh, &all));
    let counts = rejections(&thesis(&holdout, Strategy::F), 3000);
    assert!(count(&counts, Rejection::UnwantedContact) > 0);
    assert_eq!(count(&counts, Rejection::NotImmobilizing), 0);
}

#[test]
fn grasps_stay_off_forbidden_surfaces() {
    let mesh = bar_mesh();
    // The faces across x, a third of the surface.
    let forbidden: Vec<u32> = (0..mesh.triangles().len())
        .filter(|&triangle| mesh.normal(triangle).x.abs() > 0.9)
        .map(|triangle| triangle as u32)
        .collect();
    let holdout = held(object_of(mesh, &forbidden));
    for seed in 0..4 {
        let search = Search {
            seed,
            ..thesis(&holdout, Strategy::F)
        };
        let grasp = search.run().grasp.expect("the other faces can be held");
        assert!(grasp.contacts.iter().all(|contact| contact.normal.x.abs() < 0.9));
    }
}

/// With μ = 1 the printed cone has closed to the normal: nothing lifts a bar that stands upright by its sides.
#[test]
fn an_upright_bar_without_tangential_forces_is_not_immobilized() {
    let holdout = upright_bar_with_forbidden_ends();
    let search = Search {
        friction: 1.0,
        ..thesis(&holdout, Strategy::F)
    };
    let counts = rejections(&search, 4000);
    assert!(count(&counts, Rejection::NotImmobilizing) > 0);
    let long = Search {
        max_attempts: 4000,
        ..search
    };
    let miss = long.run().report.nearest_miss;
    let angle = miss
        .expect("no attempt is valid")
        .wrench_angle
        .expect("it got to the last step");
    assert!(angle.to_degrees() > 80.0);
}

/// The stretched hand at a wrist, in the form that Finger Posing returns.
fn stretched_hand(rig: &Rig, wrist: &WristFrame) -> [PosedDigit; 5] {
    let pose = HandPose {
        frame_from_wrist: wrist.object_from_wrist,
        digits: rig.stretched(),
    };
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
    let mut holdout = if giver_at.is_some() {
        held(object)
    } else {
        floating(object)
    };
    if let (Some(at), Some(giver)) = (giver_at, &mut holdout.presenting_hand) {
        giver.skin = Some(box_at(at, Vec3::splat(0.02), 2));
    }
    let wrist = WristFrame::new(Pose::from_position(wrist));
    collision(
        &holdout,
        simple_rig(),
        &wrist,
        &stretched_hand(simple_rig(), &wrist),
    )
}

/// Of palm and fingers, with the object and with the giver, by crossing and by containment.
#[test]
fn collisions_are_reported_by_part() {
    let cube = || object_of(gridded_box(Vec3::splat(0.02), 2), &[]);
    let far = Vec3::new(0.0, 0.0, 1.0);
    // The cube far away, in the palm, and around the fingertips.
    assert_eq!(collision_at(cube(), None, far), None);
    assert_eq!(
        collision_at(cube(), None, Vec3::new(0.0, -0.05, 0.0)),
        Some(Rejection::PalmCollision)
    );
    assert_eq!(
        collision_at(cube(), None, Vec3::new(0.0, -0.18, 0.0)),
        Some(Rejection::FingerCollision)
    );
    // The same with the giver, while the object is far away.
    assert_eq!(collision_at(cube(), Some(far + Vec3::Y * 0.5), far), None);
    let palm = far + Vec3::new(0.0, 0.05, 0.0);
    assert_eq!(
        collision_at(cube(), Some(palm), far),
        Some(Rejection::PalmCollision)
    );
    let fingers = far + Vec3::new(0.0, 0.18, 0.0);
    assert_eq!(
        collision_at(cube(), Some(fingers), far),
        Some(Rejection::FingerCollision)
    );
    // The palm is checked first, against object and giver.
    let both = Vec3::new(0.0, -0.18, 0.0);
    assert_eq!(
        collision_at(cube(), Some(both + Vec3::new(0.0, 0.05, 0.0)), both),
        Some(Rejection::PalmCollision)
    );
    // A body around the whole hand is crossed by nothing.
    let hall = || object_of(gridded_box(Vec3::splat(0.5), 2), &[]);
    assert_eq!(
        collision_at(hall(), None, Vec3::ZERO),
        Some(Rejection::PalmCollision)
    );
    // Nor do bones that lie entirely inside the object or the giver cross anything.
    let rig = simple_rig();
    let wrist = WristFrame::new(Pose::from_position(far));
    let mut digits = stretched_hand(rig, &wrist);
    assert_eq!(collision(&floating(cube()), rig, &wrist, &digits), None);
    digits[3].joints = [-0.01, -0.005, 0.0, 0.01].map(|x| Vec3::new(x, 0.002, 0.003));
    let inside = collision(&floating(cube()), rig, &wrist, &digits);
    assert_eq!(inside, Some(Rejection::FingerCollision));
    let mut held = held(object_of(gridded_box(Vec3::splat(0.001), 1), &[]));
    digits[3].joints = digits[3]
        .joints
        .map(|joint| joint + Vec3::new(0.01, -0.07, -0.01));
    assert_eq!(
        collision(&held, rig, &wrist, &digits),
        Some(Rejection::FingerCollision)
    );
    held.presenting_hand = None;
    assert_eq!(collision(&held, rig, &wrist, &digits), None);
}
