//! The progress bar of the demo.

use indicatif::ProgressBar;

use crate::progress_bar::bar;

/// A bar with a message.
#[derive(Debug)]
pub(super) struct DemoProgress(ProgressBar);

impl DemoProgress {
    pub(super) fn new(steps: u64) -> Self {
        Self(bar(steps, "{pos:>2}/{len}"))
    }

    /// Starts the next step.
    pub(super) fn step(&self, message: &str) {
        self.0.set_message(message.to_owned());
        self.0.inc(1);
    }

    /// Removes the bar.
    pub(super) fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Drop for DemoProgress {
    fn drop(&mut self) {
        self.finish();
    }
}
