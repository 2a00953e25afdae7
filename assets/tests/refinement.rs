//! Hands beside those that nearly hold.

use std::sync::Arc;

use glam::Vec3;
use grasp_assets::{hands::hand, objects::object};
use grasp_synthesis::{
    base::{random::AttemptStream, stopwatch::NoStopwatch},
    base::mechanisms::Mechanisms,
    model::{constraints::Constraints, hand::Handedness, holdout::Holdout, strategy::Validity},
    physical::scene::{ObjectScene, Presented},
    propose::proposal::{Place, propose},
    rating::assessment::Surroundings,
    search::physical_attempt::PhysicalAttempt,
};

const PROPOSALS: u64 = 1500;

#[test]
fn what_holds_stays_and_more_holds_beside_near_misses() {
    let rig = &hand("adult", Handedness::Right).expect("it is built in").rig;
    let scissors = Arc::clone(&object("scissors").expect("they are built in").object);
    let holdout = Holdout::new(Arc::clone(&scissors), None, Vec3::Y).expect("nobody holds them");
    let around = Surroundings {
        object: ObjectScene::new(&scissors, scissors.friction_under(Validity::Physical)),
        presented: &Presented::of(&holdout),
        rig,
        constraints: &Constraints::default(),
    };
    let place = Place {
        object: &scissors,
        surface: &scissors.surface_pairs,
        giver: None,
        rig,
        repertoire: None,
        mechanisms: Mechanisms::ALL,
    };
    let (mut plain, mut refining) = (PhysicalAttempt::default(), PhysicalAttempt::default());
    let (mut held, mut refined) = (0, 0);
    for index in 0..PROPOSALS {
        let mut stream = AttemptStream::new(17, index);
        let Some(proposal) = propose(&place, &mut stream, &|| false) else {
            continue;
        };
        let first = plain.hold(&around, &proposal, &mut NoStopwatch, &|| false);
        let end = refining.hold_or_refine(&around, &proposal, &mut stream, &mut NoStopwatch, &|| false);
        held += usize::from(first.is_ok());
        match (first, end) {
            (Err(_), Ok(grasp)) => {
                refined += 1;
                let margins = grasp.margins.expect("it is physical");
                assert!(
                    margins.epsilon >= around.object.least_epsilon,
                    "{index}: {margins:?}"
                );
                assert!(margins.residual <= 0.02, "{index}: {margins:?}");
                // Not the hand that was proposed.
                assert_ne!(grasp.pose.digits.as_slice(), plain.gripper.posed.as_slice());
            }
            // Of a hand that fails the same is told, whatever was tried beside it.
            (first, end) => {
                assert_eq!(first, end, "{index}");
                assert_eq!(plain.gripper.posed, refining.gripper.posed, "{index}");
            }
        }
    }
    assert!(held >= 10, "only {held} hold");
    assert!(
        3 * refined > held,
        "{held} hold, and beside near misses only {refined}"
    );
}
