//! `GraspService.TrackHoldout`, `OpenTrack` and `PushFrame`.

use std::{
    pin::Pin,
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, open_track_response, track_holdout_request};
use tokio::{sync::OwnedSemaphorePermit, task::JoinHandle};
use tokio_stream::{Stream, StreamExt as _};
use tonic::{Code, Status, Streaming};

use super::{GraspHandler, Shared};
use crate::{
    answer::wire_duration,
    call::CallContext,
    convention::Convention,
    error::{Limit, ServiceError, Violation},
    limits::LARGEST_FIND_REQUEST,
    track::{Holding, Inbox, Lately, Latest, Motion, OpenTrack, PredictionError, Put},
    validate::{Frame, TrackPolicy, TrackSetup, WrongFrame, track_setup},
};

/// The answers of a track.
pub(super) type TrackAnswers<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

/// A track from its setup to its end. All of it ends when it is dropped: the reader of its frames, and a search that runs.
struct Track {
    handler: GraspHandler,
    inbox: Arc<Inbox>,
    policy: TrackPolicy,
    object_id: String,
    convention: Convention,
    hand_scale: Option<f32>,
    holding: Holding,
    lately: Lately,
    motion: Option<Motion>,
    /// Number of answers so far.
    answered: u64,
    /// Time of the latest frame that had one.
    captured: Option<Duration>,
    opened: Instant,
    call: CallContext,
    /// Keeps the object from being evicted between frames.
    held: Arc<()>,
    _permit: OwnedSemaphorePermit,
}

/// Ends the task that reads frames with the track that they are for.
struct Reader(JoinHandle<()>);

impl Drop for Reader {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl GraspHandler {
    /// Answers the frames of a stream.
    pub(super) async fn track(
        &self,
        mut frames: Streaming<v1::TrackHoldoutRequest>,
        call: &CallContext,
    ) -> Result<TrackAnswers<v1::TrackHoldoutResponse>, ServiceError> {
        let first = tokio::time::timeout(self.shared.track_idle, frames.message());
        let first = first
            .await
            .map_err(|_| self.idle())?
            .map_err(|status| broken(&status))?;
        let setup = match first.and_then(|request| request.message) {
            Some(track_holdout_request::Message::Setup(setup)) => Some(setup),
            Some(track_holdout_request::Message::Frame(_)) | None => None,
        };
        let track = self.start(setup, false, call).await?;
        let (inbox, shared) = (Arc::clone(&track.inbox), Arc::clone(&self.shared));
        let reader = Reader(tokio::spawn(async move {
            let end = read(frames, &inbox, &shared).await;
            inbox.end(end);
        }));
        Ok(answers(track, reader, |answer| v1::TrackHoldoutResponse {
            answer: Some(answer),
        }))
    }

    /// Opens a track, and answers the frames that are pushed.
    pub(super) async fn open(
        &self,
        request: v1::OpenTrackRequest,
        call: &CallContext,
    ) -> Result<TrackAnswers<v1::OpenTrackResponse>, ServiceError> {
        let track = self.start(request.setup, true, call).await?;
        let open: OpenTrack = self.shared.tracks.open(Arc::clone(&track.inbox));
        let message = |message| v1::OpenTrackResponse {
            message: Some(message),
        };
        let name = message(open_track_response::Message::Track(open.name()));
        let answers = answers(track, open, move |answer| {
            message(open_track_response::Message::Answer(answer))
        });
        Ok(Box::pin(tokio_stream::once(Ok(name)).chain(answers)))
    }

    /// Hands a frame to an open track.
    pub(super) fn push(&self, request: v1::PushFrameRequest) -> Result<v1::PushFrameResponse, ServiceError> {
        let inbox = self.shared.tracks.get(&request.track)?;
        let put = put(&inbox, request.frame, Instant::now(), &self.shared)?;
        Ok(v1::PushFrameResponse {
            overtaken: put == Put::Overtaken,
        })
    }

    /// Starts a track.
    async fn start(
        &self,
        setup: Option<v1::TrackSetup>,
        may_overtake: bool,
        call: &CallContext,
    ) -> Result<Track, ServiceError> {
        let shared = &self.shared;
        let rigs = (shared.default_rig.as_str(), &*shared.rigs);
        let TrackSetup {
            intake,
            policy,
            object_id,
            convention,
            hand_scale,
            standing,
        } = track_setup(setup, may_overtake, rigs, |id| shared.objects.contains(id))?;
        call.log_object(&object_id);
        let permit = shared.tracks.admit()?;
        let object = shared.object(&object_id, call).await?.object;
        // What searches need is derived before the first frame.
        shared.derived(&object, call).await?;
        Ok(Track {
            handler: self.clone(),
            inbox: Arc::new(Inbox::new(intake)),
            policy,
            object_id,
            convention,
            hand_scale,
            holding: Holding::of(standing),
            lately: Lately::default(),
            motion: policy.predict_ahead.map(Motion::new),
            answered: 0,
            captured: None,
            opened: Instant::now(),
            call: call.clone(),
            held: object.hold(),
            _permit: permit,
        })
    }

