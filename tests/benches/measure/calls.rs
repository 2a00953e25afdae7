//! Calls over real gRPC, and what is measured of their answers.

use std::time::{Duration, Instant};

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use prost::Message as _;
use tonic::{Status, transport::Channel};

use crate::table::Spread;

/// Time within which a request counts as answered: two or three frames, hidden by the start of a handover.
pub(crate) const ANSWERED_WITHIN: Duration = Duration::from_millis(50);

/// The measurements of one answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Answer {
    /// Whether a grasp was found.
    pub(crate) found: bool,
    /// Whether it came from the atlas.
    pub(crate) from_atlas: bool,
    /// Whether it came from the grips that earlier requests' searches found.
    pub(crate) from_learned: bool,
    /// Duration of the search as the server reports it: without reading the request, planning key frames and writing
    /// the answer.
    pub(crate) search_time: Duration,
    /// Duration of the call in the client, encoding and decoding included.
    pub(crate) round_trip: Duration,
    /// Size of the request message in bytes.
    pub(crate) sent_bytes: usize,
    /// Size of the answer message in bytes.
    pub(crate) received_bytes: usize,
}

impl Answer {
    /// Whether a grasp was found within 50 ms.
    pub(crate) fn is_in_time(&self) -> bool {
        self.found && self.search_time <= ANSWERED_WITHIN
    }
}

/// Sends one request; an error if the server refuses it.
pub(crate) async fn try_send(
    client: &mut GraspServiceClient<Channel>,
    request: v1::FindGraspRequest,
) -> Result<Answer, Status> {
    let sent_bytes = request.encoded_len();
    let start = Instant::now();
    let answer = client.find_grasp(request).await?;
    let round_trip = start.elapsed();
    let answer = answer.into_inner();
    Ok(Answer {
        found: answer.outcome() == v1::Outcome::Found,
        from_atlas: answer.source() == v1::GraspSource::Atlas,
        from_learned: answer.source() == v1::GraspSource::Learned,
        search_time: answer.search_time(),
        round_trip,
        sent_bytes,
        received_bytes: answer.encoded_len(),
    })
}

/// Sends one request that the server accepts.
pub(crate) async fn send(client: &mut GraspServiceClient<Channel>, request: v1::FindGraspRequest) -> Answer {
    try_send(client, request).await.expect("the request is valid")
}

/// The same request with a budget of [`ANSWERED_WITHIN`].
pub(crate) fn within_50_ms(request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    request.with_budget(ANSWERED_WITHIN)
}

/// The same request, to be answered without an atlas.
pub(crate) fn without_atlas(mut request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    request.search_mut().ignore_atlas = true;
    request
}

/// Spread of the search times.
pub(crate) fn search_times(answers: &[Answer]) -> Spread {
    Spread::of_times(answers.iter().map(|answer| answer.search_time))
}

/// Spread of the round trips.
pub(crate) fn round_trips(answers: &[Answer]) -> Spread {
    Spread::of_times(answers.iter().map(|answer| answer.round_trip))
}

/// Share of the answers for which a predicate holds.
pub(crate) fn share(answers: &[Answer], is: impl Fn(&Answer) -> bool) -> f64 {
    answers.iter().filter(|answer| is(answer)).count() as f64 / answers.len().max(1) as f64
}

/// Asserts that grasps were measured.
///
/// # Panics
/// No answer has a grasp.
pub(crate) fn assert_some_found(answers: &[Answer]) {
    assert!(
        answers.iter().any(|answer| answer.found),
        "none of {} answers has a grasp",
        answers.len()
    );
}
