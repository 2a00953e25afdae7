//! How commands fail: exit codes, and errors for people or, with `--json`, for scripts.

use std::{
    error::Error,
    io::{self, Write as _},
    process::ExitCode,
    time::Duration,
};

use grasp_client::{BoxError, CallError, ClientError, Code, FieldViolation, code_name};
use grasp_scene::CannotDraw;
use serde_json::{Value, json};

/// Why a command failed.
#[derive(Debug)]
pub(crate) struct Failure {
    exit_code: u8,
    /// Stable identifier for scripts.
    kind: String,
    /// The error, with its causes, in one line. Violations are listed separately.
    pub(crate) message: String,
    call: Option<Box<CallError>>,
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        let (exit_code, kind) = match &error {
            ClientError::Endpoint { .. } => (2, "endpoint"),
            ClientError::Token => (2, "token"),
            ClientError::Connect { .. } => (5, "connect"),
            ClientError::Malformed(_) => (1, "malformed_answer"),
            ClientError::Call(call) => match call.code {
                Code::InvalidArgument
                | Code::NotFound
                | Code::AlreadyExists
                | Code::FailedPrecondition
                | Code::Aborted
                | Code::Unauthenticated
                | Code::PermissionDenied => (4, code_name(call.code)),
                Code::Unavailable | Code::ResourceExhausted | Code::DeadlineExceeded => {
                    (5, code_name(call.code))
                }
                _ => (1, "call"),
            },
            _ => (1, "other"),
        };
        let message = match error.call() {
            Some(call) if call.attempts > 1 => format!("{} (tried {} times)", call.message, call.attempts),
            Some(call) => call.message.clone(),
            None => with_causes(&error),
        };
        Self {
            call: error.call().cloned().map(Box::new),
            ..Self::new(exit_code, kind, message)
        }
    }
}

impl From<CannotDraw> for Failure {
    fn from(CannotDraw(why): CannotDraw) -> Self {
        Self::usage(why)
    }
}

impl Failure {
    fn new(exit_code: u8, kind: &str, message: impl Into<String>) -> Self {
        Self {
            exit_code,
            kind: kind.to_lowercase(),
            message: message.into(),
            call: None,
        }
    }

    /// An invalid command line or request file.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self::new(2, "usage", message)
    }

    /// Writing to standard output failed.
    pub(crate) fn output(error: &io::Error) -> Self {
        // Readers such as `head` close the pipe early.
        let is_closed = error.kind() == io::ErrorKind::BrokenPipe;
        let message = format!("cannot write to standard output: {error}");
        Self::new(u8::from(!is_closed), "output", message)
    }

    /// Any other failure, with its cause.
    pub(crate) fn other(what: impl Into<String>, why: impl Into<BoxError>) -> Self {
        let message = format!("{}: {}", what.into(), with_causes(why.into().as_ref()));
        Self::new(1, "other", message)
    }

    pub(crate) fn interrupted() -> Self {
        Self::new(130, "interrupted", "interrupted")
    }

    /// Reports the failure on standard error and returns the exit code.
    pub(crate) fn report(&self, as_json: bool) -> ExitCode {
        if self.exit_code != 0 {
            let line = if as_json {
                self.to_json().to_string()
            } else {
                self.to_text()
            };
            // Standard error may be closed.
            let _ = writeln!(io::stderr().lock(), "{line}");
        }
        ExitCode::from(self.exit_code)
    }

    fn to_text(&self) -> String {
        let message = &self.message;
        let Some(call) = &self.call else {
            return format!("error: {message}");
        };
        // A message that contains the first violation would repeat the list below it.
        let violations = call.violations();
        let first = violations.first();
        let repeats = first.is_some_and(|first| message.contains(&first.description));
        let mut lines = vec![match violations.len() {
            1 if repeats => "error: the request has 1 field wrong".to_owned(),
            count if repeats => format!("error: the request has {count} fields wrong"),
            _ => format!("error: {message}"),
        }];
        lines.extend(
            violations
                .iter()
                .map(|wrong| format!("{}: {}", wrong.field, wrong.description)),
        );
        if let Some(resource) = call.details.resource_info()
            && !call.message.contains(&resource.resource_name)
        {
            let (kind, name) = (&resource.resource_type, &resource.resource_name);
            lines.push(format!("{kind} {name}: {}", resource.description));
        }
        let delay = retry_delay(call);
        lines.extend(delay.map(|delay| format!("try again in {delay:?}")));
        lines.join("\n  ")
    }

    /// `{"error": {"kind", "message"}}`; errors of calls also have `code`, `attempts`, `reason`, `metadata`,
    /// `field_violations`, `resource` and `retry_delay_seconds`.
    fn to_json(&self) -> Value {
        let mut error = json!({ "kind": self.kind, "message": self.message });
        if let Some(call) = &self.call {
            error["code"] = json!(code_name(call.code));
            error["attempts"] = json!(call.attempts);
            let info = call.details.error_info();
            error["reason"] = json!(info.map(|info| &info.reason));
            error["metadata"] = info.map_or(json!({}), |info| json!(info.metadata));
            let violation =
                |FieldViolation {
                     field, description, ..
                 }: &_| { json!({ "field": field, "description": description }) };
            error["field_violations"] = call.violations().iter().map(violation).collect();
            let resource = call.details.resource_info().map(|resource| {
                let (kind, name) = (&resource.resource_type, &resource.resource_name);
                json!({ "type": kind, "name": name, "description": resource.description })
            });
            error["resource"] = json!(resource);
            error["retry_delay_seconds"] = json!(retry_delay(call).map(|delay| delay.as_secs_f64()));
        }
        json!({ "error": error })
    }
}

fn retry_delay(call: &CallError) -> Option<Duration> {
    call.details.retry_info().and_then(|info| info.retry_delay)
}

/// Reports an invalid command line, or prints help or version.
pub(crate) fn report_usage(error: &clap::Error) -> ExitCode {
    let wants_json = std::env::args_os().any(|argument| argument == "--json");
    if error.use_stderr() && wants_json {
        let message = error.to_string();
        // The first paragraph is the error; usage and hints follow.
        let what = message.split("\n\n").next().unwrap_or_default();
        let what = what.strip_prefix("error: ").unwrap_or(what).trim_end();
        return Failure::usage(what).report(true);
    }
    // A closed pipe is not an error here.
    let _ = error.print();
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2))
}

/// An error and its causes, separated by colons; causes that repeat the preceding error are left out.
fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let message = error.to_string();
        if !text.ends_with(&message) {
            text.push_str(": ");
            text.push_str(&message);
        }
        cause = error.source();
    }
    text
}
