//! The success prior, a network that ranks proposed hands, on objects that it was not trained on.

use grasp_synthesis::propose::{
    opposition::{Opposition, Oppositions},
    proposal::{Candidate, propose_evenly},
    success_prior::{INPUTS, MAX_DEVIATION, ObjectFeatures, TRAINED, UNITS},
};

use crate::prelude::*;

fn holds_freely(object: &GraspObject, proposal: &Proposal, attempt: &mut PhysicalAttempt) -> bool {
    holds(attempt, &surroundings(object, &NO_GIVER, right()), proposal)
}

#[test]
fn hands_rated_better_hold_more_often() {
    for name in OBJECT_NAMES {
        let object = object(name);
        let bulk = ObjectFeatures::of(object);
        let mut attempt = PhysicalAttempt::default();
        let mut rated: Vec<(f32, bool)> = (0..6000)
            .filter_map(|index| {
                let candidate =
                    place(object, right()).fitting_candidate(&mut AttemptStream::new(41, index))?;
                let features = bulk.inputs(
                    right(),
                    candidate.opposition,
                    candidate.object_from_wrist,
                    Barriers::NONE,
                );
                let holds = holds_freely(object, &candidate.proposal(), &mut attempt);
                Some((TRAINED.log_odds(&features), holds))
            })
            .collect();
        rated.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let held = |rated: &[(f32, bool)]| rated.iter().filter(|(_, holds)| *holds).count();
        let (better, worse) = rated.split_at(rated.len() / 2);
        assert!(
            held(better) >= 2 * held(worse) && held(better) >= 20,
            "{name}: of {} {} hold of the half rated better, {} of the other",
            rated.len(),
            held(better),
            held(worse)
        );
    }
}

#[test]
fn preferred_hands_hold_more_often_than_evenly_drawn_ones() {
    let remote = object("remote");
    let count = |draw: &dyn Fn(&ProposalContext<'_>, &mut AttemptStream) -> Option<Proposal>| {
        let mut attempt = PhysicalAttempt::default();
        (0..1500)
            .filter(|&index| {
                let proposal = draw(&place(remote, right()), &mut AttemptStream::new(43, index));
                proposal.is_some_and(|proposal| holds_freely(remote, &proposal, &mut attempt))
            })
            .count()
    };
    let (preferred, even) = (
        count(&|place, stream| propose(place, stream, Stop::NEVER)),
        count(&|place, stream| propose_evenly(place, stream, Stop::NEVER)),
    );
    assert!(2 * preferred > 3 * even, "{preferred} and {even} of 1500 hold");
    assert!(even > 50, "only {even} of 1500 hold");
}

#[test]
fn the_network_matches_its_formula_in_double_precision() {
    let mut stream = AttemptStream::new(47, 0);
    for _ in 0..100 {
        let features: [f32; INPUTS] =
            std::array::from_fn(|i| TRAINED.means[i] + stream.between(-6.0, 6.0) / TRAINED.scales[i]);
        let mut answer = f64::from(TRAINED.output_bias);
        for unit in 0..UNITS {
            let mut sum = f64::from(TRAINED.biases[unit]);
            for (i, feature) in features.iter().enumerate() {
                let scaled =
                    (f64::from(*feature) - f64::from(TRAINED.means[i])) * f64::from(TRAINED.scales[i]);
                let scaled = scaled.clamp(-f64::from(MAX_DEVIATION), f64::from(MAX_DEVIATION));
                sum += scaled * f64::from(TRAINED.weights[i][unit]);
            }
            answer += sum.max(0.0) * f64::from(TRAINED.outputs[unit]);
        }
        let off = (f64::from(TRAINED.log_odds(&features)) - answer).abs();
        assert!(off < 1e-4, "{off} off {answer}");
    }
}

/// A wedge that differs from its mirror image.
fn wedge(mirrored: bool) -> GraspObject {
    let corners = [
        [0.0, 0.0, 0.0],
        [0.03, 0.0, 0.0],
        [0.0, 0.12, 0.0],
        [0.01, 0.02, 0.05],
    ];
    let flip = if mirrored { -1.0 } else { 1.0 };
    let positions = corners.map(|[x, y, z]| Vec3::new(flip * x, y, z));
    let mut triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    if mirrored {
        for corners in &mut triangles {
            corners.swap(1, 2);
        }
    }
    let mesh = TriangleMesh::new(positions.to_vec(), triangles.to_vec()).expect("it is a mesh");
    let centre = Vec3::new(flip * 0.008, 0.03, 0.01);
    GraspObject::new(mesh, 0.1, centre, None, &[]).expect("it is sound")
}

#[test]
fn mirrored_hands_get_equal_features() {
    let (right, left) = (right(), right().mirrored());
    let oppositions = Oppositions::of(right);
    let [bulk, mirrored_bulk] = [false, true].map(|mirrored| ObjectFeatures::of(&wedge(mirrored)));
    let flip = |v: Vec3| v * Vec3::new(-1.0, 1.0, 1.0);
    let [giver, mirrored_giver] = [right, &left].map(|rig| {
        let pose = hand_pose(Pose::from_position(Vec3::new(0.0, -0.1, 0.03)), rig.stretched());
        PreparedHand::new(&TrackedSolids::of_joints(&HandJoints::of_pose(rig, &pose)))
    });
    for index in 0..50 {
        let mut stream = AttemptStream::new(53, index);
        let opposition = oppositions.draw([0.0, 0.2], &mut stream).expect("there are some");
        let mirrored = Opposition {
            thumb: flip(opposition.thumb),
            fingers: flip(opposition.fingers),
            ..*opposition
        };
        let turn = stream.rotation();
        let place = Pose::new(0.1 * stream.in_cube(), turn);
        let mirrored_place = Pose::new(
            flip(place.position),
            Quat::from_xyzw(turn.x, -turn.y, -turn.z, turn.w),
        );
        let features = bulk.inputs(right, opposition, place, Barriers::of_giver(&giver));
        let mirrored_features = mirrored_bulk.inputs(
            &left,
            &mirrored,
            mirrored_place,
            Barriers::of_giver(&mirrored_giver),
        );
        for (i, (feature, mirrored)) in features.iter().zip(mirrored_features).enumerate() {
            // The box around a mirrored mesh is a mirrored box only up to rounding.
            assert!((feature - mirrored).abs() < 5e-3, "{i}: {feature} and {mirrored}");
        }
    }
}

#[test]
fn pads_of_candidates_lie_on_the_line_through_their_points() {
    let remote = object("remote");
    let mut found = 0;
    for index in 0..1000 {
        let Some(Candidate {
            opposition,
            pair,
            object_from_wrist,
        }) = place(remote, right()).fitting_candidate(&mut AttemptStream::new(59, index))
        else {
            continue;
        };
        found += 1;
        let [thumb, fingers] =
            [opposition.thumb, opposition.fingers].map(|pad| object_from_wrist.transform_point(pad));
        let middle = (pair.start + pair.end) * 0.5;
        let across = (pair.end - pair.start).normalize_or_zero();
        assert!(((thumb + fingers) * 0.5).distance(middle) < 1e-5);
        assert!((fingers - thumb).normalize_or_zero().dot(across) > 0.9999);
        let room = opposition.width() - pair.thickness;
        assert!((-0.0061..=0.0121).contains(&room), "{room}");
    }
    assert!(found > 50, "only {found}");
}
