//! `GraspService`.

use std::{
    hash::{BuildHasher as _, RandomState},
    sync::Arc,
    time::Instant,
};

use grasp_proto::v1::{self, grasp_service_server::GraspService};
use grasp_synthesis::base::stop::Stop;
use tonic::{Request, Response, Status, Streaming};

use super::{Shared, streaming::Messages, tracks::TrackAnswers};
use crate::{
    budget::effective_budget,
    call::{CallContext, SearchSummary},
    error::ServiceError,
    executor::Admission,
    objects::{Derived, StoredObject, derived::ObjectSize, store::Need},
    search::{self, EvaluateJob, FindJob, JudgeJob},
    validate::{
        EvaluateQuery, FindQuery, RequestedSize, ValidateQuery, evaluate_query, find_query, validate_query,
    },
};

/// Implements `GraspService`.
#[derive(Clone, Debug)]
pub(crate) struct GraspHandler {
    pub(super) shared: Arc<Shared>,
}

impl GraspHandler {
    /// A handler with the shared state.
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared }
    }

    /// Searches for the grasp of a checked request.
    pub(super) async fn answer(
        &self,
        query: FindQuery,
        call: &CallContext,
    ) -> Result<v1::FindGraspResponse, ServiceError> {
        let shared = &self.shared;
        let ReadySearch {
            _held,
            admission,
            job,
        } = self.ready(query, call).await?;
        call.search_is_due(job.due());
        let stored = Arc::clone(&job.stored);
        let answered = search::find(job, &shared.executor, admission).await?;
        call.search_ended(answered.ended);
        if let Some((hand, grip)) = answered.new_grip {
            shared.atlases.learn(&stored, &hand, grip, shared.learned_grips);
        }
        call.log_search(summary(&answered.response));
        Ok(answered.response)
    }

    async fn validate(
        &self,
        request: v1::ValidateGraspRequest,
        call: &CallContext,
    ) -> Result<v1::ValidateGraspResponse, ServiceError> {
        let shared = &self.shared;
        let ValidateQuery {
            holdout,
            grasp,
            find_nearest,
            warnings,
        } = validate_query(request, (&shared.default_rig, &shared.rigs), |id| {
            shared.objects.contains(id)
        })?;
        let ReadySearch {
            _held,
            admission,
            job: find,
        } = self.ready(holdout, call).await?;
        call.search_is_due(find.due());
        let job = JudgeJob {
            find,
            grasp,
            find_nearest,
            warnings,
        };
        let judged = search::judge(job, &shared.executor, admission).await?;
        call.search_ended(judged.ended);
        call.log_search(SearchSummary {
            outcome: if judged.response.valid {
                "VALID"
            } else {
                "NOT_VALID"
            },
            attempts: 0,
            time: judged.check_time,
        });
        Ok(judged.response)
    }

    async fn evaluate(
        &self,
        request: v1::EvaluateHoldoutRequest,
        call: &CallContext,
    ) -> Result<v1::EvaluateHoldoutResponse, ServiceError> {
        let shared = &self.shared;
        let EvaluateQuery {
            holdout,
            other_presenting_hands,
        } = evaluate_query(request, (&shared.default_rig, &shared.rigs), |id| {
            shared.objects.contains(id)
        })?;
        let ReadySearch {
            _held,
            admission,
            job: find,
        } = self.ready(holdout, call).await?;
        call.search_is_due(find.due());
        let job = EvaluateJob {
            find,
            other_presenting_hands,
        };
        let evaluated = search::evaluate(job, &shared.executor, admission).await?;
        call.search_ended(evaluated.ended);
        let mut ratings = evaluated.response.ratings.iter();
        let is_receivable = ratings.any(|rating| rating.no_grasp() == v1::Check::Unspecified);
        call.log_search(SearchSummary {
            outcome: if is_receivable {
                "RECEIVABLE"
            } else {
                "NOT_RECEIVABLE"
            },
            attempts: evaluated.attempts,
            time: evaluated.time,
        });
        Ok(evaluated.response)
    }

    /// Admits a search and prepares what it needs.
    pub(super) async fn ready(
        &self,
        query: FindQuery,
        call: &CallContext,
    ) -> Result<ReadySearch, ServiceError> {
        let shared = &self.shared;
        call.log_object(&query.object_id);
        let stored = shared.object(&query.object_id, call).await?.object;
        let held = stored.hold();
        let admission = shared.executor.admit()?;
        let held_out = self.held_out(&stored, query.object_size, call).await?;
        let job = self.job(query, &stored, held_out, call)?;
        Ok(ReadySearch {
            _held: held,
            admission,
            job,
        })
    }

    /// The object as the request holds it out.
    async fn held_out(
        &self,
        stored: &Arc<StoredObject>,
        size: RequestedSize,
        call: &CallContext,
    ) -> Result<HeldOutObject, ServiceError> {
        let Shared {
            objects,
            resizer,
            rigs,
            ..
        } = &*self.shared;
        let (derived, since) = match objects.kept(stored, Need::Call) {
            Some(kept) => (kept, call.arrived),
            None => (self.shared.derived(stored, call).await?, Instant::now()),
        };
        let Some(size) = ObjectSize::of(size, stored) else {
            return Ok(HeldOutObject {
                derived,
                object: Arc::clone(stored),
                resized: None,
                since,
            });
        };
        let slot = objects.resized(stored, size)?;
        let object = resizer.fill(slot, stored, size, rigs, call.answer_due()).await?;
        Ok(HeldOutObject {
            derived: object.derived_until(Stop::NEVER)?,
            object,
            resized: Some(size.scale()),
            since: Instant::now(),
        })
    }

    /// The search for a grasp of an object.
    fn job(
        &self,
        query: FindQuery,
        stored: &Arc<StoredObject>,
        held_out: HeldOutObject,
        call: &CallContext,
    ) -> Result<FindJob, ServiceError> {
        let shared = &self.shared;
        let reserve = shared.reserve.at(Instant::now());
        call.log_reserve(reserve);
        let HeldOutObject {
            object,
            derived,
            resized,
            since,
        } = held_out;
        let effective =
            |requested| effective_budget(requested, shared.budgets, reserve, since, call.deadline);
        let budget = effective(query.limits.budget);
        if budget.is_zero() {
            return Err(ServiceError::DeadlineExceeded);
        }
        let known = if query.uses_atlas() {
            let [first, alternative] = [Some(&query.receiving_hand), query.alternative_hand.as_ref()]
                .map(|hand| hand.map(|hand| &hand.hand));
            shared.atlases.get(stored, [first, alternative])
        } else {
            Default::default()
        };
        Ok(FindJob {
            derived,
            stored: object,
            resized,
            seed: query.seed.unwrap_or_else(drawn_seed),
            arrived: since,
            budget,
            patience: if query.limits.is_patient {
                effective(None).max(budget)
            } else {
                budget
            },
            has_deadline: call.deadline.is_some(),
            workers: shared.executor.workers(),
            refinement: query.limits.refinement.unwrap_or(shared.refinement),
            known,
            query,
        })
    }
}

