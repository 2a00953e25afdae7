//! The progress bar of a run.

use std::time::{Duration, Instant};

use grasp_experiment::{atlases::AtlasProgress, run};
use indicatif::{HumanDuration, ProgressBar};

use crate::progress_bar::bar;

/// Shortest time between messages: thousands of grasps may be found per second.
const MESSAGE_INTERVAL: Duration = Duration::from_millis(50);

/// How bars show their position.
const COUNTS: &str = "{human_pos:>6}/{human_len}";

/// A bar for each atlas to grow, then one that counts valid grasps.
#[derive(Debug, Default)]
pub(super) struct RunProgress {
    atlas: Option<(&'static str, ProgressBar)>,
    bar: Option<ProgressBar>,
    last_message: Option<Instant>,
}

impl RunProgress {
    /// Shows the progress of an atlas.
    pub(super) fn grow(&mut self, now: &AtlasProgress) {
        let shown = self.atlas.as_ref().map(|(object, _)| *object);
        if shown != Some(now.object) {
            self.atlas = Some((now.object, bar(now.total, COUNTS)));
        }
        if let Some((_, bar)) = &self.atlas {
            let why = now
                .rejected
                .map(|why| format!("; the one in the folder is unusable: {why}"));
            let why = why.unwrap_or_default();
            bar.set_position(now.proposed);
            bar.set_message(format!("atlas of {}, {} grips{why}", now.object, now.entries));
        }
    }

    /// Shows the progress of the run.
    pub(super) fn show(&mut self, now: &run::Progress) {
        self.atlas = None;
        let bar = self.bar.get_or_insert_with(|| bar(now.total, COUNTS));
        let last = self.last_message;
        let is_due = last.is_none_or(|last| last.elapsed() >= MESSAGE_INTERVAL);
        if !is_due && now.done < now.total {
            return;
        }
        self.last_message = Some(Instant::now());
        bar.set_position(now.done);
        let threads = match now.cell.threads {
            1 => "1 thread".to_owned(),
            threads => format!("{threads} threads"),
        };
        let left = now
            .left
            .map(|left| format!(", about {} left", HumanDuration(left)));
        let (set, holdout) = (now.cell.set.name(), &now.cell.built_in().name);
        let left = left.unwrap_or_default();
        bar.set_message(format!("set {set} on {holdout}, {threads}{left}"));
    }

    /// Announces the report.
    pub(super) fn report(&self) {
        if let Some(bar) = &self.bar {
            bar.set_message("writing the report");
        }
    }
}
