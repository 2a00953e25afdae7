//! Exports spans by OTLP over gRPC. They wait for the next batch in a bounded queue; further ones are dropped.

use std::{
    collections::HashMap,
    time::{Duration, Instant, SystemTime},
};

use opentelemetry::{
    Context, KeyValue,
    propagation::TextMapPropagator as _,
    trace::{SpanBuilder, SpanKind, Status, TraceContextExt as _, TracerProvider as _},
};
use opentelemetry_otlp::{SpanExporter, WithExportConfig as _};
use opentelemetry_sdk::{
    Resource,
    propagation::TraceContextPropagator,
    trace::{SdkTracer, SdkTracerProvider},
};

use super::{CallTrace, Collector, Interval};

/// Longest wait for the last spans.
const FINISH_TIME: Duration = Duration::from_secs(2);

pub(super) struct Exporter {
    provider: SdkTracerProvider,
    tracer: SdkTracer,
}

impl Exporter {
    pub(super) fn start(endpoint: &str) -> Result<Self, String> {
        let exporter = SpanExporter::builder()
            .with_tonic()
            .with_endpoint(endpoint)
            .build();
        let exporter = exporter.map_err(|error| format!("otlp_endpoint is {endpoint}; {error}"))?;
        let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
        let resource = Resource::builder()
            .with_service_name("grasp-server")
            .with_attribute(version);
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(resource.build())
            .build();
        let tracer = provider.tracer("grasp-server");
        Ok(Self { provider, tracer })
    }

    /// Records a span, and returns its context for those within.
    fn span(&self, span: SpanBuilder, time: Interval, clock: Clock, parent: &Context) -> Context {
        let span = span
            .with_start_time(clock.system(time.0))
            .start_with_context(&self.tracer, parent);
        parent.with_span(span)
    }
}

impl Collector for Exporter {
    fn record(&self, call: &CallTrace<'_>) {
        let clock = Clock::now();
        let caller = call.traceparent.and_then(|header| header.to_str().ok());
        let caller = caller.map(|header| ("traceparent".to_owned(), header.to_owned()));
        let caller = TraceContextPropagator::new()
            .extract_with_context(&Context::new(), &HashMap::<String, String>::from_iter(caller));
        let (service, method) = call.method.split_once('/').unwrap_or(("", call.method));
        let mut attributes = vec![
            KeyValue::new("rpc.system", "grpc"),
            KeyValue::new("rpc.service", service.to_owned()),
            KeyValue::new("rpc.method", method.to_owned()),
            KeyValue::new("rpc.grpc.status_code", call.code as i64),
            KeyValue::new("grasp.request_id", call.request_id.to_owned()),
        ];
        for (key, value) in [("grasp.object", call.object), ("grasp.outcome", call.outcome)] {
            attributes.extend(value.map(|value| KeyValue::new(key, value.to_owned())));
        }
        let span = SpanBuilder::from_name(call.method.to_owned())
            .with_kind(SpanKind::Server)
            .with_attributes(attributes);
        let context = self.span(span, call.time, clock, &caller);
        for &(name, time) in &call.parts {
            let part = SpanBuilder::from_name(name).with_kind(SpanKind::Internal);
            let part = self.span(part, time, clock, &context);
            part.span().end_with_timestamp(clock.system(time.1));
        }
        if call.code != tonic::Code::Ok {
            context.span().set_status(Status::error(call.code.description()));
        }
        context.span().end_with_timestamp(clock.system(call.time.1));
    }

    fn finish(&self) {
        if let Err(error) = self.provider.shutdown_with_timeout(FINISH_TIME) {
            tracing::warn!(%error, "the last spans were not sent");
        }
    }
}

/// The same moment by two clocks.
#[derive(Clone, Copy)]
struct Clock {
    instant: Instant,
    system: SystemTime,
}

impl Clock {
    fn now() -> Self {
        Self {
            instant: Instant::now(),
            system: SystemTime::now(),
        }
    }

    fn system(self, time: Instant) -> SystemTime {
        self.system - self.instant.saturating_duration_since(time)
    }
}
