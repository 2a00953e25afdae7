//! Streams of grasps.

use grasp_proto::v1::{self, stream_grasps_response::Event};

use super::{
    Malformed, find_request_to_wire,
    geometry_codec::duration_from_wire,
    required,
    search_codec::{grasp_from_wire, report_from_wire, source_from_wire},
};
use crate::{
    search::{FindRequest, Outcome},
    stream::{DifferBy, StreamEvent, StreamSummary, Streamed, StreamedGrasp},
};

pub(crate) fn stream_request_to_wire(request: &FindRequest, streamed: &Streamed) -> v1::StreamGraspsRequest {
    let (most_per_second, alternatives) = match streamed {
        Streamed::Better { most_per_second } => (*most_per_second, None),
        Streamed::Alternatives { count, differ_by } => {
            let differ_by = differ_by.iter().map(|by| match by {
                DifferBy::Approach => v1::DifferBy::Approach.into(),
                DifferBy::Type => v1::DifferBy::Type.into(),
                DifferBy::Region => v1::DifferBy::Region.into(),
            });
            let alternatives = v1::Alternatives {
                count: *count,
                differ_by: differ_by.collect(),
            };
            (None, Some(alternatives))
        }
    };
    v1::StreamGraspsRequest {
        holdout: Some(find_request_to_wire(request)),
        most_per_second,
        alternatives,
    }
}

pub(crate) fn stream_event_from_wire(message: v1::StreamGraspsResponse) -> Result<StreamEvent, Malformed> {
    match required("event", message.event)? {
        Event::Grasp(grasp) => streamed_grasp(grasp)
            .map(|grasp| StreamEvent::Grasp(Box::new(grasp)))
            .map_err(|malformed| malformed.within("grasp")),
        Event::Summary(end) => summary(end)
            .map(|summary| StreamEvent::Summary(Box::new(summary)))
            .map_err(|malformed| malformed.within("summary")),
    }
}

fn streamed_grasp(streamed: v1::StreamedGrasp) -> Result<StreamedGrasp, Malformed> {
    let grasp = grasp_from_wire(required("grasp", streamed.grasp)?);
    let found_after = required("found_after", streamed.found_after)?;
    Ok(StreamedGrasp {
        grasp: grasp.map_err(|malformed| malformed.within("grasp"))?,
        found_after: duration_from_wire("found_after", found_after)?,
        source: source_from_wire(streamed.source),
    })
}

fn summary(summary: v1::StreamSummary) -> Result<StreamSummary, Malformed> {
    let report = report_from_wire(required("report", summary.report)?);
    Ok(StreamSummary {
        outcome: match v1::Outcome::try_from(summary.outcome) {
            Ok(v1::Outcome::Found) => Outcome::Found,
            Ok(v1::Outcome::BudgetExhausted) => Outcome::BudgetExhausted,
            // Streams have no standing grasp to give up.
            Ok(v1::Outcome::Unspecified | v1::Outcome::Aborted) | Err(_) => {
                return Err(Malformed::unknown_value("outcome", summary.outcome));
            }
        },
        report: report.map_err(|malformed| malformed.within("report"))?,
        sent: summary.sent,
        skipped: summary.skipped,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_say_what_is_streamed() {
        let request = FindRequest::new("objects/mug");
        let better = Streamed::Better {
            most_per_second: Some(5.0),
        };
        let message = stream_request_to_wire(&request, &better);
        assert_eq!(message.holdout.expect("it is sent").object, "objects/mug");
        assert_eq!((message.most_per_second, message.alternatives), (Some(5.0), None));
        let alternatives = Streamed::Alternatives {
            count: 4,
            differ_by: vec![DifferBy::Type, DifferBy::Region],
        };
        let message = stream_request_to_wire(&request, &alternatives);
        let sent = message.alternatives.expect("it is sent");
        assert_eq!((sent.count, sent.differ_by), (4, vec![2, 3]));
    }

    #[test]
    fn malformed_messages_name_the_field() {
        let field = |event| {
            let message = v1::StreamGraspsResponse { event };
            stream_event_from_wire(message)
                .expect_err("it is incomplete")
                .path
        };
        assert_eq!(field(None), "event");
        let grasp = v1::StreamedGrasp::default();
        assert_eq!(field(Some(Event::Grasp(grasp))), "grasp.grasp");
        let summary = v1::StreamSummary::default();
        assert_eq!(field(Some(Event::Summary(summary))), "summary.report");
    }
}
