//! Wrist Placement against the plain order of checks and against brute force.

use glam::{DVec3, Vec3};
use grasp_synthesis::{
    base::{pose::Pose, random::AttemptStream, stop::Stop},
    geometry::mesh::TriangleMesh,
    model::{hand::rig::Rig, holdout::Holdout, strategy::Strategy},
    thesis::{
        placement_measures::{
            FORWARD_WRIST_ANGLE_DEGREES, PALM_COM_PALM_ANGLE_DEGREES, PALM_DISTANCE, PlacementMeasures,
            UPWARD_WRIST_ANGLE_DEGREES, WRIST_ANGLE_SUM_DEGREES, WRIST_DISTANCE,
        },
        wrist_placement::WristPlacer,
    },
};

use crate::fixtures::{
    hands::simple_rig,
    holdouts::{floating, held},
    objects::{bar, plate, rod},
};

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

/// The point of a mesh closest to another, over all triangles in double precision (Ericson, Real-Time Collision
/// Detection, 5.1.5, as projections onto plane and edges).
fn closest_by_brute_force(mesh: &TriangleMesh, point: DVec3) -> DVec3 {
    let on_edge = |a: DVec3, b: DVec3| {
        a + (b - a) * ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0)
    };
    (0..mesh.triangles().len())
        .flat_map(|triangle| {
            let [a, b, c] = mesh.corners(triangle).map(Vec3::as_dvec3);
            let normal = (b - a).cross(c - a);
            let foot = point - normal * ((point - a).dot(normal) / normal.length_squared());
            let inside = [(a, b), (b, c), (c, a)]
                .iter()
                .all(|&(from, to)| (to - from).cross(foot - from).dot(normal) >= 0.0);
            if inside {
                vec![foot]
            } else {
                vec![on_edge(a, b), on_edge(b, c), on_edge(c, a)]
            }
        })
        .min_by(|p, q| p.distance_squared(point).total_cmp(&q.distance_squared(point)))
        .expect("a mesh has triangles")
}

/// Recomputed from scratch in double precision, all measures are in the ranges of Table 5.3.
#[test]
fn accepted_placements_have_their_measures_in_range() {
    let rig = simple_rig();
    for holdout in scenes() {
        let mesh = holdout.object.surface.mesh();
        for attempt in 0..60 {
            let (pose, _) = place(&holdout, rig, Strategy::C, attempt);
            let wrist = pose.position.as_dvec3();
            let rotation = pose.orientation.as_dquat();
            let palm = wrist + rotation * rig.palm.as_dvec3();
            let to_object = closest_by_brute_force(mesh, palm) - wrist;
            let angle = |a: DVec3, b: DVec3| a.angle_between(b).to_degrees();
            let upward = angle(rotation * DVec3::Y, to_object);
            let forward = angle(rotation * DVec3::Z, to_object);
            let in_range =
                |value: f64, range: grasp_synthesis::thesis::placement_measures::MeasureRange, slack| {
                    assert!(
                        value > f64::from(range.min) - slack && value < f64::from(range.max) + slack,
                        "{value} is not in {range:?}"
                    );
                };
            in_range(
                wrist.distance(closest_by_brute_force(mesh, wrist)),
                WRIST_DISTANCE,
                1e-5,
            );
            in_range(
                palm.distance(closest_by_brute_force(mesh, palm)),
                PALM_DISTANCE,
                1e-5,
            );
            in_range(upward, UPWARD_WRIST_ANGLE_DEGREES, 1e-2);
            in_range(forward, FORWARD_WRIST_ANGLE_DEGREES, 1e-2);
            in_range(upward + forward, WRIST_ANGLE_SUM_DEGREES, 2e-2);
            if let Some(giver) = &holdout.presenting_hand {
                let up = holdout.up.as_dvec3();
                let flat = |point: DVec3| {
                    let arm = point - holdout.object.centre_of_mass.as_dvec3();
                    arm - up * arm.dot(up)
                };
                in_range(
                    angle(flat(giver.palm.as_dvec3()), flat(palm)),
                    PALM_COM_PALM_ANGLE_DEGREES,
                    1e-2,
                );
            }
            // O lies in C - B.
            let outside = holdout.object.bounding_box.distance(pose.position);
            assert!(outside > 0.0 && outside <= rig.reach * 1.0001);
        }
    }
}

/// Strategy A prunes nothing and fills C - B: the share of positions within half the reach is that of the volumes.
#[test]
fn naive_placements_are_uniform_in_the_shell() {
    let (holdout, rig) = (floating(bar()), simple_rig());
    let rounds = 20_000;
    let mut within = 0;
    let mut mean_axis = DVec3::ZERO;
    for attempt in 0..rounds {
        let (pose, pruned) = place(&holdout, rig, Strategy::A, attempt);
        assert_eq!(pruned, 0);
        let outside = holdout.object.bounding_box.distance(pose.position);
        assert!(outside > 0.0 && outside <= rig.reach * 1.0001);
        within += u32::from(outside <= rig.reach / 2.0);
        mean_axis += (pose.orientation * Vec3::Y).as_dvec3();
    }
    // Steiner: the shell of width r around a box has faces · r + (π/4) edges · r² + (4π/3) r³.
    let edges = holdout.object.bounding_box.half_extents.as_dvec3() * 2.0;
    let faces = 2.0 * (edges.x * edges.y + edges.y * edges.z + edges.z * edges.x);
    let lengths = 4.0 * (edges.x + edges.y + edges.z);
    let shell = |r: f64| {
        faces * r
            + std::f64::consts::FRAC_PI_4 * lengths * r * r
            + 4.0 / 3.0 * std::f64::consts::PI * r.powi(3)
    };
    let reach = f64::from(rig.reach);
    let expected = shell(reach / 2.0) / shell(reach);
    let share = f64::from(within) / rounds as f64;
    // Four standard deviations.
    let tolerance = 4.0 * (expected * (1.0 - expected) / rounds as f64).sqrt();
    assert!((share - expected).abs() < tolerance, "{share}, not {expected}");
    assert!(mean_axis.length() / (rounds as f64) < 4.0 / (rounds as f64).sqrt());
}

