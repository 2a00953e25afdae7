//! Progress bars of benches.

use std::{borrow::Cow, time::Duration};

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

/// A progress bar; hidden unless standard error is a terminal, cleared when dropped.
pub fn bar(steps: usize, message: impl Into<Cow<'static, str>>) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:32} {pos:>5}/{len} {elapsed:>4} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(steps as u64)
        .with_style(style)
        .with_message(message)
        .with_finish(ProgressFinish::AndClear);
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}
