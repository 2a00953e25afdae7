//! Why an object has no grips, or was not taken from test givers.

use std::time::Duration;

use grasp_client::{
    GraspClient, Outcome,
    v1::{self, AtlasGrowth, receiver::Body},
};

use crate::{
    Failure,
    format::{joined, list, name_of, rejections_at_a_glance},
};

/// Time limit of the search that shows what is in the way.
const BUDGET: Duration = Duration::from_secs(1);

/// What keeps hands from an object that nobody holds; `None` if a search finds a grasp of it.
pub(super) async fn in_the_way(client: &GraspClient, object: &str) -> Result<Option<String>, Failure> {
    let mut request = v1::FindGraspRequest::new(object).with_budget(BUDGET).with_seed(1);
    request.receiver_mut().body = Some(Body::Anywhere(true));
    let answer = client.find_grasp(&request).await?;
    Ok((answer.outcome() != Outcome::Found).then(|| of_report(&answer.report.unwrap_or_default())))
}

/// What a search without a grasp says.
pub(super) fn of_report(report: &v1::SearchReport) -> String {
    if report.limits.is_empty() {
        let rejections = rejections_at_a_glance(report);
        return format!("none of {} hands tried holds it ({rejections})", report.attempts);
    }
    let limits = report.limits.iter().map(|limit| &limit.description);
    format!("limited by {}", joined("; ", limits))
}

/// Why atlases of the right and the left hand do not grow any more, as far as the server says.
pub(super) fn of_growth(atlases: &[v1::Atlas; 2]) -> Option<String> {
    let both = ["right", "left"].into_iter().zip(atlases);
    let reasons = list(both.filter_map(|(side, atlas)| {
        let why = match atlas.growth() {
            AtlasGrowth::Unspecified | AtlasGrowth::Complete | AtlasGrowth::Growing => return None,
            AtlasGrowth::NothingFound => "of thousands of hands tried, none holds it".to_owned(),
            AtlasGrowth::NoMemory => "the server has no memory for it (cache_bytes)".to_owned(),
            AtlasGrowth::Failed => "the server failed to grow it; its log says how".to_owned(),
            other => name_of(other),
        };
        Some(format!("{side} hand: {why}"))
    }));
    (!reasons.is_empty()).then_some(reasons)
}