    fn idle(&self) -> ServiceError {
        ServiceError::TrackIdle {
            limit: self.shared.track_idle,
        }
    }
}

/// Puts the frames of a stream into an inbox until they end. Wrong ones are answered.
async fn read(
    mut frames: Streaming<v1::TrackHoldoutRequest>,
    inbox: &Inbox,
    shared: &Shared,
) -> Result<(), ServiceError> {
    while let Some(request) = frames.message().await.map_err(|status| broken(&status))? {
        match request.message {
            Some(track_holdout_request::Message::Frame(frame)) => {
                let (sequence, arrived) = (frame.sequence, Instant::now());
                match put(inbox, Some(frame), arrived, shared) {
                    Ok(_) => {}
                    Err(ServiceError::Invalid(violations)) => inbox.put_wrong(WrongFrame {
                        sequence,
                        arrived,
                        warnings: sentences(violations),
                    }),
                    Err(error) => return Err(error),
                }
            }
            Some(track_holdout_request::Message::Setup(_)) => {
                return Err(ServiceError::invalid(
                    "setup",
                    "comes again; it must be the first message only",
                ));
            }
            None => {
                return Err(ServiceError::invalid(
                    "frame",
                    "is missing; each message after the first must be one",
                ));
            }
        }
    }
    Ok(())
}

fn put(
    inbox: &Inbox,
    frame: Option<v1::TrackFrame>,
    arrived: Instant,
    shared: &Shared,
) -> Result<Put, ServiceError> {
    inbox.put(frame, |intake, frame| {
        let rigs = (shared.default_rig.as_str(), &*shared.rigs);
        intake.check(frame, arrived, rigs, |id| shared.objects.contains(id))
    })
}

/// What is wrong with a frame, in words.
fn sentences(violations: Vec<Violation>) -> Vec<String> {
    let sentence = |Violation {
                        field, description, ..
                    }| format!("{field} {description}").trim_start().to_owned();
    violations.into_iter().map(sentence).collect()
}

/// What is no message of the contract, or too long for one.
fn broken(status: &Status) -> ServiceError {
    match status.code() {
        Code::OutOfRange => ServiceError::MessageTooLarge {
            limit: LARGEST_FIND_REQUEST,
        },
        _ => ServiceError::Malformed(status.message().to_owned()),
    }
}

/// The answers of a track, each computed when the transport has room for it. `kept` lives as long as they do. The track is boxed:
/// it moves into and out of the future of every answer.
fn answers<T: 'static>(
    track: Track,
    kept: impl Send + 'static,
    message: impl Fn(v1::TrackAnswer) -> T + Send + 'static,
) -> TrackAnswers<T> {
    Box::pin(futures_util::stream::unfold(
        Some((Box::new(track), kept, message)),
        |state| async {
            let (mut track, kept, message) = state?;
            match track.next().await {
                Ok(Some(answer)) => {
                    let answer = message(answer);
                    Some((Ok(answer), Some((track, kept, message))))
                }
                Ok(None) => None,
                Err(error) => Some((Err(error.into()), None)),
            }
        },
    ))
}

impl Track {
    /// The answer to the latest frame, once there is one; none at the end of the frames.
    async fn next(&mut self) -> Result<Option<v1::TrackAnswer>, ServiceError> {
        let shutdown = self.handler.shared.shutdown.clone();
        let idle = self.handler.shared.track_idle;
        let (inbox, due) = (Arc::clone(&self.inbox), self.call.answer_due());
        let over = async {
            match due {
                Some(due) => tokio::time::sleep_until(due.into()).await,
                None => std::future::pending().await,
            }
        };
        let taken = tokio::select! {
            biased;
            () = shutdown.cancelled() => Err(ServiceError::ShuttingDown),
            () = over => Err(ServiceError::DeadlineExceeded),
            latest = inbox.latest(self.answered, idle) => latest,
        };
        let answer = match taken? {
            Some((Latest::Frame(frame), skipped)) => self.answer(*frame, skipped).await?,
            Some((Latest::Wrong(frame), skipped)) => wrong(frame, skipped),
            None => return Ok(None),
        };
        self.answered += 1;
        Ok(Some(answer))
    }

