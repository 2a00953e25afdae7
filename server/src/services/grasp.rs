//! `GraspService`.

use std::{
    hash::{BuildHasher as _, RandomState},
    sync::Arc,
    time::Duration,
};

use grasp_proto::v1::{self, grasp_service_server::GraspService};
use grasp_synthesis::search::uses_atlas;
use tonic::{Request, Response, Status};

use super::Shared;
use crate::{
    atlases::Known,
    budget::effective_budget,
    call::{CallContext, SearchSummary},
    error::ServiceError,
    search::job::FindJob,
    validate::find_query,
};

/// Answers `GraspService`.
#[derive(Clone, Debug)]
pub(crate) struct GraspHandler {
    shared: Arc<Shared>,
}

impl GraspHandler {
    /// A handler of the shared state.
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared }
    }

    async fn find(
        &self,
        request: v1::FindGraspRequest,
        call: &CallContext,
    ) -> Result<v1::FindGraspResponse, ServiceError> {
        let shared = &self.shared;
        let query = find_query(request, &shared.default_rig, |id| shared.objects.contains(id))?;
        call.tell_object(&query.object_id);
        let stored = shared.objects.get(&query.object_id)?;
        let object = Arc::clone(&stored.object);
        let in_force = |asked| effective_budget(asked, shared.budgets, call.arrived, call.deadline);
        let budget = in_force(query.budget);
        if budget.is_zero() {
            return Err(ServiceError::DeadlineExceeded);
        }
        let admission = shared.executor.admit()?;
        let may_use_atlas = query.may_use_atlas && uses_atlas(query.strategy, query.validity);
        let hand = query.receiving_hand;
        let mut known = if may_use_atlas {
            shared.atlases.get(&stored, hand)
        } else {
            Known::default()
        };
        if query.reproducible {
            // One that still grows would answer otherwise a moment later.
            known.atlas = known.atlas.filter(|atlas| atlas.is_complete());
        }
        let job = FindJob {
            seed: query.seed.unwrap_or_else(drawn_seed),
            object,
            stored: Arc::clone(&stored),
            arrived: call.arrived,
            budget,
            patience: if query.goes_on {
                in_force(None).max(budget)
            } else {
                budget
            },
            query,
            workers: shared.executor.workers(),
            known,
            mechanisms: shared.mechanisms,
        };
        let answered = if job.may_be_known() {
            let mut job = job.prepare()?;
            if let Some(answered) = job.look_up() {
                answered?
            } else {
                let run = shared
                    .executor
                    .run(admission, move |pool, stop| job.run(pool, stop));
                run.await??
            }
        } else {
            let run = shared
                .executor
                .run(admission, move |pool, stop| job.prepare()?.run(pool, stop));
            run.await??
        };
        if let Some(grip) = answered.newly_known.filter(|_| may_use_atlas) {
            shared.atlases.remember(&stored, hand, grip);
        }
        let answer = answered.response;
        call.tell_search(summary(&answer));
        Ok(answer)
    }
}

#[tonic::async_trait]
impl GraspService for GraspHandler {
    async fn find_grasp(
        &self,
        request: Request<v1::FindGraspRequest>,
    ) -> Result<Response<v1::FindGraspResponse>, Status> {
        let call = CallContext::of(&request);
        Ok(Response::new(self.find(request.into_inner(), &call).await?))
    }
}

/// A seed for a request that names none: unpredictable and new for every call. It is told in the report.
fn drawn_seed() -> u64 {
    // The standard library's hasher is keyed from the operating system's randomness.
    RandomState::new().hash_one(0_u8)
}

fn summary(answer: &v1::FindGraspResponse) -> SearchSummary {
    let report = answer.report.as_ref();
    let time = report
        .and_then(|report| report.search_time)
        .and_then(|time| Duration::try_from(time).ok());
    SearchSummary {
        outcome: answer.outcome().as_str_name(),
        attempts: report.map_or(0, |report| report.attempts),
        time: time.unwrap_or_default(),
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
