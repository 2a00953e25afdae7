//! Errors of calls.

mod listing;
mod request_info;
mod status;

use std::time::Duration;

use grasp_proto::v1::ErrorReason;
use grasp_synthesis::base::stop::Stopped;

pub(crate) use request_info::add_request_id;
pub(crate) use status::{CHALLENGE, blame_client};
use status::{MAX_SUMMARY, clipped_message};

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Violation {
    /// Path of the field, as in `holdout.presenting_hand.pose.index.base_pitch`.
    pub field: String,
    pub description: String,
    /// Further violations after this one that are only counted.
    pub unlisted: usize,
}

impl Violation {
    pub(crate) fn new(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            description: description.into(),
            unlisted: 0,
        }
    }
}

/// The number of violations, listed and unlisted.
fn count(violations: &[Violation]) -> usize {
    violations.iter().map(|violation| 1 + violation.unlisted).sum()
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Limit {
    Searches,
    Uploads,
    /// Created objects, all of which are in use.
    ObjectCache,
    UnreadAnswers,
    UploadBytes,
    Watchers,
    Tracks,
    /// Calls that read or delete.
    Reads,
    Calls,
}

impl Limit {
    /// The text of an error about it, and its reason.
    const fn text_and_reason(self) -> (&'static str, ErrorReason) {
        use ErrorReason as R;
        match self {
            Self::Searches => (
                "the server is at its limit of concurrent searches",
                R::TooManySearches,
            ),
            Self::Uploads => (
                "the server is at its limit of concurrent uploads",
                R::TooManyUploads,
            ),
            Self::ObjectCache => ("every object in the full cache is in use", R::ObjectCacheFull),
            Self::UploadBytes => (
                "the uploads that run leave too little of the bytes that they share",
                R::TooManyUploadBytes,
            ),
            Self::Watchers => ("the server is at its limit of watchers", R::TooManyWatchers),
            Self::Tracks => ("the server is at its limit of tracks", R::TooManyTracks),
            Self::Reads => (
                "the server is at its limit of calls that read or delete",
                R::TooManyReads,
            ),
            Self::Calls => (
                "this connection is at its limit of concurrent calls",
                R::TooManyCalls,
            ),
            Self::UnreadAnswers => (
                "this connection is at its limit of bytes that wait for the client to read them",
                R::TooManyUnreadAnswers,
            ),
        }
    }
}

/// A quota of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quota {
    CallsPerSecond,
    Searches,
    Objects,
    Bytes,
}

