//! Look-ups and motions among further hands and obstacles, against checks of every grip by brute force.

use std::{
    sync::{Arc, LazyLock},
    time::Duration,
};

use glam::{Quat, Vec3};
use grasp_cases::cases;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{oriented_box::OrientedBox, tapered_capsule::TaperedCapsule},
    known::{atlas::Atlas, entry::Entry, recheck::GripChecker, seed_source::SeedSource},
    model::{
        grasp::Grasp,
        hand::{HandPose, joints::HandJoints},
        holdout::{HandShape, Holdout},
        obstacle::Obstacle,
    },
    physical::{
        grip::{GIVER_CLEARANCE, Gripper},
        scene::Presented,
        solids::{HandSolids, TrackedSolids},
    },
    search::{GraspSource, key_frames::key_frames},
};

use crate::fixtures::{
    atlases::grown_to,
    clocks::FakeClock,
    hands::right,
    holdouts::floating,
    meshes::gridded_box,
    objects::{object, object_of},
    proposals::object_scene,
    random::Random,
    searches::Search,
};

/// Grips of the remote in these tests.
const GRIPS: usize = 400;

/// Settings per test.
const SETTINGS: usize = 60;

static REMOTE: LazyLock<Arc<Atlas>> =
    LazyLock::new(|| Arc::new(grown_to(object("remote"), right(), GRIPS).atlas()));

/// Distances of a hand from the nearest of the holdout's hands and obstacles, pair by pair and ball by ball.
fn distances(holdout: &Holdout, pose: &HandPose) -> [f32; 2] {
    let solids = HandSolids::of_pose(right(), pose);
    let ours = TrackedSolids::of_rig(right(), pose.frame_from_wrist, &solids);
    let hands: Vec<TrackedSolids> = holdout
        .other_hands
        .iter()
        .filter_map(HandShape::joints)
        .map(TrackedSolids::of_joints)
        .collect();
    let from_hands = hands.iter().flat_map(TrackedSolids::iter).map(|their| {
        let distances = ours.iter().map(|our| our.distance(their));
        distances.fold(f32::INFINITY, f32::min)
    });
    let from_obstacle = |obstacle: &Obstacle, solid: &TaperedCapsule| {
        let balls = (0_u16..=400).map(|i| f32::from(i) / 400.0).map(|along| {
            let distance = match obstacle {
                Obstacle::Capsule(capsule) => capsule.signed_distance(solid.at(along)),
                Obstacle::Box(solid_box) => solid_box.signed_distance(solid.at(along)),
            };
            distance - solid.radius_at(along)
        });
        balls.fold(f32::INFINITY, f32::min)
    };
    let from_obstacles = holdout
        .obstacles
        .iter()
        .flat_map(|obstacle| ours.iter().map(move |solid| from_obstacle(obstacle, solid)));
    [
        from_hands.fold(f32::INFINITY, f32::min),
        from_obstacles.fold(f32::INFINITY, f32::min),
    ]
}

/// The remote among random hands and obstacles, some of which touch it.
fn crowded(random: &mut Random) -> Holdout {
    let mut holdout = floating(Arc::clone(object("remote")));
    for _ in 0..random.index(3) {
        let grip = &REMOTE.entries()[random.index(REMOTE.entries().len())].grip;
        holdout
            .other_hands
            .push(HandShape::Joints(Box::new(HandJoints::of_pose(
                right(),
                &grip.pose,
            ))));
    }
    for _ in 0..=random.index(2) {
        let place = random.in_cube() * 0.12;
        holdout.obstacles.push(if random.index(2) == 0 {
            let end = place + random.direction() * 0.2;
            Obstacle::Capsule(TaperedCapsule::new(place, end, 0.02, 0.01))
        } else {
            Obstacle::Box(OrientedBox {
                object_from_box: Pose::new(place, random.rotation()),
                half_extents: Vec3::new(0.05, 0.02, 0.08),
            })
        });
    }
    holdout
}

#[test]
fn look_ups_find_a_grip_exactly_where_one_is_clear_of_everything() {
    let mut random = Random::new(71);
    let (mut found, mut nothing) = (0, 0);
    let scene = object_scene(object("remote"));
    let settings = (cases(SETTINGS as u32) as usize).max(20);
    for setting in 0..settings {
        let mut holdout = crowded(&mut random);
        if setting % 3 == 0 {
            // Among twice as many, often nothing is clear.
            let more = crowded(&mut random);
            holdout.other_hands.extend(more.other_hands);
            holdout.obstacles.extend(more.obstacles);
        }
        let search = Search {
            atlas: Some(Arc::clone(&REMOTE)),
            reproducible: false,
            ..Search::guided(&holdout, right())
        };
        let outcome = search
            .look_up(&FakeClock::default(), Duration::from_secs(1))
            .found();
        if let Some(outcome) = outcome {
            let grasp = outcome.grasp.expect("it was found");
            assert!(matches!(outcome.report.source, Some(GraspSource::Atlas(_))));
            assert_is_clear(setting, &holdout, &grasp);
            found += 1;
            continue;
        }
        // How far the grips that would hold without barriers are from colliding; near 0, rounding decides.
        let free = Presented::of(&floating(Arc::clone(object("remote"))));
        let checker = GripChecker::new(&scene, right(), &free);
        let mut gripper = Gripper::default();
        let margin = |entry: &Entry| {
            let grasp = checker.check(entry, &entry.tracked_solids(right()), &mut gripper)?;
            let [from_hands, from_obstacles] = distances(&holdout, &grasp.pose);
            Some((from_hands - GIVER_CLEARANCE).min(from_obstacles))
        };
        let margins = REMOTE.entries().iter().filter_map(margin);
        let most = margins.fold(f32::NEG_INFINITY, f32::max);
        assert!(most < 0.0005, "setting {setting}: a grip has {most} m to spare");
        nothing += 1;
    }
    assert!(
        3 * found > settings && nothing > settings / 20,
        "{found} found, {nothing} without"
    );
}

