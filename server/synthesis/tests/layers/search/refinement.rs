//! Near misses are perturbed until they hold.

use crate::prelude::*;

const PROPOSALS: u64 = 1500;

#[test]
fn refinement_keeps_what_holds_and_perturbs_near_misses_until_more_hold() {
    let scissors = object("scissors");
    let around = surroundings(scissors, &NO_GIVER, right());
    let place = place(scissors, right());
    let free = floating(Arc::clone(scissors));
    let (mut plain, mut refining) = (PhysicalAttempt::default(), PhysicalAttempt::default());
    let (mut held, mut refined) = (0, 0);
    for index in 0..PROPOSALS {
        let mut stream = AttemptStream::new(17, index);
        let Some(proposal) = propose(&place, &mut stream, Stop::NEVER) else {
            continue;
        };
        let first = plain.hold(&around, &proposal, &mut Stopwatch::off(), Stop::NEVER);
        let end = refining.hold_or_refine(
            &around,
            &proposal,
            &mut stream,
            &mut Stopwatch::off(),
            Stop::NEVER,
        );
        held += usize::from(first.is_ok());
        match (first, end) {
            (Err(_), Ok(grasp)) => {
                refined += 1;
                assert!(guided(&free).judge(&grasp.pose).is_valid(), "{index}");
                // It is not the proposed hand.
                assert_ne!(grasp.pose.digits.as_slice(), plain.gripper.posed.as_slice());
            }
            // Whatever was tried, a failed hand is reported as without refinement.
            (first, end) => {
                assert_eq!(first, end, "{index}");
                assert_eq!(plain.gripper.posed, refining.gripper.posed, "{index}");
            }
        }
    }
    assert!(held >= 10, "only {held} hold");
    assert!(3 * refined > held, "{held} {refined}");
}
