//! Spans of calls, of which each is recorded when its call has ended: so they cost nothing while it runs, and nothing at all if no
//! collector is configured.

#[cfg(feature = "otlp")]
mod export;

use std::{fmt, sync::Arc, time::Instant};

use http::HeaderValue;
use tonic::Code;

/// Values of the setting `otlp_endpoint`, for errors.
pub(crate) const NEEDED_ENDPOINT: &str = if cfg!(feature = "otlp") {
    "a collector's address for OTLP over gRPC, such as http://localhost:4317"
} else {
    "absent: this server was built without the feature otlp"
};

/// The address of a collector, if spans can be exported to it.
pub(crate) fn parse_endpoint(text: &str) -> Option<String> {
    let uri: http::Uri = text.parse().ok()?;
    let is_known = cfg!(feature = "otlp") && uri.scheme_str() == Some("http") && uri.host().is_some();
    is_known.then(|| text.to_owned())
}

/// A call that has ended, and its parts.
#[derive(Debug)]
#[cfg_attr(not(feature = "otlp"), expect(dead_code, reason = "nothing exports it"))]
pub(crate) struct CallTrace<'a> {
    /// Service and method.
    pub method: &'a str,
    pub request_id: &'a str,
    /// The header with the span of the caller.
    pub traceparent: Option<&'a HeaderValue>,
    pub object: Option<&'a str>,
    pub outcome: Option<&'a str>,
    pub code: Code,
    pub time: Interval,
    /// Name and time of each part that there was.
    pub parts: Vec<(&'static str, Interval)>,
}

/// From the first to the second.
pub(crate) type Interval = (Instant, Instant);

/// Where spans go.
#[derive(Clone, Default)]
pub(crate) struct Traces(Option<Arc<dyn Collector>>);

/// Takes spans, without waiting.
trait Collector: Send + Sync {
    fn record(&self, call: &CallTrace<'_>);

    /// Waits a moment until the rest is sent.
    fn finish(&self);
}

impl Traces {
    /// Sends spans to a collector, if one is configured. On the async runtime.
    ///
    /// # Errors
    /// Says in words why they cannot be sent.
    #[cfg_attr(
        not(feature = "otlp"),
        expect(clippy::unnecessary_wraps, reason = "exporters may fail")
    )]
    pub(crate) fn start(endpoint: Option<&str>) -> Result<Self, String> {
        #[cfg(feature = "otlp")]
        if let Some(endpoint) = endpoint {
            return Ok(Self(Some(Arc::new(export::Exporter::start(endpoint)?))));
        }
        let _ = endpoint;
        Ok(Self::default())
    }

    pub(crate) fn are_on(&self) -> bool {
        self.0.is_some()
    }

    pub(crate) fn record(&self, call: &CallTrace<'_>) {
        if let Some(collector) = &self.0 {
            collector.record(call);
        }
    }

    /// Sends the rest, on a thread that may block.
    pub(crate) fn finish(&self) {
        if let Some(collector) = &self.0 {
            collector.finish();
        }
    }
}

impl fmt::Debug for Traces {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Traces").field(&self.are_on()).finish()
    }
}
