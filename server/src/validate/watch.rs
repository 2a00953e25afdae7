//! Checks requests to watch objects.

use grasp_proto::v1;

use super::{
    Violations,
    labels::{LabelFilter, label_filter},
};
use crate::error::ServiceError;

/// A checked request to watch objects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct WatchQuery {
    /// Which objects.
    pub filter: LabelFilter,
    /// True to report the present ones first.
    pub wants_present: bool,
}

/// Checks a request to watch objects.
pub(crate) fn watch_query(request: &v1::WatchObjectsRequest) -> Result<WatchQuery, ServiceError> {
    let violations = Violations::default();
    let filter = label_filter(violations.field("filter"), &request.filter);
    violations.finish(WatchQuery {
        filter,
        wants_present: request.include_present,
    })
}