impl Quota {
    /// Its key in the file of tokens.
    pub(crate) const fn key(self) -> &'static str {
        match self {
            Self::CallsPerSecond => "calls_per_second",
            Self::Searches => "searches",
            Self::Objects => "objects",
            Self::Bytes => "bytes",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum ServiceError {
    #[error("{}", summary(.0))]
    Invalid(Vec<Violation>),
    #[error("the request is not a valid message: {0}")]
    Malformed(String),
    #[error("{name} does not exist{}", if *.evicted { ": it was evicted from the cache; create it again" } else { "" })]
    ObjectNotFound { name: String, evicted: bool },
    #[error("{name} already exists; choose another name")]
    ObjectExists { name: String },
    #[error("request_id {request_id} created {name} from other content; a new request needs a new id")]
    RequestIdReused { request_id: String, name: String },
    #[error(
        "{name} came with the server, which neither changes nor deletes it; create an object of your own"
    )]
    ObjectReadOnly { name: String },
    #[error("{name} was changed: its etag is {current:?}, not {etag:?}; get it, and decide again")]
    ObjectChanged {
        name: String,
        etag: String,
        current: String,
    },
    #[error("{name} does not exist")]
    RigNotFound { name: String },
    #[error("{name} already exists; choose another rig_id")]
    RigExists { name: String },
    #[error("{name} is built in and cannot be deleted")]
    RigBuiltIn { name: String },
    #[error(
        "what was saved of {name} is damaged or missing; put the file back, or delete the rig and create it again"
    )]
    RigDamaged { name: String },
    #[error("the server keeps at most {maximum} created rigs; delete one first")]
    RigsFull { maximum: usize },
    #[error(
        "this client has {held} of the {maximum} created rigs that the server keeps, its share; delete one first"
    )]
    RigShareFull { held: usize, maximum: usize },
    #[error("the server keeps at most {maximum} created objects; delete one first")]
    ObjectsFull { maximum: usize },
    #[error(
        "what was saved of {name} is damaged or missing; put the file back, or delete the object and create it again"
    )]
    ObjectDamaged { name: String },
    #[error("{name} was saved, but this server cannot load it: {reason}; raise its limits")]
    ObjectUnloadable { name: String, reason: String },
    #[error("the server cannot reach the place where it saves objects; its log says why")]
    StoreFailed,
    #[error("{} ({maximum}); try again", .limit.text_and_reason().0)]
    Overloaded {
        limit: Limit,
        maximum: usize,
        retry_after: Duration,
    },
    #[error("searches that wait leave too little time before the deadline; try again")]
    WouldMissDeadline {
        /// The time until this call would have been answered.
        expected: Duration,
    },
    #[error("the message has more than {limit} bytes, the limit of this method")]
    MessageTooLarge { limit: usize },
    #[error("the client took no message for {} s", limit.as_secs())]
    ReaderStalled { limit: Duration },
    #[error("nothing arrived for {} ms; send the parts of an upload without pauses", limit.as_millis())]
    UploadStalled { limit: Duration },
    #[error("the upload arrives at less than {least} bytes per second; send it faster, or a smaller mesh")]
    UploadTooSlow { least: usize },
    #[error("{name} does not exist: a track ends with DeleteTrack, or without frames for too long")]
    TrackNotFound { name: String },
    #[error("no frame arrived for {} ms", limit.as_millis())]
    TrackIdle { limit: Duration },
    #[error("the call took more than {} s, the server's limit", limit.as_secs())]
    TookTooLong { limit: Duration },
    #[error("the watcher reads too slowly: it is too many objects behind; watch again")]
    WatcherTooSlow,
    #[error("the server wants a token in the header authorization: Bearer SECRET")]
    TokenMissing,
    #[error("the server does not know the token in the header authorization")]
    TokenUnknown,
    #[error("{client} may not make this call: it lacks the scope {scope}")]
    TokenLacksScope { client: String, scope: String },
    #[error("{name} belongs to {owner}: only that client may change, delete or feed it")]
    NotOwner { name: String, owner: String },
    #[error("this client is at its quota {} ({maximum})", .quota.key())]
    QuotaExceeded {
        quota: Quota,
        maximum: u64,
        /// When to try again. `None` if the client has to delete something first.
        retry_after: Option<Duration>,
    },
    #[error("the server shuts down; call again")]
    ShuttingDown,
    #[error("the deadline passed before the work was done")]
    DeadlineExceeded,
    #[error("the call was cancelled")]
    Cancelled,
    #[error("the server failed on this call; its log says why")]
    Panicked,
}

impl ServiceError {
    pub(crate) fn invalid(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self::Invalid(vec![Violation::new(field, description)])
    }

    /// The same error of a message that is the field of another one.
    #[must_use]
    pub(crate) fn within(self, field: &str) -> Self {
        let Self::Invalid(violations) = self else {
            return self;
        };
        let violations = violations.into_iter().map(|violation| Violation {
            field: format!("{field}.{}", violation.field),
            ..violation
        });
        Self::Invalid(violations.collect())
    }
}

impl From<Stopped> for ServiceError {
    fn from(Stopped: Stopped) -> Self {
        Self::Cancelled
    }
}

/// The first violation and the number of others, for the status message.
fn summary(violations: &[Violation]) -> String {
    let Some(first) = violations.first() else {
        return "the request is invalid".to_owned();
    };
    let shown = clipped_message(&format!("{}: {}", first.field, first.description), MAX_SUMMARY);
    match count(violations) - 1 {
        0 => shown,
        others => format!("{shown} (and {others} more)"),
    }
}
