//! Wrist Placement against the plain order of checks and against brute force.

use grasp_synthesis::thesis::wrist_placement::{
    FORWARD_WRIST_ANGLE_DEGREES, PALM_COM_PALM_ANGLE_DEGREES, PALM_DISTANCE, PlacementMeasures,
    UPWARD_WRIST_ANGLE_DEGREES, WRIST_ANGLE_SUM_DEGREES, WRIST_DISTANCE, WristPlacer,
};

use crate::fixtures::oracle::closest_on_mesh;
use crate::prelude::*;

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
            let to_object = closest_on_mesh(mesh, palm) - wrist;
            let angle = |a: DVec3, b: DVec3| a.angle_between(b).to_degrees();
            let upward = angle(rotation * DVec3::Y, to_object);
            let forward = angle(rotation * DVec3::Z, to_object);
            let mut measures = vec![
                (wrist.distance(closest_on_mesh(mesh, wrist)), WRIST_DISTANCE, 1e-5),
                (palm.distance(closest_on_mesh(mesh, palm)), PALM_DISTANCE, 1e-5),
                (upward, UPWARD_WRIST_ANGLE_DEGREES, 1e-2),
                (forward, FORWARD_WRIST_ANGLE_DEGREES, 1e-2),
                (upward + forward, WRIST_ANGLE_SUM_DEGREES, 2e-2),
            ];
            if let Some(giver) = &holdout.presenting_hand {
                let up = holdout.up.as_dvec3();
                let flat = |point: DVec3| (point - holdout.object.centre_of_mass.as_dvec3()).reject_from(up);
                let turned = angle(flat(giver.palm.as_dvec3()), flat(palm));
                measures.push((turned, PALM_COM_PALM_ANGLE_DEGREES, 1e-2));
            }
            for (value, range, slack) in measures {
                let [min, max] = [range.min, range.max].map(f64::from);
                assert!(value > min - slack && value < max + slack, "{value}, {range:?}");
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
                assert_eq!((plain, expected_prunes), (pose, pruned), "{attempt} {strategy:?}");
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
    let placed =
        |wrist_distance, palm_distance, upward_angle_degrees, forward_angle_degrees| PlacementMeasures {
            wrist_distance,
            palm_distance,
            upward_angle_degrees,
            forward_angle_degrees,
            ..good
        };
    let by_object = [
        placed(0.0074, 0.02, 30.0, 70.0),
        placed(0.1201, 0.02, 30.0, 70.0),
        placed(0.05, 0.0801, 30.0, 70.0),
        placed(0.05, 0.02, 55.1, 59.0),
        placed(0.05, 0.02, 55.0, 34.9),
        placed(0.05, 0.02, 10.0, 95.1),
        placed(0.05, 0.02, 30.0, 85.1),
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
