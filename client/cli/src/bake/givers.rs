//! Test givers: hands that hold an object, from which it is taken.

use std::time::Duration;

use grasp_client::{
    GraspChoice, GraspClient, Handedness, Outcome,
    v1::{self, receiver::Body},
};

use super::{reasons, results::Givers};
use crate::Failure;

/// Time limit of the search for a giver's hold.
const HOLD_BUDGET: Duration = Duration::from_secs(1);

/// Takes an object from so many givers, half of them left-handed, with the better hand. Givers hold it as a search without the
/// object's atlas finds, by a seed each: always the same, and not as the atlas has it.
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
        let handedness = [Handedness::Right, Handedness::Left][usize::from(seed % 2)];
        let mut hold = v1::FindGraspRequest::new(object)
            .receiving(handedness)
            .with_seed(seed.into())
            .with_budget(HOLD_BUDGET);
        hold.receiver_mut().body = Some(Body::Anywhere(true));
        hold.search_mut().ignore_atlas = true;
        hold.search_mut().set_choice(GraspChoice::Reproducible);
        let Some(giver) = client.find_grasp(&hold).await?.hand().cloned() else {
            continue;
        };
        result.tried += 1;
        let take = v1::FindGraspRequest::new(object)
            .with_presenting_hand(giver)
            .with_seed(seed.into())
            .with_budget(budget);
        let answer = client.find_grasp(&take).await?;
        if answer.outcome() == Outcome::Found {
            result.answered += 1;
        } else {
            result.last_failure = Some(reasons::of_report(&answer.report.unwrap_or_default()));
        }
    }
    Ok(result)
}
