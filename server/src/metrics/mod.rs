//! Counts and times of calls and searches, for Prometheus. Every label has a bounded set of values, none of which a client chooses:
//! calls of unknown methods count together.

mod exposition;

use std::{collections::HashMap, time::Duration};

use grasp_proto::v1;
use tonic::Code;

use exposition::Counter;
pub(crate) use exposition::{CONTENT_TYPE, Counters, Exposition, Histogram};

use crate::methods::methods;

/// How searches, checks of grasps and ratings of holdouts end.
const OUTCOMES: [&str; 7] = [
    "OUTCOME_FOUND",
    "OUTCOME_BUDGET_EXHAUSTED",
    "OUTCOME_ABORTED",
    "VALID",
    "NOT_VALID",
    "RECEIVABLE",
    "NOT_RECEIVABLE",
];

/// Largest number that a value of the contract's enums may have, for these to be found; their numbers have gaps.
const MAX_NUMBER: i32 = 255;

/// Number of codes of a status, from 0.
const CODES: usize = 17;

/// Everything that is counted.
#[derive(Debug)]
pub(crate) struct Metrics {
    by_path: HashMap<&'static str, Method>,
    /// The calls of each method; the last are those of unknown ones.
    calls: Vec<CallMetrics>,
    search: Histogram,
    overshoot: Histogram,
    outcomes: Counters,
    failed_checks: Counters,
    refusals: Counters,
}

/// The place of a method in the metrics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Method(usize);

#[derive(Debug)]
struct CallMetrics {
    path: &'static str,
    kind: &'static str,
    started: Counter,
    handled: [Counter; CODES],
    time: Histogram,
}

impl CallMetrics {
    fn new(path: &'static str, kind: &'static str) -> Self {
        Self {
            path,
            kind,
            started: Counter::default(),
            handled: Default::default(),
            time: Histogram::default(),
        }
    }

    /// The labels of the method, as the usual ones of gRPC.
    fn labels(&self) -> [(&'static str, &'static str); 3] {
        let (service, method) = self.path[1..].split_once('/').unwrap_or((UNKNOWN, UNKNOWN));
        [
            ("grpc_type", self.kind),
            ("grpc_service", service),
            ("grpc_method", method),
        ]
    }
}

const UNKNOWN: &str = "unknown";

impl Default for Metrics {
    fn default() -> Self {
        let methods = methods();
        let by_path = methods.iter().enumerate();
        let by_path = by_path.map(|(place, (path, _))| (*path, Method(place))).collect();
        let known = methods.iter().map(|(path, method)| {
            let kind = match (method.is_client_streaming(), method.is_server_streaming()) {
                (false, false) => "unary",
                (true, false) => "client_stream",
                (false, true) => "server_stream",
                (true, true) => "bidi_stream",
            };
            CallMetrics::new(path, kind)
        });
        let checks = (1..=MAX_NUMBER).filter_map(|number| v1::Check::try_from(number).ok());
        let reasons = (1..=MAX_NUMBER).filter_map(|number| v1::ErrorReason::try_from(number).ok());
        Self {
            by_path,
            calls: known.chain([CallMetrics::new("/", UNKNOWN)]).collect(),
            search: Histogram::default(),
            overshoot: Histogram::default(),
            outcomes: Counters::new("outcome", OUTCOMES.map(short)),
            failed_checks: Counters::new("check", checks.map(|check| short(check.as_str_name()))),
            refusals: Counters::new("reason", reasons.map(|reason| short(reason.as_str_name()))),
        }
    }
}