    async fn answer(&mut self, mut frame: Frame, skipped: u32) -> Result<v1::TrackAnswer, ServiceError> {
        if frame.query.object_id != self.object_id {
            self.change_object(&frame);
        }
        self.captured = frame.captured.or(self.captured);
        // If frames have no times, they were captured when they came.
        let at = self.captured.unwrap_or(frame.arrived - self.opened);
        if let (Some(motion), Some(captured)) = (&mut self.motion, frame.captured) {
            motion.predict(frame.sequence, captured, &mut frame.query);
        }
        self.lately.add(at, &mut frame.query);
        let mut answer = v1::TrackAnswer {
            sequence: frame.sequence,
            skipped_frames: skipped,
            last_prediction: self
                .motion
                .as_ref()
                .and_then(Motion::last_error)
                .map(|error| wire_error(error, self.convention)),
            warnings: std::mem::take(&mut frame.warnings),
            ..Default::default()
        };
        let arrived = frame.arrived;
        let is_aborted = self.holding.is_aborted(frame.is_committed);
        let found = match self.find(frame, at).await {
            // A hand that is well-formed but no surface.
            Err(ServiceError::Invalid(violations)) => {
                answer.warnings.extend(sentences(violations));
                answer.standing = Some(none(v1::NoGraspReason::WrongFrame));
                answer.server_time = Some(wire_duration(arrived.elapsed()));
                return Ok(answer);
            }
            found => found?,
        };
        let mut report = found.standing.clone().unwrap_or_else(|| first_report(&found));
        let mut grasp = found.grasp;
        if is_aborted {
            report = self.holding.still_aborted(report);
            grasp = None;
        }
        let is_known = self.holding.learn(&report, grasp.as_ref(), self.hand_scale, at);
        answer.client_from_wrist = grasp.as_ref().and_then(|grasp| grasp.client_from_wrist);
        answer.score = grasp.as_ref().and_then(|grasp| Some(grasp.score.as_ref()?.total));
        answer.grasp = grasp.filter(|_| !(self.policy.sends_changes && is_known));
        answer
            .warnings
            .extend(found.report.into_iter().flat_map(|report| report.warnings));
        answer.standing = Some(report);
        answer.server_time = Some(wire_duration(arrived.elapsed()));
        Ok(answer)
    }

    /// Begins anew with another object.
    fn change_object(&mut self, frame: &Frame) {
        self.object_id.clone_from(&frame.query.object_id);
        self.holding = Holding::default();
        self.lately = Lately::default();
        self.motion = self.policy.predict_ahead.map(Motion::new);
    }

    /// Finds the grasp for a frame, as a call with a standing grasp does.
    async fn find(&mut self, mut frame: Frame, at: Duration) -> Result<v1::FindGraspResponse, ServiceError> {
        let shared = &self.handler.shared;
        self.holding
            .hold(&mut frame, at, &self.policy, self.convention, &shared.rigs)?;
        let call = self.call.of_part(frame.arrived);
        let object = shared.object(&self.object_id, &call).await?.object;
        self.held = object.hold();
        // Boxed for the same reason: a search's future takes kilobytes.
        match Box::pin(self.handler.answer(frame.query, &call)).await {
            Err(ServiceError::Overloaded {
                limit: Limit::Searches,
                ..
            }) => Ok(v1::FindGraspResponse {
                standing: Some(none(v1::NoGraspReason::NotFoundInTime)),
                ..Default::default()
            }),
            found => found.map_err(|error| error.within("frame")),
        }
    }
}

/// The answer to a wrong frame.
fn wrong(frame: WrongFrame, skipped: u32) -> v1::TrackAnswer {
    v1::TrackAnswer {
        sequence: frame.sequence,
        standing: Some(none(v1::NoGraspReason::WrongFrame)),
        skipped_frames: skipped,
        server_time: Some(wire_duration(frame.arrived.elapsed())),
        warnings: frame.warnings,
        ..Default::default()
    }
}

/// The report on an answer before which nothing stood.
fn first_report(found: &v1::FindGraspResponse) -> v1::StandingReport {
    if found.grasp.is_some() {
        return v1::StandingReport {
            status: v1::StandingStatus::Replanned.into(),
            ..Default::default()
        };
    }
    let limits = found.report.iter().flat_map(|report| &report.limits);
    let mut reasons = limits.map(|limit| match limit.kind() {
        v1::LimitKind::Giver | v1::LimitKind::Obstacle => v1::NoGraspReason::GiverInTheWay,
        v1::LimitKind::Reach => v1::NoGraspReason::OutOfReach,
        _ => v1::NoGraspReason::CannotBeHeld,
    });
    none(reasons.next().unwrap_or(v1::NoGraspReason::NotFoundInTime))
}

fn none(reason: v1::NoGraspReason) -> v1::StandingReport {
    v1::StandingReport {
        status: v1::StandingStatus::None.into(),
        no_grasp: reason.into(),
        ..Default::default()
    }
}

fn wire_error(error: PredictionError, convention: Convention) -> v1::PredictionError {
    let length = |metres| convention.length_from_openxr(metres);
    v1::PredictionError {
        sequence: error.sequence,
        object_distance: length(error.object_distance),
        object_angle: error.object_angle,
        giver_distance: error.giver_distance.map(length),
    }
}
