//! Ends long work early when nobody waits for its result.

/// Work was stopped before its end; there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the work was stopped")]
pub struct Stopped;

/// Stop signal of a computation. Long loops poll it at least every few milliseconds.
#[derive(Clone, Copy)]
pub struct Stop<'a>(Option<&'a (dyn Fn() -> bool + Sync)>);

impl std::fmt::Debug for Stop<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stop").finish_non_exhaustive()
    }
}

impl<'a> Stop<'a> {
    /// Nothing stops the work.
    pub const NEVER: Stop<'static> = Stop(None);

    /// The work stops once `is_over` returns true; it must not return false again.
    pub fn when(is_over: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self(Some(is_over))
    }

    /// Ends the work if it should.
    ///
    /// # Errors
    /// [`Stopped`].
    #[inline]
    pub fn check(self) -> Result<(), Stopped> {
        match self.0 {
            Some(is_over) if is_over() => Err(Stopped),
            _ => Ok(()),
        }
    }

    /// True if the work should end.
    #[inline]
    pub fn is_over(self) -> bool {
        self.check().is_err()
    }

    /// As [`Self::check`], but polls only once in `period` steps of a loop.
    ///
    /// # Errors
    /// [`Stopped`].
    #[inline]
    pub fn check_every(self, period: usize, step: usize) -> Result<(), Stopped> {
        if step.is_multiple_of(period) {
            self.check()
        } else {
            Ok(())
        }
    }
}

/// The result of work that nothing stops.
pub fn unstopped<T>(work: impl FnOnce(Stop<'static>) -> Result<T, Stopped>) -> T {
    match work(Stop::NEVER) {
        Ok(result) => result,
        Err(Stopped) => unreachable!("only a check that says so stops work"),
    }
}
