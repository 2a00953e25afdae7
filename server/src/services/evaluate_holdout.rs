//! `GraspService.EvaluateHoldout`.

use grasp_proto::v1;

use super::{GraspHandler, grasp_service::Ready};
use crate::{
    call::{CallContext, SearchSummary},
    error::ServiceError,
    search::{EvaluateJob, evaluate},
    validate::{EvaluateQuery, evaluate_query},
};

impl GraspHandler {
    pub(super) async fn evaluate(
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
        let Ready {
            _held,
            admission,
            job: find,
        } = self.ready(holdout, call).await?;
        call.search_is_due(find.due());
        let job = EvaluateJob {
            find,
            other_presenting_hands,
        };
        let evaluated = evaluate(job, &shared.executor, admission).await?;
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
}