/// A search that may run.
pub(super) struct ReadySearch {
    /// Held while the call lasts, so that the object is not evicted.
    pub(super) _held: Arc<()>,
    /// The right to run it.
    pub(super) admission: Admission,
    /// The search.
    pub(super) job: FindJob,
}

/// An object as a request holds it out.
struct HeldOutObject {
    /// The object at its size.
    object: Arc<StoredObject>,
    /// What is derived from it.
    derived: Arc<Derived>,
    /// How many times as large it is, if size or mass are not its own.
    resized: Option<f32>,
    /// From when the budget counts: preparing the object does not.
    since: Instant,
}

#[tonic::async_trait]
impl GraspService for GraspHandler {
    async fn find_grasp(
        &self,
        request: Request<v1::FindGraspRequest>,
    ) -> Result<Response<v1::FindGraspResponse>, Status> {
        let call = CallContext::of(&request);
        let shared = &self.shared;
        let query = find_query(request.into_inner(), (&shared.default_rig, &shared.rigs), |id| {
            shared.objects.contains(id)
        })?;
        Ok(Response::new(self.answer(query, &call).await?))
    }

    type StreamGraspsStream = Messages<v1::FindGraspResponse>;

    async fn stream_grasps(
        &self,
        request: Request<v1::StreamGraspsRequest>,
    ) -> Result<Response<Self::StreamGraspsStream>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.stream(request.into_inner(), &call).await?))
    }

    type TrackHoldoutStream = TrackAnswers;

    async fn track_holdout(
        &self,
        request: Request<Streaming<v1::TrackHoldoutRequest>>,
    ) -> Result<Response<Self::TrackHoldoutStream>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.track(request.into_inner(), &call).await?))
    }

    async fn create_track(&self, request: Request<v1::Track>) -> Result<Response<v1::Track>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.create(request.into_inner(), &call).await?))
    }

    async fn push_frame(
        &self,
        request: Request<v1::TrackFrame>,
    ) -> Result<Response<v1::TrackAnswer>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.push(request.into_inner(), &call).await?))
    }

    async fn delete_track(&self, request: Request<v1::DeleteTrackRequest>) -> Result<Response<()>, Status> {
        self.shared.tracks.delete(&request.into_inner().name).await?;
        Ok(Response::new(()))
    }

    async fn validate_grasp(
        &self,
        request: Request<v1::ValidateGraspRequest>,
    ) -> Result<Response<v1::ValidateGraspResponse>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.validate(request.into_inner(), &call).await?))
    }

    async fn evaluate_holdout(
        &self,
        request: Request<v1::EvaluateHoldoutRequest>,
    ) -> Result<Response<v1::EvaluateHoldoutResponse>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.evaluate(request.into_inner(), &call).await?))
    }
}

/// A new unpredictable seed for a request without one. The report contains it.
fn drawn_seed() -> u64 {
    // The standard library keys its hasher with randomness of the operating system.
    RandomState::new().hash_one(0_u8)
}

/// A search as it is logged.
pub(super) fn summary(answer: &v1::FindGraspResponse) -> SearchSummary {
    SearchSummary {
        outcome: answer.outcome().as_str_name(),
        attempts: answer.attempts(),
        time: answer.search_time(),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn drawn_seeds_differ() {
        let seeds: HashSet<u64> = (0..1000).map(|_| drawn_seed()).collect();
        assert_eq!(seeds.len(), 1000);
    }
}
