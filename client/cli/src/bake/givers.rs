//! Test givers: hands that hold an object, from which it is taken.

use std::time::Duration;

use grasp_client::{
    AtlasUse, FindRequest, Grasp, GraspClient, HandAngles, Handedness, Outcome, PresentingHand,
    ReceiverStance, ReceivingHand,
};

use super::{reasons, results::Givers};
use crate::failure::Failure;

/// Time limit of the search for a giver's hold.
const HOLD_BUDGET: Duration = Duration::from_secs(1);

/// Takes an object from so many givers, half of them left-handed, with the better hand. Givers hold it as a search without the
/// object's atlas finds, by a seed each: always the same, and not as the atlas has it.
///
/// # Errors
/// Those of the calls.
pub(super) async fn answered(
    client: &GraspClient,
    object: &str,
    givers: u16,
    budget: Duration,
) -> Result<Givers, Failure> {
    let mut result = Givers {
        requested: givers,
        ..Givers::default()
    };
    for seed in 0..givers {
        let handedness = if seed % 2 == 0 {
            Handedness::Right
        } else {
            Handedness::Left
        };
        let hold = FindRequest {
            receiving_hand: ReceivingHand {
                handedness: Some(handedness),
                ..ReceivingHand::default()
            },
            receiver_stance: Some(ReceiverStance::Any),
            atlas: Some(AtlasUse::None),
            seed: Some(seed.into()),
            budget: Some(HOLD_BUDGET),
            reproducible: true,
            ..FindRequest::new(object)
        };
        let Some(giver) = client.find_grasp(&hold).await?.grasp else {
            continue;
        };
        result.tried += 1;
        let take = FindRequest {
            presenting_hand: Some(presenting(&giver)),
            seed: Some(seed.into()),
            budget: Some(budget),
            ..FindRequest::new(object)
        };
        let answer = client.find_grasp(&take).await?;
        if answer.outcome == Outcome::Found {
            result.answered += 1;
        } else {
            result.last_failure = Some(reasons::of_report(&answer.report));
        }
    }
    Ok(result)
}

fn presenting(grasp: &Grasp) -> PresentingHand {
    PresentingHand::Angles(HandAngles {
        rig: grasp.rig.clone(),
        handedness: grasp.handedness,
        client_from_wrist: grasp.client_from_wrist,
        digits: grasp.digits,
        hand_scale: None,
    })
}
