//! Requests over real gRPC, one at a time, and what became of them.

use std::time::{Duration, Instant};

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use prost::Message as _;
use tonic::transport::Channel;

use crate::table::Spread;

/// How soon an answer must be there to count as answered: two or three frames, which the start of a handover hides.
pub(crate) const ANSWERED_WITHIN: Duration = Duration::from_millis(50);

/// An answer, in figures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Answer {
    /// Was a grasp found?
    pub(crate) found: bool,
    /// Was it one of the atlas?
    pub(crate) from_atlas: bool,
    /// Was it what an earlier request's search had found?
    pub(crate) from_recent: bool,
    /// Valid grasps that were ranked.
    pub(crate) candidates: u64,
    /// What the server says that the search took; reading the request, planning key frames and wording the answer come
    /// on top.
    pub(crate) search_time: Duration,
    /// The budget that was in force.
    pub(crate) budget: Duration,
    /// From before the call to its answer in the client, encoding and decoding included.
    pub(crate) round_trip: Duration,
    /// Bytes of the request's message.
    pub(crate) sent_bytes: usize,
    /// Bytes of the answer's message.
    pub(crate) received_bytes: usize,
}

impl Answer {
    /// Was a grasp found in 50 ms?
    pub(crate) fn is_in_time(&self) -> bool {
        self.found && self.search_time <= ANSWERED_WITHIN
    }
}

/// Asks once.
pub(crate) async fn ask(client: &mut GraspServiceClient<Channel>, request: v1::FindGraspRequest) -> Answer {
    let sent_bytes = request.encoded_len();
    let start = Instant::now();
    let answer = client.find_grasp(request).await.expect("the request is valid");
    let round_trip = start.elapsed();
    let answer = answer.into_inner();
    let report = answer.report.as_ref().expect("every answer has a report");
    let time = |time: &Option<prost_types::Duration>| {
        let time = time.as_ref().expect("every report has its times");
        Duration::try_from(*time).expect("times are positive")
    };
    Answer {
        found: answer.outcome() == v1::Outcome::Found,
        from_atlas: report.source() == v1::GraspSource::Atlas,
        from_recent: report.source() == v1::GraspSource::Recent,
        candidates: report.candidates,
        search_time: time(&report.search_time),
        budget: time(&report.budget),
        round_trip,
        sent_bytes,
        received_bytes: answer.encoded_len(),
    }
}

/// The same request with a budget of [`ANSWERED_WITHIN`].
pub(crate) fn within_50_ms(request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        budget: wire_duration(ANSWERED_WITHIN),
        ..request
    }
}

/// A duration as a message.
pub(crate) fn wire_duration(duration: Duration) -> Option<prost_types::Duration> {
    prost_types::Duration::try_from(duration).ok()
}

/// The spread of the search times.
pub(crate) fn search_times(answers: &[Answer]) -> Spread {
    Spread::of_times(answers.iter().map(|answer| answer.search_time))
}

/// The spread of the round trips.
pub(crate) fn round_trips(answers: &[Answer]) -> Spread {
    Spread::of_times(answers.iter().map(|answer| answer.round_trip))
}

/// The share of answers of which something is true.
pub(crate) fn share(answers: &[Answer], is: impl Fn(&Answer) -> bool) -> f64 {
    answers.iter().filter(|answer| is(answer)).count() as f64 / answers.len() as f64
}

/// Makes sure that what was measured are grasps.
///
/// # Panics
/// None of the answers has one.
pub(crate) fn assert_some_found(answers: &[Answer]) {
    assert!(
        answers.iter().any(|answer| answer.found),
        "none of {} answers has a grasp",
        answers.len()
    );
}
