//! `GraspService`; [`super::tracks`] has its calls of tracks.

use std::{
    hash::{BuildHasher as _, RandomState},
    pin::pin,
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, grasp_service_server::GraspService};
use grasp_synthesis::{base::stop::Stop, model::strategy::Choice};
use tonic::{Request, Response, Status, Streaming};

use super::{
    Handler,
    streaming::{MessageSender, Messages, messages},
};
use crate::{
    budget::effective_budget,
    call::CallContext,
    error::ServiceError,
    executor::{Admission, Workers, before},
    objects::{derived::ObjectSize, store::Need},
    search::{self, Answered, FindJob, Stream},
    validate::{
        EvaluateQuery, FindQuery, Sent, StreamQuery, ValidateQuery, evaluate_query, find_query, stream_query,
        validate_query,
    },
};

impl Handler {
    pub(super) async fn answer(
        &self,
        query: FindQuery,
        call: &CallContext,
    ) -> Result<v1::FindGraspResponse, ServiceError> {
        let (admission, job) = self.ready(query, call).await?;
        let stored = Arc::clone(&job.stored);
        let answered = search::find(job, &self.executor, admission).await?;
        call.search_ended(answered.ended, answered.summary);
        if let Some((hand, grip)) = answered.new_grip {
            self.atlases
                .learn(&stored, &hand, grip, self.config.learned_grips);
        }
        Ok(answered.response)
    }

    /// Works on a holdout, with an answer only at the end.
    async fn examine<T: Send + 'static>(
        &self,
        holdout: FindQuery,
        call: &CallContext,
        work: impl FnOnce(FindJob, Workers<'_>, Stop<'_>) -> Result<Answered<T>, ServiceError> + Send + 'static,
    ) -> Result<T, ServiceError> {
        // Each takes a core besides its turns at the workers.
        let turn = before(call.answer_due(), self.examining.acquire(&call.client)).await?;
        let (admission, job) = self.ready(holdout, call).await?;
        let overdue = job.overdue();
        // Boxed: jobs of some kilobytes would make the futures of all calls large.
        let work = Box::new(move |workers: Workers<'_>, stop: Stop<'_>| {
            let _turn = turn;
            work(job, workers, stop)
        });
        let answered = before(overdue, self.executor.run(admission, work)).await???;
        call.search_ended(answered.ended, answered.summary);
        Ok(answered.response)
    }

    async fn ready(
        &self,
        query: FindQuery,
        call: &CallContext,
    ) -> Result<(Admission, FindJob), ServiceError> {
        let admission = if let Some(admission) = call.take_admission() {
            admission
        } else {
            let own = call.caller.take_search()?;
            let due = call.latest_end(self.config.budgets.maximum);
            self.executor.admit(&call.client, due)?.within(own)
        };
        call.search_begins(&admission);
        call.log_object(&query.object_id);
        let stored = self.object(&query.object_id, call).await?.object;
        let held = stored.hold();
        // The budget starts after the object's preparation.
        let (mut derived, mut since) = match self.objects.kept(&stored, Need::Call) {
            Some(kept) => (kept, call.arrived),
            None => (self.derived(&stored, call).await?, Instant::now()),
        };
        let size = ObjectSize::of(query.object_size, &stored);
        let mut object = Arc::clone(&stored);
        if let Some(size) = size {
            let due = call.answer_due();
            let _turn = before(due, self.heavy.acquire(&call.client)).await?;
            let slot = self.objects.resized(&stored, size)?;
            let filled = self.resizer.fill(slot, &stored, size, &self.rigs, due);
            object = filled.await?;
            derived = object.derived_until(Stop::NEVER)?;
            since = Instant::now();
        }
        let reserve = self.reserve.at(Instant::now());
        call.log_reserve(reserve);
        let budgets = self.config.budgets;
        let effective = |requested| effective_budget(requested, budgets, reserve, since, call.deadline);
        let budget = effective(query.limits.budget);
        if budget.is_zero() {
            return Err(ServiceError::DeadlineExceeded);
        }
        let known = if query.uses_atlas() {
            let hands = [Some(&query.receiving_hand), query.alternative_hand.as_ref()];
            let hands = hands.map(|hand| hand.map(|hand| &hand.hand));
            self.atlases.get(&stored, hands)
        } else {
            Default::default()
        };
        let job = FindJob {
            _held: held,
            derived,
            stored: object,
            resized: size.map(ObjectSize::scale),
            seed: query.seed.unwrap_or_else(drawn_seed),
            arrived: since,
            budget,
            patience: if query.limits.is_patient {
                effective(None).max(budget)
            } else {
                budget
            },
            has_deadline: call.deadline.is_some(),
            workers: self.executor.workers(),
            refinement: query.limits.refinement.unwrap_or(self.config.refinement),
            known,
            query,
        };
        call.search_is_due(job.due());
        admission.set_due(job.due(), job.query.search.choice == Choice::BestWithinBudget);
        Ok((admission, job))
    }

    /// Sends the grasps of a search: better ones as they are found, no two within the interval, or in the end the best that differ;
    /// then how it ended.
    async fn send_found(
        &self,
        sent: Sent,
        (admission, job): (Admission, FindJob),
        call: &CallContext,
        sender: MessageSender<v1::FindGraspResponse>,
    ) -> Result<(), ServiceError> {
        let interval = match sent {
            Sent::Better { interval } => interval,
            Sent::Alternatives { .. } => Duration::ZERO,
        };
        let stream = Stream::new(sent);
        let search = async {
            let answered = stream.run(job, &self.executor, admission).await?;
            call.search_ended(answered.ended, answered.summary);
            Ok::<_, ServiceError>(answered)
        };
        let mut search = pin!(search);
        let mut has_sent = false;
        let mut next = tokio::time::Instant::now();
        let answered = loop {
            let due = async {
                stream.news().await;
                tokio::time::sleep_until(next).await;
            };
            let ended = tokio::select! {
                biased;
                ended = &mut search => Some(ended?),
                () = due => None,
            };
            for found in stream.take() {
                next = tokio::time::Instant::now() + interval;
                has_sent = true;
                sender.send(stream.message(found).await?).await?;
            }
            if let Some(answered) = ended {
                break answered;
            }
        };
        let mut last = v1::FindGraspResponse {
            grasps: Vec::new(),
            ..answered.response
        };
        if has_sent {
            // An answer before the end of the search may lack a grasp already sent.
            last.set_outcome(v1::Outcome::Found);
        }
        sender.send(last).await
    }
}

