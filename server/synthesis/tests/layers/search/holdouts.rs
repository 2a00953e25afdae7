//! Searches on whole holdouts.

use grasp_synthesis::search::evaluation::{HINDRANCES, SIDES};

use crate::prelude::*;

/// A look-up under a clock that advances by a microsecond per reading.
fn look_up(search: &Search<'_>, within: Duration) -> Result<SearchOutcome, usize> {
    search.look_up(&FakeClock::ticking(1_000), within)
}

#[test]
fn a_resumed_look_up_finds_the_same_as_an_uninterrupted_one() {
    let known = complete_atlas("scissors");
    let pool = pool(1);
    let few = every(90, "scissors");
    let (mut cut, mut nothing) = (0, 0);
    let givers = 0..known.entries().len();
    let of_all = givers.clone().step_by(71).map(|giver| (giver, &known));
    for (giver, atlas) in of_all.chain(givers.step_by(4).map(|giver| (giver, &few))) {
        let holdout = scissors_held_by(&known, giver);
        let mut search = guided(&holdout).atlas(atlas).reproducible(false);
        let whole = look_up(&search, Duration::from_secs(1));
        let mut last = None;
        let in_parts = loop {
            match look_up(&search, Duration::from_micros(3)) {
                Ok(outcome) => break Some(outcome),
                Err(tried) => {
                    if last == Some(tried) {
                        break None;
                    }
                    assert!(tried > last.unwrap_or(0), "giver {giver}: {tried} after {last:?}");
                    // A search resumes there, too.
                    search.settings.known.tried = tried;
                    last = Some(tried);
                }
            }
        };
        let by_search = search.run_on(&pool);
        match (whole.clone().ok(), in_parts) {
            (Some(whole), Some(in_parts)) => {
                assert_eq!(
                    (whole.grasp.as_ref(), whole.report.source),
                    (in_parts.grasp.as_ref(), in_parts.report.source)
                );
                assert_eq!(
                    (by_search.grasp, by_search.report.source),
                    (whole.grasp, whole.report.source)
                );
                cut += usize::from(last.is_some());
            }
            (None, None) => {
                assert_eq!(by_search.grasp, None);
                assert_eq!(last, whole.err());
                nothing += 1;
            }
            (whole, in_parts) => panic!("giver {giver}: {whole:?}, in parts {in_parts:?}"),
        }
    }
    assert!(cut >= 10 && nothing >= 3, "{cut} {nothing}");
}

/// The first thing in the way, by the verdicts. The order of two barriers does not follow from the nearest alone.
fn in_the_way(judged: &Judgement) -> Option<Check> {
    // Verdicts allow for rounding in the client's frame.
    let fails = |check: Check| {
        let verdict = judged.verdicts.iter().find(|verdict| verdict.check == check);
        verdict.is_some_and(|verdict| {
            let bounded = verdict.figure.zip(verdict.bound);
            !verdict.passed || is_barrier(check) && bounded.is_some_and(|(figure, bound)| figure < bound)
        })
    };
    let unbalanced = fails(Check::Balance) || fails(Check::Closure);
    [
        (Check::GiverClearance, fails(Check::GiverClearance)),
        (Check::ObstacleClearance, fails(Check::ObstacleClearance)),
        (Check::Reach, fails(Check::Reach)),
        (Check::Balance, unbalanced),
        (Check::Requirements, !judged.is_valid()),
    ]
    .into_iter()
    .find_map(|(check, is_failed)| is_failed.then_some(check))
}

fn is_barrier(check: Check) -> bool {
    matches!(check, Check::GiverClearance | Check::ObstacleClearance)
}

fn with_surroundings(holdout: Holdout) -> Holdout {
    let (centre, up) = (holdout.object.centre_of_mass, holdout.up);
    let table = Pose::new(centre - up * 0.55, Quat::from_rotation_arc(Vec3::Y, up));
    let shoulder = centre + up * 0.2 + up.any_orthonormal_vector() * 0.35;
    Holdout {
        obstacles: vec![Obstacle::Box(oriented_box(table, Vec3::new(1.0, 0.5, 1.0)))],
        stance: Stance::At(arm(shoulder, 0.3, 0.26)),
        ..holdout
    }
}

#[test]
fn ratings_count_the_verdicts_on_every_known_grip() {
    let mut causes = [0; 6];
    for (place, holdout) in tracked_holdouts().enumerate().step_by(4) {
        let atlas = every(10, name_of(&holdout.object));
        for holdout in [holdout.clone(), with_surroundings(holdout)] {
            let search = guided(&holdout).atlas(&atlas);
            let evaluation = search.evaluate(Stop::NEVER);
            let mut expected = [0; 6];
            let (mut valid, mut best) = ([0; 6], 0.0_f32);
            for entry in atlas.entries() {
                let judged = search.judge(&entry.grip.pose);
                let from = entry.grip.pose.frame_from_wrist.transform_vector(Vec3::NEG_Z);
                let side = (0..6).max_by(|&a, &b| SIDES[a].dot(from).total_cmp(&SIDES[b].dot(from)));
                if let Some(what) = in_the_way(&judged) {
                    let place = HINDRANCES.iter().position(|&other| other == what);
                    expected[place.expect("it is one of these")] += 1;
                } else {
                    valid[side.expect("there are sides")] += 1;
                    best = best.max(judged.grasp.score.map_or(0.0, |score| score.total()));
                }
            }
            assert_eq!(evaluation.known() as usize, atlas.entries().len());
            assert_eq!(evaluation.hindered, expected, "holdout {place}");
            assert_eq!(evaluation.sides.map(|side| side.valid), valid, "holdout {place}");
            assert!((evaluation.best_score() - best).abs() < 1e-4, "holdout {place}");
            for (sum, count) in causes.iter_mut().zip(expected) {
                *sum += count;
            }
        }
    }
    let [presenting, others, obstacles, reach, ..] = causes;
    assert!(
        presenting > 0 && others == 0 && obstacles > 0 && reach > 0,
        "{causes:?}"
    );
}

#[test]
fn a_stopped_rating_counts_the_grips_it_has_checked() {
    use std::sync::atomic::{AtomicUsize, Ordering};
    let holdout = tracked_holdouts().next().expect("there are holdouts");
    let search = guided(&holdout).atlas(&every(10, name_of(&holdout.object)));
    let asked = AtomicUsize::new(0);
    let is_over = || asked.fetch_add(1, Ordering::Relaxed) >= 10;
    assert_eq!(search.evaluate(Stop::when(&is_over)).known(), 10);
}

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
            // Twice the number often leaves no clear grip.
            let more = crowded(&mut random);
            holdout.other_hands.extend(more.other_hands);
            holdout.obstacles.extend(more.obstacles);
        }
        let search = guided(&holdout).atlas(&REMOTE).reproducible(false);
        let outcome = search.look_up(&FakeClock::default(), Duration::from_secs(1));
        if let Ok(outcome) = outcome {
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
