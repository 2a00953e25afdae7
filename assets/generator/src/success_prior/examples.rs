//! Hands that were closed on a shape, and whether they held.

use std::sync::Arc;

use glam::Vec3;
use grasp_synthesis::{
    base::{random::AttemptStream, stop::Stop, stopwatch::Stopwatch},
    model::{
        hand::{HandPose, joints::HandJoints, rig::Rig},
        requirements::Requirements,
        strategy::Validity,
    },
    physical::{
        grip::Gripper,
        receiver::Receiver,
        scene::{ObjectScene, Presented},
        solids::{PreparedHand, TrackedSolids},
    },
    propose::{
        prepared::{PreparedObject, PreparedRig},
        proposal::ProposalContext,
        success_prior::{INPUTS, ObjectFeatures},
    },
    rating::assessment::GraspContext,
    search::physical_attempt::PhysicalAttempt,
};

use super::shapes;

/// Hands drawn per shape; those without room give no example.
const DRAWN: u64 = 6000;

/// Largest number of examples per shape.
const MAX_EXAMPLES: usize = 1500;

/// Hands drawn for the same gravity and giver.
const ROUND: u64 = 64;

/// Grips needed before some are used as givers.
const ENOUGH_FOR_GIVERS: usize = 20;

/// Seeds of the hands, and of gravity and givers: any will do.
const SEEDS: [u64; 2] = [0x4558_414d, 0x5052_4553];

/// A hand that was closed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Example {
    /// The network's input.
    pub(super) features: [f32; INPUTS],
    /// Did it hold?
    pub(super) holds: bool,
}

/// Examples of a shape, drawn without the prior; every other round has a giver, whose hand is a grip found before.
pub(super) fn of_shape(number: u64, rig: &PreparedRig) -> Vec<Example> {
    let object = PreparedObject::new(Arc::new(shapes::draw(number)));
    let scene = ObjectScene::new(&object, object.friction_under(Validity::Physical));
    let bulk = ObjectFeatures::of(&object);
    let requirements = Requirements::default();
    // Closed like the hands of atlases.
    let mut attempt = PhysicalAttempt {
        gripper: Gripper::default(),
    };
    let mut holding: Vec<HandPose> = Vec::new();
    let mut examples = Vec::with_capacity(MAX_EXAMPLES);
    let [hands, presenting] = SEEDS.map(|seed| seed.wrapping_add(number << 32));
    for round in 0..DRAWN / ROUND {
        let presented = present(
            &holding,
            rig,
            &mut AttemptStream::new(presenting, round),
            round % 2 == 1,
        );
        let place = ProposalContext {
            object: &object,
            surface: object.surface_pairs(),
            barriers: presented.barriers(),
            chooses: None,
            rig,
            placements: None,
        };
        let around = GraspContext {
            object: scene,
            presented: &presented,
            rig,
            requirements: &requirements,
        };
        for index in round * ROUND..(round + 1) * ROUND {
            if examples.len() >= MAX_EXAMPLES {
                return examples;
            }
            let Some(candidate) = place.fitting_candidate(&mut AttemptStream::new(hands, index)) else {
                continue;
            };
            let held = attempt.hold(&around, &candidate.proposal(), &mut Stopwatch::off(), Stop::NEVER);
            examples.push(Example {
                features: bulk.inputs(
                    rig,
                    candidate.opposition,
                    candidate.object_from_wrist,
                    place.barriers,
                ),
                holds: held.is_ok(),
            });
            if let Ok(grasp) = held {
                holding.push(grasp.pose);
            }
        }
    }
    examples
}

fn present(holding: &[HandPose], rig: &Rig, stream: &mut AttemptStream, by_giver: bool) -> Presented {
    let up = stream.rotation() * Vec3::Y;
    let giver = (by_giver && holding.len() >= ENOUGH_FOR_GIVERS).then(|| {
        let pose = &holding[stream.below(holding.len())];
        PreparedHand::new(&TrackedSolids::of_joints(&HandJoints::of_pose(rig, pose)))
    });
    Presented {
        giver,
        other_hands: Vec::new(),
        meshes: Vec::new(),
        obstacles: Vec::new(),
        giver_palm: None,
        receiver: Receiver::ANYWHERE,
        up,
    }
}