/// Fails if a grasp touches a barrier or reports other distances than brute force finds.
fn assert_is_clear(setting: usize, holdout: &Holdout, grasp: &Grasp) {
    let [from_hands, from_obstacles] = distances(holdout, &grasp.pose);
    assert!(
        from_hands >= GIVER_CLEARANCE - 1e-6,
        "setting {setting}: {from_hands}"
    );
    assert!(from_obstacles > 0.0, "setting {setting}: {from_obstacles}");
    let margins = grasp.margins.expect("it is physical");
    for (reported, expected) in [
        (margins.giver_clearance, from_hands),
        (margins.obstacle_clearance, from_obstacles),
    ] {
        match reported {
            // Brute force looks at balls less than a millimetre apart.
            Some(reported) => assert!(
                (reported - expected).abs() < 4e-4,
                "setting {setting}: {reported}, not {expected}"
            ),
            None => assert_eq!(expected, f32::INFINITY, "setting {setting}"),
        }
    }
}

#[test]
fn searches_perturb_known_grips_clear_of_barriers() {
    let mut random = Random::new(72);
    let mut found = 0;
    for setting in 0..SETTINGS {
        let holdout = crowded(&mut random);
        let search = Search {
            seeds: SeedSource::Atlas(Arc::clone(&REMOTE)),
            max_attempts: 20,
            ..Search::guided(&holdout, right())
        };
        if let Some(grasp) = search.run().grasp {
            assert_is_clear(setting, &holdout, &grasp);
            found += 1;
        }
    }
    assert!(found > SETTINGS / 2, "{found} found");
}

#[test]
fn motions_keep_clear_of_obstacles() {
    const MOMENTS: u16 = 60;
    let mut random = Random::new(73);
    let scene = object_scene(object("remote"));
    let mut gripper = Gripper::default();
    let (mut planned, mut unplanned) = (0, 0);
    let settings = (cases(SETTINGS as u32) as usize / 2).max(5);
    for setting in 0..settings {
        let holdout = crowded(&mut random);
        let presented = Presented::of(&holdout);
        let checker = GripChecker::new(&scene, right(), &presented);
        let entries = REMOTE.entries().iter();
        let grasps = entries
            .filter_map(|entry| checker.check(entry, &entry.tracked_solids(right()), &mut gripper))
            .take(3);
        for grasp in grasps.collect::<Vec<_>>() {
            let Some(frames) = key_frames(&scene, &presented, right(), None, &grasp) else {
                unplanned += 1;
                continue;
            };
            planned += 1;
            for pair in frames.windows(2) {
                let [from, to] = [&pair[0].pose, &pair[1].pose];
                for moment in 0..=MOMENTS {
                    let share = f32::from(moment) / f32::from(MOMENTS);
                    let pose = between(from, to, share);
                    let [from_hands, from_obstacles] = distances(&holdout, &pose);
                    // To the accuracy of a motion's check.
                    assert!(
                        from_hands > 0.0 && from_obstacles > -1.5e-4,
                        "setting {setting}, {share}: {from_hands} and {from_obstacles}"
                    );
                }
            }
        }
    }
    assert!(planned > settings, "{planned} planned, {unplanned} not");
}

/// The hand between two frames.
fn between(from: &HandPose, to: &HandPose, share: f32) -> HandPose {
    let mix = |a: f32, b: f32| a + (b - a) * share;
    let mut pose = *to;
    pose.frame_from_wrist.position = from
        .frame_from_wrist
        .position
        .lerp(to.frame_from_wrist.position, share);
    for (digit, (a, b)) in pose.digits.iter_mut().zip(from.digits.iter().zip(&to.digits)) {
        digit.base_pitch = mix(a.base_pitch, b.base_pitch);
        digit.second_pitch = mix(a.second_pitch, b.second_pitch);
        digit.third_pitch = mix(a.third_pitch, b.third_pitch);
    }
    pose
}

#[test]
fn a_thin_object_is_taken_from_a_table() {
    let pen = object_of(gridded_box(Vec3::new(0.07, 0.005, 0.005), 4), &[]);
    let mut holdout = floating(Arc::new(pen));
    holdout.obstacles = vec![Obstacle::Box(OrientedBox {
        object_from_box: Pose::new(Vec3::new(0.0, -0.505, 0.0), Quat::IDENTITY),
        half_extents: Vec3::new(20.0, 0.5, 20.0),
    })];
    let search = Search {
        max_attempts: 4000,
        workers: 2,
        ..Search::guided(&holdout, right())
    };
    let outcome = search.run();
    let grasp = outcome.grasp.unwrap_or_else(|| panic!("{:?}", outcome.report));
    assert_is_clear(0, &holdout, &grasp);
}
