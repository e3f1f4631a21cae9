//! Progress on the terminal: a bar where there is one, plain lines elsewhere. Also takes the time
//! of each stage and turns Ctrl-C into a cancellation.

use indicatif::{ProgressBar, ProgressStyle};
use puffer_core::Progress;
use std::io::IsTerminal;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Steps of the bar: a tenth of a per cent each.
const BAR_STEPS: f64 = 1000.0;

/// Watches a long operation.
pub(crate) struct TerminalProgress {
    state: Arc<Mutex<StageTimes>>,
    progress: Progress,
}

struct StageTimes {
    stage: String,
    since: Instant,
    times: Vec<(String, Duration)>,
    bar: Option<ProgressBar>,
}

impl TerminalProgress {
    /// Starts watching; stops the operation on Ctrl-C.
    pub(crate) fn start() -> TerminalProgress {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(BAR_STEPS as u64);
            let style =
                ProgressStyle::with_template("{msg:>12} [{bar:40}] {percent:>3} %  {elapsed}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        let state =
            StageTimes { stage: String::new(), since: Instant::now(), times: Vec::new(), bar };
        let state = Arc::new(Mutex::new(state));
        let shared = Arc::clone(&state);
        let progress =
            Progress::with_listener(move |stage, fraction| lock(&shared).update(stage, fraction));
        let cancelled = progress.clone();
        // A second watch in one process (tests) keeps the first one's handler: Ctrl-C still ends
        // the process.
        let _ = ctrlc::set_handler(move || {
            eprintln!("puffer: interrupted, stopping");
            cancelled.cancel();
        });
        TerminalProgress { state, progress }
    }

    /// What the operation reports to.
    pub(crate) fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Ends watching; the time that each stage took, in their order.
    pub(crate) fn finish(self) -> Vec<(String, Duration)> {
        let mut state = lock(&self.state);
        state.end_stage();
        if let Some(bar) = &state.bar {
            bar.finish_and_clear();
        }
        std::mem::take(&mut state.times)
    }
}

impl StageTimes {
    fn update(&mut self, stage: &str, fraction: f64) {
        if stage != self.stage {
            self.end_stage();
            self.stage = stage.to_owned();
            self.since = Instant::now();
            match &self.bar {
                Some(bar) => bar.set_message(stage.to_owned()),
                None => eprintln!("{stage} ..."),
            }
        }
        if let Some(bar) = &self.bar {
            bar.set_position((fraction * BAR_STEPS) as u64);
        }
    }

    fn end_stage(&mut self) {
        if self.stage.is_empty() {
            return;
        }
        let took = self.since.elapsed();
        match self.times.iter_mut().find(|(stage, _)| *stage == self.stage) {
            Some((_, time)) => *time += took,
            None => self.times.push((self.stage.clone(), took)),
        }
        if self.bar.is_none() {
            eprintln!("{} took {:.1} s", self.stage, took.as_secs_f64());
        }
    }
}

fn lock(state: &Mutex<StageTimes>) -> std::sync::MutexGuard<'_, StageTimes> {
    // A panic elsewhere does not make the times wrong.
    state.lock().unwrap_or_else(PoisonError::into_inner)
}