/// A value of an enum without the name of the enum.
fn short(name: &'static str) -> &'static str {
    let prefixes = ["OUTCOME_", "CHECK_", "ERROR_REASON_"];
    prefixes
        .iter()
        .find_map(|prefix| name.strip_prefix(prefix))
        .unwrap_or(name)
}

impl Metrics {
    /// Counts a call that has arrived.
    pub(crate) fn call_started(&self, path: &str) -> Method {
        let unknown = Method(self.calls.len() - 1);
        let method = self.by_path.get(path).copied().unwrap_or(unknown);
        self.calls[method.0].started.add();
        method
    }

    /// The path of a method, unless it is unknown.
    pub(crate) fn path(&self, method: Method) -> Option<&'static str> {
        (method.0 + 1 < self.calls.len()).then(|| self.calls[method.0].path)
    }

    /// Counts a call that has ended after this time.
    pub(crate) fn call_ended(&self, method: Method, code: Code, time: Duration) {
        let calls = &self.calls[method.0];
        calls.handled[code as usize].add();
        calls.time.record(time);
    }

    /// Records by how much a call ended after its deadline, 0 if it did not.
    pub(crate) fn overshot(&self, time: Duration) {
        self.overshoot.record(time);
    }

    /// Records a search, with the check for which it has no grasp or replaced the current one.
    pub(crate) fn searched(&self, time: Duration, outcome: &'static str, failed_check: Option<v1::Check>) {
        self.search.record(time);
        self.outcomes.add_value(short(outcome));
        if let Some(check) = failed_check {
            self.failed_checks.add_value(short(check.as_str_name()));
        }
    }

    /// Counts an error that was answered.
    pub(crate) fn refused(&self, reason: v1::ErrorReason) {
        self.refusals.add_value(short(reason.as_str_name()));
    }

    /// Writes all of it.
    pub(crate) fn write(&self, page: &mut Exposition) {
        let name = "grpc_server_started_total";
        page.family(name, "counter", "Calls that arrived.");
        for calls in &self.calls {
            page.sample(name, &calls.labels(), calls.started.get());
        }
        let name = "grpc_server_handled_total";
        page.family(name, "counter", "Calls that ended, by the code of their status.");
        for calls in &self.calls {
            let [kind, service, method] = calls.labels();
            for (number, count) in (0..).zip(&calls.handled) {
                let code = Code::from_i32(number);
                // Others come with their first call.
                if code == Code::Ok || count.get() > 0 {
                    let code = if code == Code::Ok {
                        "OK".to_owned()
                    } else {
                        format!("{code:?}")
                    };
                    page.sample(name, &[kind, service, method, ("grpc_code", &code)], count.get());
                }
            }
        }
        let name = "grpc_server_handling_seconds";
        page.family(
            name,
            "histogram",
            "Time from a call's headers to the end of its answer.",
        );
        for calls in &self.calls {
            page.histogram(name, &calls.labels(), &calls.time);
        }
        for (name, help, histogram) in [
            ("grasp_search_seconds", "Time of a search.", &self.search),
            (
                "grasp_deadline_overshoot_seconds",
                "By how much calls with a deadline ended after it, 0 for those that did not.",
                &self.overshoot,
            ),
        ] {
            page.family(name, "histogram", help);
            page.histogram(name, &[], histogram);
        }
        page.counters(
            "grasp_outcomes_total",
            "Searches and judgements by their outcome.",
            &self.outcomes,
        );
        page.counters(
            "grasp_failed_checks_total",
            "Searches that have no grasp, or replaced the current one, by the check that failed.",
            &self.failed_checks,
        );
        page.counters(
            "grasp_refusals_total",
            "Errors that were answered, by their reason.",
            &self.refusals,
        );
    }
}

#[cfg(test)]
mod tests {
    use prost_reflect::DescriptorPool;

    use super::*;

    #[test]
    fn every_check_and_reason_of_the_contract_counts() {
        let metrics = Metrics::default();
        let contract = DescriptorPool::decode(grasp_proto::FILE_DESCRIPTOR_SET).unwrap();
        for name in ["grasp.v1.Check", "grasp.v1.ErrorReason"] {
            let values = contract.get_enum_by_name(name).expect("the contract has it");
            let mut page = Exposition::default();
            metrics.write(&mut page);
            let text = page.into_text();
            for value in values.values().filter(|value| value.number() != 0) {
                let label = format!(
                    "=\"{}\"",
                    value.name().replace("CHECK_", "").replace("ERROR_REASON_", "")
                );
                assert!(text.contains(&label), "{label}");
            }
        }
    }

    #[test]
    fn calls_of_unknown_methods_count_together() {
        let metrics = Metrics::default();
        let find = metrics.call_started("/grasp.v1.GraspService/FindGrasp");
        assert_eq!(metrics.path(find), Some("/grasp.v1.GraspService/FindGrasp"));
        for path in ["/a/b", "/", "", "/grasp.v1.GraspService/FindGrasp/"] {
            let unknown = metrics.call_started(path);
            assert_eq!(metrics.path(unknown), None);
            metrics.call_ended(unknown, Code::Unimplemented, Duration::ZERO);
        }
        let mut page = Exposition::default();
        metrics.write(&mut page);
        let text = page.into_text();
        let labels = "grpc_type=\"unknown\",grpc_service=\"unknown\",grpc_method=\"unknown\"";
        for line in [
            format!("grpc_server_started_total{{{labels}}} 4"),
            format!("grpc_server_handled_total{{{labels},grpc_code=\"Unimplemented\"}} 4"),
        ] {
            assert!(text.contains(&line), "{line} in {text}");
        }
        let bidi = "grpc_server_started_total{grpc_type=\"bidi_stream\",grpc_service=\"grasp.v1.GraspService\",grpc_method=\"TrackHoldout\"} 0";
        assert!(text.contains(bidi));
    }
}
