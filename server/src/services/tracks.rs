//! `GraspService.TrackHoldout`, and tracks whose frames are pushed.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_proto::{
    v1::{self, track_holdout_request::Message},
    wire_duration,
};
use tokio::{sync::oneshot, task::JoinSet};
use tonic::{Code, Status, Streaming};

use super::{Handler, Shared, streaming::Messages};
use crate::{
    call::CallContext,
    convention::Convention,
    error::{Limit, ServiceError},
    executor::contained,
    faults::FaultPoint,
    limits::{MAX_FIND_REQUEST, Place},
    track::{HeldGrasp, Inbox, Motion, PendingFrame, PredictionError, RecentHands, Reply, not_found},
    validate::{Frame, Latest, TrackPolicy, TrackQuery, sentences, track_query},
};

/// A track from its start to its end. Dropping it stops a running search.
struct Track {
    handler: Handler,
    inbox: Arc<Inbox>,
    policy: TrackPolicy,
    object_id: String,
    convention: Convention,
    holding: HeldGrasp,
    recent: RecentHands,
    motion: Option<Motion>,
    answered: u64,
    /// Time of the latest frame with a time.
    captured: Option<Duration>,
    opened: Instant,
    /// When its stream has to end.
    due: Option<Instant>,
    /// Keeps the object from being evicted between frames.
    held: Arc<()>,
    _place: Place,
}

impl Handler {
    pub(super) async fn track(
        &self,
        mut frames: Streaming<v1::TrackHoldoutRequest>,
        call: &CallContext,
    ) -> Result<Messages<v1::TrackAnswer>, ServiceError> {
        let limit = self.config.streams.track_idle;
        let first = tokio::time::timeout(limit, frames.message()).await;
        let first = first.map_err(|_| ServiceError::TrackIdle { limit })?;
        let first = first.map_err(|status| broken(&status))?;
        let Some(Message::Track(track)) = first.and_then(|request| request.message) else {
            return Err(ServiceError::invalid(
                "track",
                "is missing; it must be the first message",
            ));
        };
        let track = self.start(track, false, call).await;
        let track = track.map_err(|error| error.within("track"))?;
        let (inbox, call, handler) = (Arc::clone(&track.inbox), call.clone(), self.clone());
        let mut reader = JoinSet::new();
        reader.spawn(async move {
            inbox.end(contained(read(frames, &inbox, &call, &handler)).await);
        });
        Ok(answers(track, reader))
    }

    pub(super) async fn open_track(
        &self,
        track: v1::Track,
        call: &CallContext,
    ) -> Result<v1::Track, ServiceError> {
        let started = self.start(track.clone(), true, call).await?;
        let inbox = Arc::clone(&started.inbox);
        let name = self
            .tracks
            .open(call.caller.owner(), inbox, started.answer_pushed());
        Ok(v1::Track { name, ..track })
    }

    pub(super) async fn push(
        &self,
        frame: v1::TrackFrame,
        call: &CallContext,
    ) -> Result<v1::TrackAnswer, ServiceError> {
        let name = frame.track.clone();
        let (reply, answer) = oneshot::channel();
        // Does not hold the track while it waits.
        put(
            &*self.tracks.inbox(&name, &call.caller)?,
            frame,
            call.clone(),
            Some(reply),
            self,
        )?;
        answer.await.unwrap_or_else(|_| {
            Err(if self.shutdown.is_cancelled() {
                ServiceError::ShuttingDown
            } else {
                not_found(&name)
            })
        })
    }

    /// Starts a track, whose frames come on the call's stream or are pushed.
    async fn start(
        &self,
        track: v1::Track,
        is_pushed: bool,
        call: &CallContext,
    ) -> Result<Track, ServiceError> {
        let TrackQuery {
            intake,
            policy,
            object_id,
            convention,
            current,
        } = track_query(track, is_pushed, self.known_rigs(), self.exists())?;
        call.log_object(&object_id);
        let place = self.tracks.places.take(&call.client)?;
        let object = self.object(&object_id, call).await?.object;
        // Prepares the object for searches before the first frame.
        self.derived(&object, call).await?;
        Ok(Track {
            handler: self.clone(),
            inbox: Arc::new(Inbox::new(intake)),
            policy,
            object_id,
            convention,
            holding: HeldGrasp::of(current),
            recent: RecentHands::default(),
            motion: policy.horizon.map(Motion::new),
            answered: 0,
            captured: None,
            opened: Instant::now(),
            due: call.answer_due().filter(|_| !is_pushed),
            held: object.hold(),
            _place: place,
        })
    }
}

