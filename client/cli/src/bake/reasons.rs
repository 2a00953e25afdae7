//! Why an object has no grips, or was not taken from test givers.

use std::time::Duration;

use grasp_client::{AtlasGrowth, FindRequest, GraspClient, Object, Outcome, ReceiverStance, SearchReport};

use crate::{
    failure::Failure,
    format::{name_of, rejections_at_a_glance},
};

/// Time limit of the search that shows what is in the way.
const BUDGET: Duration = Duration::from_secs(1);

/// What keeps hands from an object that nobody holds; none if a search finds a grasp of it.
///
/// # Errors
/// Those of the call.
pub(super) async fn in_the_way(client: &GraspClient, object: &str) -> Result<Option<String>, Failure> {
    let request = FindRequest {
        receiver_stance: Some(ReceiverStance::Any),
        budget: Some(BUDGET),
        seed: Some(1),
        ..FindRequest::new(object)
    };
    let answer = client.find_grasp(&request).await?;
    Ok((answer.outcome != Outcome::Found).then(|| of_report(&answer.report)))
}

/// What a search without a grasp says.
pub(super) fn of_report(report: &SearchReport) -> String {
    if report.limits.is_empty() {
        return format!(
            "none of {} hands tried holds it ({})",
            report.attempts,
            rejections_at_a_glance(report)
        );
    }
    let limits: Vec<&str> = report
        .limits
        .iter()
        .map(|limit| limit.description.as_str())
        .collect();
    format!("limited by {}", limits.join("; "))
}

/// Why atlases of an object do not grow any more, as far as the server says.
pub(super) fn of_growth(object: &Object) -> Option<String> {
    let both = [("right", &object.atlas), ("left", &object.left_atlas)];
    let reasons: Vec<String> = both
        .into_iter()
        .filter_map(|(side, atlas)| {
            let growth = atlas.as_ref()?.growth;
            let why = match growth {
                AtlasGrowth::Complete | AtlasGrowth::Growing => return None,
                AtlasGrowth::NothingFound => "of thousands of hands tried, none holds it".to_owned(),
                AtlasGrowth::NoMemory => "the server has no memory for it (cache_bytes)".to_owned(),
                AtlasGrowth::Failed => "the server failed to grow it; its log says how".to_owned(),
                other => name_of(&other),
            };
            Some(format!("{side} hand: {why}"))
        })
        .collect();
    (!reasons.is_empty()).then(|| reasons.join(", "))
}