#[tonic::async_trait]
impl GraspService for Handler {
    async fn find_grasp(
        &self,
        request: Request<v1::FindGraspRequest>,
    ) -> Result<Response<v1::FindGraspResponse>, Status> {
        let call = CallContext::of(&request);
        let query = find_query(request.into_inner(), self.known_rigs(), self.exists())?;
        Ok(Response::new(self.answer(query, &call).await?))
    }

    type StreamGraspsStream = Messages<v1::FindGraspResponse>;

    async fn stream_grasps(
        &self,
        request: Request<v1::StreamGraspsRequest>,
    ) -> Result<Response<Self::StreamGraspsStream>, Status> {
        let call = CallContext::of(&request);
        let request = request.into_inner();
        let StreamQuery { find, sent } = stream_query(request, self.known_rigs(), self.exists())?;
        let ready = self.ready(find, &call).await?;
        let handler = self.clone();
        let messages = messages(self, |sender| async move {
            handler.send_found(sent, ready, &call, sender).await
        });
        Ok(Response::new(messages))
    }

    type TrackHoldoutStream = Messages<v1::TrackAnswer>;

    async fn track_holdout(
        &self,
        request: Request<Streaming<v1::TrackHoldoutRequest>>,
    ) -> Result<Response<Self::TrackHoldoutStream>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.track(request.into_inner(), &call).await?))
    }

    async fn create_track(&self, request: Request<v1::Track>) -> Result<Response<v1::Track>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.open_track(request.into_inner(), &call).await?))
    }

    async fn push_frame(
        &self,
        request: Request<v1::TrackFrame>,
    ) -> Result<Response<v1::TrackAnswer>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.push(request.into_inner(), &call).await?))
    }

    async fn delete_track(&self, request: Request<v1::DeleteTrackRequest>) -> Result<Response<()>, Status> {
        let caller = CallContext::of(&request).caller;
        self.tracks.delete(&request.into_inner().name, &caller).await?;
        Ok(Response::new(()))
    }

    async fn validate_grasp(
        &self,
        request: Request<v1::ValidateGraspRequest>,
    ) -> Result<Response<v1::ValidateGraspResponse>, Status> {
        let call = CallContext::of(&request);
        let ValidateQuery {
            holdout,
            grasp,
            find_nearest,
            warnings,
        } = validate_query(request.into_inner(), self.known_rigs(), self.exists())?;
        let judge = move |job: FindJob, workers: Workers<'_>, stop: Stop<'_>| {
            search::judge(job, &grasp, find_nearest, warnings, workers, stop)
        };
        Ok(Response::new(self.examine(holdout, &call, judge).await?))
    }

    async fn evaluate_holdout(
        &self,
        request: Request<v1::EvaluateHoldoutRequest>,
    ) -> Result<Response<v1::EvaluateHoldoutResponse>, Status> {
        let call = CallContext::of(&request);
        let EvaluateQuery {
            holdout,
            other_presenting_hands: others,
        } = evaluate_query(request.into_inner(), self.known_rigs(), self.exists())?;
        let rate = move |job: FindJob, workers: Workers<'_>, stop: Stop<'_>| {
            search::rate(&job, others, workers, stop)
        };
        Ok(Response::new(self.examine(holdout, &call, rate).await?))
    }
}

/// A new unpredictable seed for a request without one. The report contains it.
fn drawn_seed() -> u64 {
    // The standard library keys its hasher with randomness of the operating system.
    RandomState::new().hash_one(0_u8)
}
