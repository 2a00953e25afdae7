//! Errors of calls.

mod status;

use std::time::Duration;

use grasp_proto::v1::ErrorReason;
use grasp_synthesis::base::stop::Stopped;

pub(crate) use status::blame_client;
use status::{MAX_SUMMARY, clipped_message};

/// One violation of the contract by a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Violation {
    /// Path of the field, as in `holdout.presenting_hand.pose.index.base_pitch`.
    pub field: String,
    /// The value, and the form of a valid one.
    pub description: String,
    /// Further violations after this one that are only counted.
    pub unlisted: usize,
}

impl Violation {
    /// A violation after which none is only counted.
    pub(crate) fn new(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            description: description.into(),
            unlisted: 0,
        }
    }
}

/// The number of violations, with those that are only counted.
fn count(violations: &[Violation]) -> usize {
    violations.iter().map(|violation| 1 + violation.unlisted).sum()
}

/// A limit that was reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Limit {
    /// Running and waiting searches.
    Searches,
    /// Objects being received, built or changed.
    Uploads,
    /// Created objects, all of which are in use.
    ObjectCache,
    /// Bytes of answers that wait on a connection.
    UnreadAnswers,
    /// Bytes of meshes that are uploaded in pieces.
    UploadBytes,
    /// Watchers of objects.
    Watchers,
    /// Tracks of moving givers.
    Tracks,
    /// Calls of a connection that have not been answered.
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

/// Why a call failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum ServiceError {
    /// The request violates the contract; with all violations.
    #[error("{}", summary(.0))]
    Invalid(Vec<Violation>),
    /// The request is no message of the contract.
    #[error("the request is not a valid message: {0}")]
    Malformed(String),
    /// No object has the name.
    #[error("{name} does not exist{}", if *.evicted { ": it was evicted from the cache; create it again" } else { "" })]
    ObjectNotFound {
        name: String,
        /// True if it existed.
        evicted: bool,
    },
    /// An object with the name exists.
    #[error("{name} already exists; choose another name")]
    ObjectExists { name: String },
    /// A request with the same id and other content created an object.
    #[error("request_id {request_id} created {name} from other content; a new request needs a new id")]
    RequestIdReused { request_id: String, name: String },
    /// The object came with the server.
    #[error(
        "{name} came with the server, which neither changes nor deletes it; create an object of your own"
    )]
    ObjectReadOnly { name: String },
    /// The object is not in the state that the request is about.
    #[error("{name} was changed: its etag is {current:?}, not {etag:?}; get it, and decide again")]
    ObjectChanged {
        name: String,
        etag: String,
        current: String,
    },
    /// No rig has the name.
    #[error("{name} does not exist")]
    RigNotFound { name: String },
    /// A rig with the name exists.
    #[error("{name} already exists; choose another rig_id")]
    RigExists { name: String },
    /// A built-in rig cannot be deleted.
    #[error("{name} is built in and cannot be deleted")]
    RigBuiltIn { name: String },
    /// The record of a rig is damaged.
    #[error(
        "what was saved of {name} is damaged or missing; put the file back, or delete the rig and create it again"
    )]
    RigDamaged { name: String },
    /// There are as many created rigs as the server keeps.
    #[error("the server keeps at most {maximum} created rigs; delete one first")]
    RigsFull { maximum: usize },
    /// As many created objects are saved as the server keeps.
    #[error("the server keeps at most {maximum} created objects; delete one first")]
    ObjectsFull { maximum: usize },
    /// The record of an object is damaged.
    #[error(
        "what was saved of {name} is damaged or missing; put the file back, or delete the object and create it again"
    )]
    ObjectDamaged { name: String },
    /// A saved object is beyond the limits of this server.
    #[error("{name} was saved, but this server cannot load it: {reason}; raise its limits")]
    ObjectUnloadable { name: String, reason: String },
    /// Created objects cannot be written or read where they are saved. The server's log says why.
    #[error("the server cannot reach the place where it saves objects; its log says why")]
    StoreFailed,
    /// The server is at one of its limits.
    #[error("{} ({maximum}); try again", .limit.text_and_reason().0)]
    Overloaded {
        limit: Limit,
        maximum: usize,
        retry_after: Duration,
    },
    /// A message is larger than its method takes.
    #[error("the message has more than {limit} bytes, the limit of this method")]
    MessageTooLarge { limit: usize },
    /// A client took none of the messages that wait for it.
    #[error("the client took no message for {} s", limit.as_secs())]
    ReaderStalled { limit: Duration },
    /// A client sent nothing of its upload.
    #[error("nothing arrived for {} ms; send the parts of an upload without pauses", limit.as_millis())]
    UploadStalled { limit: Duration },
    /// A client uploads too slowly.
    #[error("the upload arrives at less than {least} bytes per second; send it faster, or a smaller mesh")]
    UploadTooSlow { least: usize },
    /// No track has the name.
    #[error("{name} does not exist: a track ends with DeleteTrack, or without frames for too long")]
    TrackNotFound { name: String },
    /// A client sent no frame of its track.
    #[error("no frame arrived for {} ms", limit.as_millis())]
    TrackIdle { limit: Duration },
    /// The call took longer than the server allows.
    #[error("the call took more than {} s, the server's limit", limit.as_secs())]
    TookTooLong { limit: Duration },
    /// Too many objects have yet to be reported to a watcher.
    #[error("the watcher reads too slowly: it is too many objects behind; watch again")]
    WatcherTooSlow,
    /// The server shuts down.
    #[error("the server shuts down; call again")]
    ShuttingDown,
    /// The call's deadline passed before a search could start or an object was built.
    #[error("the deadline passed before the work was done")]
    DeadlineExceeded,
    /// The work was stopped before its end.
    #[error("the call was cancelled")]
    Cancelled,
    /// A job panicked. The server's log contains the panic.
    #[error("the server failed on this call; its log says why")]
    Panicked,
}

impl ServiceError {
    /// The error of a request with a single violation.
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
