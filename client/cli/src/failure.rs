//! How commands fail: exit codes, and errors for people or, with `--json`, for scripts.

use std::{
    error::Error,
    io::{self, Write as _},
    process::ExitCode,
};

use grasp_client::{BoxError, CallError, ClientError, FieldViolation, code_name};
use serde_json::{Value, json};

/// Why a command failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// An error of the client library.
    Client(ClientError),
    /// An invalid command line or request file.
    Usage(String),
    /// Writing to standard output failed.
    Output(io::Error),
    /// Anything else: what could not be done, and why.
    Other(String, BoxError),
    /// The user pressed Ctrl-C.
    Interrupted,
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        Self::Client(error)
    }
}

impl Failure {
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self::Usage(message.into())
    }

    pub(crate) fn other(what: impl Into<String>, why: impl Into<BoxError>) -> Self {
        Self::Other(what.into(), why.into())
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Client(error) => match error {
                ClientError::InvalidArgument(_)
                | ClientError::NotFound(_)
                | ClientError::AlreadyExists(_)
                | ClientError::FailedPrecondition(_)
                | ClientError::Aborted(_) => 4,
                ClientError::Connect { .. }
                | ClientError::Unavailable(_)
                | ClientError::ResourceExhausted(_)
                | ClientError::DeadlineExceeded(_) => 5,
                ClientError::Endpoint { .. } => 2,
                _ => 1,
            },
            Self::Usage(_) => 2,
            // The reader closed the pipe: it has seen enough.
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => 0,
            Self::Output(_) | Self::Other(..) => 1,
            Self::Interrupted => 130,
        }
    }

    /// Stable identifier for scripts.
    fn kind(&self) -> String {
        let kind = match self {
            Self::Client(ClientError::Endpoint { .. }) => "endpoint",
            Self::Client(ClientError::Connect { .. }) => "connect",
            Self::Client(ClientError::Malformed { .. }) => "malformed_answer",
            Self::Client(ClientError::Other(_)) => "call",
            Self::Client(error) => error.call().map_or("call", |call| code_name(call.code)),
            Self::Usage(_) => "usage",
            Self::Output(_) => "output",
            Self::Other(..) => "other",
            Self::Interrupted => "interrupted",
        };
        kind.to_lowercase()
    }

    /// The call that failed, if one did.
    fn call(&self) -> Option<&CallError> {
        match self {
            Self::Client(error) => error.call(),
            _ => None,
        }
    }

    /// What happened, with its causes, in one line. Violations are listed separately.
    fn message(&self) -> String {
        match self {
            Self::Client(error) => match error.call() {
                Some(call) if call.attempts > 1 => {
                    format!("{} (tried {} times)", call.message, call.attempts)
                }
                Some(call) => call.message.clone(),
                None => with_causes(error),
            },
            Self::Usage(message) => message.clone(),
            Self::Output(error) => format!("cannot write to standard output: {error}"),
            Self::Other(what, why) => format!("{what}: {}", with_causes(why.as_ref())),
            Self::Interrupted => "interrupted".to_owned(),
        }
    }

    /// Reports the failure on standard error and returns the exit code.
    pub(crate) fn report(&self, as_json: bool) -> ExitCode {
        let code = self.exit_code();
        if code != 0 {
            let line = if as_json {
                self.to_json().to_string()
            } else {
                self.to_text()
            };
            // Standard error may be closed.
            let _ = writeln!(io::stderr().lock(), "{line}");
        }
        ExitCode::from(code)
    }

    fn to_text(&self) -> String {
        let message = self.message();
        let Some(call) = self.call() else {
            return format!("error: {message}");
        };
        // A message that contains the first violation would repeat the list below it.
        let violations = &call.details.field_violations;
        let first = violations.first();
        let repeats = first.is_some_and(|first| message.contains(&first.description));
        let mut lines = vec![match violations.len() {
            1 if repeats => "error: the request has 1 field wrong".to_owned(),
            count if repeats => format!("error: the request has {count} fields wrong"),
            _ => format!("error: {message}"),
        }];
        for FieldViolation { field, description } in violations {
            lines.push(format!("{field}: {description}"));
        }
        if let Some(resource) = &call.details.resource
            && !call.message.contains(&resource.name)
        {
            let (kind, name) = (&resource.kind, &resource.name);
            lines.push(format!("{kind} {name}: {}", resource.description));
        }
        let delay = call.details.retry_delay;
        lines.extend(delay.map(|delay| format!("try again in {delay:?}")));
        lines.join("\n  ")
    }

    /// `{"error": {"kind", "message"}}`; errors of calls also have `code`, `attempts`, `reason`, `metadata`,
    /// `field_violations`, `resource` and `retry_delay_seconds`.
    fn to_json(&self) -> Value {
        let mut error = json!({ "kind": self.kind(), "message": self.message() });
        if let Some(call) = self.call() {
            error["code"] = json!(code_name(call.code));
            error["attempts"] = json!(call.attempts);
            error["reason"] = json!(call.details.reason);
            error["metadata"] = json!(call.details.metadata);
            error["field_violations"] = json!(call.details.field_violations);
            error["resource"] = json!(call.details.resource);
            error["retry_delay_seconds"] = json!(call.details.retry_delay.map(|delay| delay.as_secs_f64()));
        }
        json!({ "error": error })
    }
}

/// Reports an invalid command line, or prints help or version.
pub(crate) fn report_usage(error: &clap::Error) -> ExitCode {
    let wants_json = std::env::args_os().any(|argument| argument == "--json");
    if error.use_stderr() && wants_json {
        let message = error.to_string();
        // The first paragraph says what is wrong; usage and hints follow.
        let what = message.split("\n\n").next().unwrap_or_default();
        let what = what.strip_prefix("error: ").unwrap_or(what).trim_end();
        return Failure::Usage(what.to_owned()).report(true);
    }
    // A closed pipe is not an error here.
    let _ = error.print();
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2))
}

/// An error and its causes, separated by colons; causes that repeat the error before are left out.
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
