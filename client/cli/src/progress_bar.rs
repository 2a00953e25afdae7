//! The look of progress bars; hidden where standard error is no terminal, and gone when their command ends, however it
//! ends.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

/// How often a bar is drawn anew while a step takes long, so that it is seen to live.
const TICK: Duration = Duration::from_millis(100);

/// A bar of so many steps; `counts` is how the template of `indicatif` shows where it is.
pub(crate) fn bar(steps: u64, counts: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!("{{bar:32}} {counts} {{elapsed:>4}} {{msg}}"))
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(steps)
        .with_style(style)
        .with_finish(ProgressFinish::AndClear);
    bar.enable_steady_tick(TICK);
    bar
}
