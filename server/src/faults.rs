//! Faults that tests inject: a closure that is called at named points of the work on a call, and may panic there.

use std::{
    fmt,
    sync::{Arc, OnceLock},
};

/// A point of the work on a call.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FaultPoint {
    /// The future of a call of any service.
    Handler,
    /// The thread that builds a new object.
    Build,
    /// The thread that waits for a search's workers.
    Coordinator,
    /// A worker that searches.
    Worker,
    /// The task that sends the messages of an answer.
    Stream,
    /// The body of an answer, when the transport takes a part of it.
    Body,
    /// The task that reads the frames of a track.
    Frames,
    /// The answer to a frame of a track.
    Frame,
}

type Hook = dyn Fn(FaultPoint) + Send + Sync;

/// Where tests inject faults; without a hook, nothing.
#[derive(Clone, Default)]
pub(crate) struct Faults(Arc<OnceLock<Box<Hook>>>);

impl Faults {
    /// Calls `hook` at every point from now on, unless there is a hook.
    pub(crate) fn set(&self, hook: Box<Hook>) {
        let _ = self.0.set(hook);
    }

    #[inline]
    pub(crate) fn at(&self, point: FaultPoint) {
        if let Some(hook) = self.0.get() {
            hook(point);
        }
    }
}

impl fmt::Debug for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Faults").finish_non_exhaustive()
    }
}