/// Puts the frames of a stream into an inbox until they end.
async fn read(
    mut frames: Streaming<v1::TrackHoldoutRequest>,
    inbox: &Inbox,
    call: &CallContext,
    shared: &Shared,
) -> Result<(), ServiceError> {
    shared.executor.faults.at(FaultPoint::Frames);
    while let Some(request) = frames.message().await.map_err(|status| broken(&status))? {
        match request.message {
            Some(Message::Frame(frame)) => put(inbox, frame, call.of_part(Instant::now()), None, shared)?,
            Some(Message::Track(_)) => {
                return Err(ServiceError::invalid(
                    "track",
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
    frame: v1::TrackFrame,
    call: CallContext,
    reply: Option<Reply>,
    shared: &Shared,
) -> Result<(), ServiceError> {
    let arrived = call.arrived;
    inbox.put(frame, call, reply, |intake, frame| {
        intake.check(frame, arrived, shared.known_rigs(), shared.exists())
    })
}

/// The error of an input that is not a message of the contract, or too long.
fn broken(status: &Status) -> ServiceError {
    match status.code() {
        Code::OutOfRange => ServiceError::MessageTooLarge {
            limit: MAX_FIND_REQUEST,
        },
        _ => ServiceError::Malformed(status.message().to_owned()),
    }
}

/// The answers of a track, each computed when the transport has room for it. The reader of its frames ends with them. The track is
/// boxed: it moves into and out of the future of every answer.
fn answers(track: Track, reader: JoinSet<()>) -> Messages<v1::TrackAnswer> {
    Box::pin(futures_util::stream::unfold(
        Some((Box::new(track), reader)),
        |state| async {
            let (mut track, reader) = state?;
            match track.next().await.transpose()? {
                Ok(answer) => Some((Ok(answer), Some((track, reader)))),
                Err(error) => Some((Err(error.into()), None)),
            }
        },
    ))
}

impl Track {
    /// The answer to the latest frame, once there is one; `None` at the end of the frames.
    async fn next(&mut self) -> Result<Option<v1::TrackAnswer>, ServiceError> {
        match self.latest().await? {
            Some(PendingFrame { latest, call, .. }) => self.answer(latest, &call).await.map(Some),
            None => Ok(None),
        }
    }

    /// Answers pushed frames, until none comes for too long, an answer panics, or the server shuts down.
    async fn answer_pushed(mut self) {
        while let Ok(Some(PendingFrame { latest, call, reply })) = self.latest().await {
            let answer = Box::pin(contained(self.answer(latest, &call))).await;
            let is_broken = matches!(answer, Err(ServiceError::Panicked));
            if reply.is_some_and(|reply| reply.send(answer).is_err()) {
                // Nobody received it.
                self.holding.is_sent = false;
            }
            if is_broken {
                return;
            }
        }
    }

    /// The latest frame, once there is one; `None` at the end of the frames.
    async fn latest(&self) -> Result<Option<PendingFrame>, ServiceError> {
        let Shared { shutdown, config, .. } = &*self.handler;
        let over = async {
            match self.due {
                Some(due) => tokio::time::sleep_until(due.into()).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            () = shutdown.cancelled() => Err(ServiceError::ShuttingDown),
            () = over => Err(ServiceError::DeadlineExceeded),
            latest = self.inbox.latest(self.answered, config.streams.track_idle) => latest,
        }
    }

    async fn answer(&mut self, latest: Latest, call: &CallContext) -> Result<v1::TrackAnswer, ServiceError> {
        self.answered += 1;
        let (arrived, answer) = match latest {
            Latest::Frame(frame) => (frame.arrived, self.answer_frame(*frame, call).await?),
            Latest::Wrong(frame) => {
                let answer = v1::TrackAnswer {
                    sequence: frame.sequence,
                    current: Some(none(v1::Check::Frame)),
                    warnings: frame.warnings,
                    ..Default::default()
                };
                (frame.arrived, answer)
            }
        };
        Ok(v1::TrackAnswer {
            server_time: Some(wire_duration(arrived.elapsed())),
            ..answer
        })
    }

    async fn answer_frame(
        &mut self,
        mut frame: Frame,
        call: &CallContext,
    ) -> Result<v1::TrackAnswer, ServiceError> {
        if frame.query.object_id != self.object_id {
            // Begins anew with another object.
            self.object_id.clone_from(&frame.query.object_id);
            self.holding = HeldGrasp::default();
            self.recent = RecentHands::default();
            self.motion = self.policy.horizon.map(Motion::new);
        }
        self.captured = frame.captured.or(self.captured);
        // If frames have no times, they were captured when they came.
        let at = self.captured.unwrap_or(frame.arrived - self.opened);
        if let (Some(motion), Some(captured)) = (&mut self.motion, frame.captured) {
            motion.predict(captured, &mut frame.query);
        }
        self.recent.add(at, &mut frame.query);
        let last_error = self.motion.as_ref().and_then(|motion| motion.last_error);
        let mut answer = v1::TrackAnswer {
            sequence: frame.sequence,
            last_prediction: last_error.map(|error| wire_error(error, self.convention)),
            warnings: std::mem::take(&mut frame.warnings),
            ..Default::default()
        };
        let is_aborted = self.holding.is_aborted(frame.is_committed);
        let found = match self.find(frame, at, call).await {
            // A well-formed hand whose mesh is no surface.
            Err(ServiceError::Invalid(violations)) => {
                answer.warnings.extend(sentences(violations));
                answer.current = Some(none(v1::Check::Frame));
                return Ok(answer);
            }
            found => found?,
        };
        let mut report = found.current.clone().unwrap_or_else(|| first_report(&found));
        let mut grasp = found.grasps.into_iter().next();
        if is_aborted {
            report = self.holding.still_aborted(report);
            grasp = None;
        }
        self.holding.learn(&report, grasp.as_ref(), at);
        answer.grasp = grasp;
        answer
            .warnings
            .extend(found.report.into_iter().flat_map(|report| report.warnings));
        answer.current = Some(report);
        Ok(answer)
    }

    /// Finds the grasp for a frame, as a call with a current grasp does.
    async fn find(
        &mut self,
        mut frame: Frame,
        at: Duration,
        call: &CallContext,
    ) -> Result<v1::FindGraspResponse, ServiceError> {
        let shared = &*self.handler;
        shared.executor.faults.at(FaultPoint::Frame);
        self.holding.hold(&mut frame, at, &self.policy, &shared.rigs)?;
        let object = shared.object(&self.object_id, call).await?.object;
        self.held = object.hold();
        // Boxed as the track is: a search's future takes kilobytes.
        match Box::pin(self.handler.answer(frame.query, call)).await {
            Err(ServiceError::Overloaded {
                limit: Limit::Searches,
                ..
            }) => Ok(v1::FindGraspResponse {
                current: Some(none(v1::Check::Time)),
                ..Default::default()
            }),
            found => found,
        }
    }
}

/// The report on an answer without an earlier grasp.
fn first_report(found: &v1::FindGraspResponse) -> v1::CurrentGraspReport {
    if !found.grasps.is_empty() {
        return v1::CurrentGraspReport {
            status: v1::CurrentGraspStatus::Replanned.into(),
            ..Default::default()
        };
    }
    let mut limits = found.report.iter().flat_map(|report| &report.limits);
    none(
        limits
            .next()
            .map_or(v1::Check::Time, |limit| match limit.check() {
                v1::Check::GiverClearance | v1::Check::ObstacleClearance => v1::Check::GiverClearance,
                v1::Check::Reach => v1::Check::Reach,
                _ => v1::Check::Holdable,
            }),
    )
}

fn none(no_grasp: v1::Check) -> v1::CurrentGraspReport {
    v1::CurrentGraspReport {
        status: v1::CurrentGraspStatus::None.into(),
        no_grasp: no_grasp.into(),
        ..Default::default()
    }
}

fn wire_error(error: PredictionError, convention: Convention) -> v1::PredictionError {
    let length = |metres| convention.length_from_openxr(metres);
    v1::PredictionError {
        object_distance: length(error.object_distance),
        object_angle: error.object_angle,
        giver_distance: error.giver_distance.map(length),
    }
}
