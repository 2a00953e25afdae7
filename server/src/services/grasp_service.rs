//! `GraspService`.

use std::{
    hash::{BuildHasher as _, RandomState},
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, grasp_service_server::GraspService};
use tonic::{Request, Response, Status};

use super::Shared;
use crate::{
    budget::effective_budget,
    call::{CallContext, SearchSummary},
    error::ServiceError,
    search::{self, FindJob},
    validate::find_query,
};

/// Implements `GraspService`.
#[derive(Clone, Debug)]
pub(crate) struct GraspHandler {
    shared: Arc<Shared>,
}

impl GraspHandler {
    /// A handler with the shared state.
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared }
    }

    async fn find(
        &self,
        request: v1::FindGraspRequest,
        call: &CallContext,
    ) -> Result<v1::FindGraspResponse, ServiceError> {
        let shared = &self.shared;
        let query = find_query(request, (&shared.default_rig, &shared.rigs), |id| {
            shared.objects.contains(id)
        })?;
        call.log_object(&query.object_id);
        let stored = shared.object(&query.object_id, call).await?.object;
        let object = Arc::clone(&stored.object);
        let reserve = shared.reserve.at(Instant::now());
        call.log_reserve(reserve);
        let effective =
            |requested| effective_budget(requested, shared.budgets, reserve, call.arrived, call.deadline);
        let budget = effective(query.limits.budget);
        if budget.is_zero() {
            return Err(ServiceError::DeadlineExceeded);
        }
        let admission = shared.executor.admit()?;
        let uses_atlas = query.uses_atlas();
        let known = if uses_atlas {
            let [first, alternative] = [Some(&query.receiving_hand), query.alternative_hand.as_ref()]
                .map(|hand| hand.map(|hand| &hand.hand));
            shared.atlases.get(&stored, [first, alternative])
        } else {
            Default::default()
        };
        let job = FindJob {
            object,
            stored: Arc::clone(&stored),
            seed: query.seed.unwrap_or_else(drawn_seed),
            arrived: call.arrived,
            budget,
            patience: if query.limits.is_patient {
                effective(None).max(budget)
            } else {
                budget
            },
            has_deadline: call.deadline.is_some(),
            workers: shared.executor.workers(),
            mechanisms: shared.mechanisms,
            improvement: query.limits.improvement.unwrap_or(shared.improvement),
            known,
            query,
        };
        call.search_is_due(job.due());
        let answered = search::find(job, &shared.executor, admission).await?;
        call.search_ended(answered.ended);
        if let Some((hand, grip)) = answered.new_grip.filter(|_| uses_atlas) {
            shared.atlases.remember(&stored, &hand, grip);
        }
        call.log_search(summary(&answered.response));
        Ok(answered.response)
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

/// A new unpredictable seed for a request without one. The report contains it.
fn drawn_seed() -> u64 {
    // The standard library keys its hasher with randomness of the operating system.
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