/// From the same stream, the first placement with all measures in range is returned, after as many prunes.
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
                    if position_measure <= WRIST_DISTANCE.max + 1e-5 {
                        let pose = Pose {
                            position,
                            orientation: (snug.object_from_box.orientation * stream.rotation()).normalize(),
                        };
                        compared += 1;
                        if PlacementMeasures::of(&holdout, rig, pose).are_in_range(strategy) {
                            break pose;
                        }
                    }
                    expected_prunes += 1;
                };
                assert_eq!(
                    (plain, expected_prunes),
                    (pose, pruned),
                    "attempt {attempt} of {strategy:?}"
                );
            }
        }
    }
    assert!(compared > 10_000, "only {compared} placements compared");
}

/// The measures would allow more than the reach.
#[test]
fn a_short_hand_stays_within_its_reach() {
    let short = Rig {
        reach: 0.07,
        palm: Vec3::new(0.0, 0.02, 0.005),
        ..Rig::clone(simple_rig())
    };
    let holdout = floating(bar());
    let outside = |strategy, attempt| {
        let (pose, _) = place(&holdout, &short, strategy, attempt);
        holdout.object.bounding_box.distance(pose.position)
    };
    for strategy in [Strategy::A, Strategy::B] {
        let farthest = (0..300)
            .map(|attempt| outside(strategy, attempt))
            .fold(0.0, f32::max);
        assert!(farthest > 0.05 && farthest <= short.reach * 1.0001, "{farthest}");
    }
}

#[test]
fn the_palm_angle_prunes_only_with_a_giver() {
    let rig = simple_rig();
    let with = held(bar());
    let without = floating(bar());
    for attempt in 0..50 {
        // Without a giver, C is B.
        assert_eq!(
            place(&without, rig, Strategy::B, attempt),
            place(&without, rig, Strategy::C, attempt)
        );
    }
    let behind = |strategy| {
        (0..200)
            .filter(|&attempt| {
                let (pose, _) = place(&with, rig, strategy, attempt);
                PlacementMeasures::of(&with, rig, pose)
                    .palm_com_palm_angle_degrees
                    .is_some_and(|angle| angle < 89.9)
            })
            .count()
    };
    assert_eq!(behind(Strategy::C), 0);
    assert!(behind(Strategy::B) > 20);
}

/// Its direction on the ground plane is undefined.
#[test]
fn a_palm_above_the_centre_of_mass_is_in_range() {
    let mut holdout = held(bar());
    holdout.up = Vec3::Y;
    let rig = simple_rig();
    let pose = Pose::from_position(Vec3::new(0.0, 0.2, 0.0) - rig.palm);
    let measures = PlacementMeasures::of(&holdout, rig, pose);
    assert_eq!(measures.palm_com_palm_angle_degrees, None);
    let allowed = PlacementMeasures {
        wrist_distance: 0.05,
        palm_distance: 0.02,
        upward_angle_degrees: 30.0,
        forward_angle_degrees: 70.0,
        ..measures
    };
    assert!(allowed.are_in_range(Strategy::F));
}

/// At both ends of every range of Table 5.3.
#[test]
fn each_measure_prunes_beyond_its_range() {
    let good = PlacementMeasures {
        wrist_distance: 0.05,
        palm_distance: 0.02,
        upward_angle_degrees: 30.0,
        forward_angle_degrees: 70.0,
        palm_com_palm_angle_degrees: Some(120.0),
    };
    assert!(good.are_in_range(Strategy::C));
    let by_object = [
        PlacementMeasures {
            wrist_distance: 0.0074,
            ..good
        },
        PlacementMeasures {
            wrist_distance: 0.1201,
            ..good
        },
        PlacementMeasures {
            palm_distance: 0.0801,
            ..good
        },
        PlacementMeasures {
            upward_angle_degrees: 55.1,
            forward_angle_degrees: 59.0,
            ..good
        },
        PlacementMeasures {
            forward_angle_degrees: 34.9,
            upward_angle_degrees: 55.0,
            ..good
        },
        PlacementMeasures {
            forward_angle_degrees: 95.1,
            upward_angle_degrees: 10.0,
            ..good
        },
        PlacementMeasures {
            forward_angle_degrees: 85.1,
            ..good
        },
    ];
    for measures in by_object {
        assert!(!measures.are_in_range(Strategy::B), "{measures:?}");
        assert!(measures.are_in_range(Strategy::A));
    }
    let near_giver = PlacementMeasures {
        palm_com_palm_angle_degrees: Some(89.9),
        ..good
    };
    assert!(near_giver.are_in_range(Strategy::B) && !near_giver.are_in_range(Strategy::C));
}
