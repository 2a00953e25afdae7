//! The style of progress bars: hidden unless standard error is a terminal, and removed when the command ends for any
//! reason.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

/// Interval at which a bar is redrawn during long steps.
const TICK: Duration = Duration::from_millis(100);

/// A bar of `steps` steps; `counts` is the part of `indicatif`'s template that shows the position.
pub(crate) fn bar(steps: u64, counts: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!("{{bar:32}} {counts} {{elapsed:>4}} {{msg}}"))
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(steps)
        .with_style(style)
        .with_finish(ProgressFinish::AndClear);
    bar.enable_steady_tick(TICK);
    bar
}
