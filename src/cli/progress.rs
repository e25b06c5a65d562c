//! How far a reconstruction is: a bar on a terminal, a line for each stage elsewhere. On standard
//! error, so that standard output holds results alone.

use std::io::IsTerminal as _;
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};

use crate::observer::{Observer, Stage};
use crate::pipeline::Profile;

/// Steps of the bar.
const STEPS: f64 = 1000.0;

/// Watches one reconstruction.
pub(super) struct Progress {
    bar: Option<ProgressBar>,
    /// Those that come.
    expected: &'static [Stage],
    stages: Mutex<Stages>,
}

#[derive(Default)]
struct Stages {
    /// The furthest stage that has begun.
    current: Option<Stage>,
    /// What is done of each.
    done: [f64; Stage::ALL.len()],
}

impl Progress {
    /// A bar if standard error is a terminal.
    pub(super) fn new(profile: Profile) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let bar = ProgressBar::new(STEPS as u64);
            bar.with_style(style())
        });
        Self { bar, expected: profile.stages(), stages: Mutex::default() }
    }

    /// Takes the bar away.
    pub(super) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn style() -> ProgressStyle {
    ProgressStyle::with_template("{prefix:12} [{bar:40}] {percent:>3} %  {elapsed}")
        .expect("the template is valid")
        .progress_chars("=> ")
}

impl Observer for Progress {
    fn progress(&self, stage: Stage, fraction: f64) {
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        let begun = stages.current < Some(stage);
        if begun {
            stages.current = Some(stage);
        }
        let done = &mut stages.done[stage as usize];
        *done = done.max(fraction.clamp(0.0, 1.0));
        #[expect(clippy::cast_precision_loss)]
        let whole = self.expected.iter().map(|&stage| stages.done[stage as usize]).sum::<f64>()
            / self.expected.len() as f64;
        match &self.bar {
            Some(bar) => {
                if begun {
                    bar.set_prefix(stage.name());
                }
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                bar.set_position((whole * STEPS) as u64);
            }
            None if begun => super::output::tell(stage.name()),
            None => {}
        }
    }
}
