//! `GraspService.ValidateGrasp`.

use grasp_proto::v1;

use super::{GraspHandler, grasp_service::Ready};
use crate::{
    call::{CallContext, SearchSummary},
    error::ServiceError,
    search::{JudgeJob, judge},
    validate::{ValidateQuery, validate_query},
};

impl GraspHandler {
    pub(super) async fn validate(
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
        let Ready {
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
        let judged = judge(job, &shared.executor, admission).await?;
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
}
