//! Look-ups and motions among further hands and obstacles, against checks of every grip by brute force.

use grasp_synthesis::search::key_frames::key_frames;

use crate::prelude::*;

/// Grips of the remote in these tests.
const GRIPS: usize = 400;

/// Settings per test.
const SETTINGS: usize = 60;

static REMOTE: LazyLock<Arc<Atlas>> =
    LazyLock::new(|| Arc::new(grown_to(object("remote"), right(), GRIPS).atlas()));

/// Distances of a hand from the nearest of the holdout's hands and obstacles, pair by pair and ball by ball.
fn distances(holdout: &Holdout, pose: &HandPose) -> [f32; 2] {
    let ours = tracked(pose);
    let hands = holdout.other_hands.iter().filter_map(HandShape::joints);
    let from_hands = hands.map(|hand| pair_distance(ours.iter(), TrackedSolids::of_joints(hand).iter()));
    let obstacles = holdout.obstacles.iter();
    let from_obstacles =
        obstacles.flat_map(|other| ours.iter().map(move |solid| sampled_distance(other, solid)));
    let least = f32::INFINITY;
    [
        from_hands.fold(least, f32::min),
        from_obstacles.fold(least, f32::min),
    ]
}

/// The remote among random hands and obstacles, some of which touch it.
fn crowded(random: &mut Random) -> Holdout {
    let mut holdout = floating(Arc::clone(object("remote")));
    for _ in 0..random.index(3) {
        let grip = &REMOTE.entries()[random.index(REMOTE.entries().len())].grip;
        let hand = Box::new(HandJoints::of_pose(right(), &grip.pose));
        holdout.other_hands.push(HandShape::Joints(hand));
    }
    for _ in 0..=random.index(2) {
        let place = random.in_cube() * 0.12;
        holdout.obstacles.push(if random.index(2) == 0 {
            let end = place + random.direction() * 0.2;
            Obstacle::Capsule(TaperedCapsule::new(place, end, 0.02, 0.01))
        } else {
            Obstacle::Box(oriented_box(
                Pose::new(place, random.rotation()),
                Vec3::new(0.05, 0.02, 0.08),
            ))
        });
    }
    holdout
}

#[test]
fn look_ups_find_a_grip_exactly_where_one_is_clear_of_everything() {
    let mut random = Random::new(71);
    let (mut found, mut nothing) = (0, 0);
    let free = valid_grips(&floating(Arc::clone(object("remote"))), &REMOTE);
    let settings = (cases(SETTINGS as u32) as usize).max(20);
    for setting in 0..settings {
        let mut holdout = crowded(&mut random);
        if setting % 3 == 0 {
            // Among twice as many, often nothing is clear.
            let more = crowded(&mut random);
            holdout.other_hands.extend(more.other_hands);
            holdout.obstacles.extend(more.obstacles);
        }
        let search = guided(&holdout).atlas(&REMOTE).reproducible(false);
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
        let margins = free.iter().flatten().map(|grasp| {
            let [from_hands, from_obstacles] = distances(&holdout, &grasp.pose);
            (from_hands - GIVER_CLEARANCE).min(from_obstacles)
        });
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
    let is_clear = from_hands >= GIVER_CLEARANCE - 1e-6 && from_obstacles > 0.0;
    assert!(is_clear, "setting {setting}: {from_hands} and {from_obstacles}");
    let margins = grasp.margins.expect("it is physical");
    for (reported, expected) in [
        (margins.giver_clearance, from_hands),
        (margins.obstacle_clearance, from_obstacles),
    ] {
        // Brute force looks at balls less than a millimetre apart.
        let off = reported.map_or(0.0, |reported| reported - expected);
        assert!(off.abs() < 4e-4, "{setting} {reported:?} {expected}");
        assert_eq!(reported.is_none(), expected == f32::INFINITY, "setting {setting}");
    }
}

#[test]
fn motions_keep_clear_of_obstacles() {
    const MOMENTS: u16 = 60;
    let mut random = Random::new(73);
    let scene = object_scene(object("remote"));
    let (mut planned, mut unplanned) = (0, 0);
    let settings = (cases(SETTINGS as u32) as usize / 2).max(5);
    for setting in 0..settings {
        let holdout = crowded(&mut random);
        let presented = Presented::of(&holdout);
        for grasp in valid_grips(&holdout, &REMOTE).into_iter().flatten().take(3) {
            let Some(frames) = key_frames(&scene, &presented, right(), None, &grasp) else {
                unplanned += 1;
                continue;
            };
            planned += 1;
            for pair in frames.windows(2) {
                let [from, to] = [&pair[0].pose, &pair[1].pose];
                for moment in 0..=MOMENTS {
                    let share = f32::from(moment) / f32::from(MOMENTS);
                    let pose = pose_between(from, to, share);
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
