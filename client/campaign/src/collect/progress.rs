//! Progress of a campaign: bars on a terminal, lines in a log.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use parking_lot::Mutex;

use super::activity::Activity;
use super::estimate::duration;

/// The bar of the campaign and a line for every busy pipeline.
pub struct ProgressView {
    all: MultiProgress,
    total: ProgressBar,
    lines: Vec<ProgressBar>,
    activities: Vec<Activity>,
    titles: Mutex<Vec<String>>,
    forecast: Mutex<Forecast>,
    is_terminal: bool,
}

struct Forecast {
    begun: Instant,
    /// Simulated seconds in finished attempts of this run.
    simulated: f64,
    /// Simulated seconds still expected.
    left: f64,
}

impl ProgressView {
    /// Shows a campaign with `done` of `total` episodes and `left` simulated
    /// seconds to go.
    #[must_use]
    pub fn new(pipelines: usize, done: usize, total: usize, left: f64) -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let target = if is_terminal {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let all = MultiProgress::with_draw_target(target);
        let bar = ProgressBar::new(total as u64).with_position(done as u64);
        let total = all.add(bar);
        if let Ok(style) =
            ProgressStyle::with_template("{elapsed_precise} [{bar:30}] {pos}/{len} episodes, {msg}")
        {
            total.set_style(style.progress_chars("=> "));
        }
        let line = |_| {
            let line = all.add(ProgressBar::new_spinner());
            if let Ok(style) = ProgressStyle::with_template("  {spinner} {msg}") {
                line.set_style(style);
            }
            line
        };
        Self {
            lines: (0..pipelines).map(line).collect(),
            activities: (0..pipelines).map(|_| Activity::default()).collect(),
            titles: Mutex::new(vec![String::new(); pipelines]),
            forecast: Mutex::new(Forecast {
                begun: Instant::now(),
                simulated: 0.0,
                left,
            }),
            all,
            total,
            is_terminal,
        }
    }

    /// The activity that a pipeline reports to.
    #[must_use]
    pub fn activity(&self, pipeline: usize) -> Activity {
        self.activities.get(pipeline).cloned().unwrap_or_default()
    }

    /// Sets the title of a pipeline; an empty title hides its line.
    pub fn begin(&self, pipeline: usize, title: String) {
        self.activity(pipeline).reset();
        if let Some(mine) = self.titles.lock().get_mut(pipeline) {
            *mine = title;
        }
    }

    /// A pipeline's attempt is over after `seconds` simulated; `done` when its
    /// episode is in the dataset, which reduces the remaining time by `expected`.
    pub fn end(&self, pipeline: usize, seconds: f64, expected: f64, done: bool, words: &str) {
        self.begin(pipeline, String::new());
        {
            let mut forecast = self.forecast.lock();
            forecast.simulated += seconds;
            if done {
                forecast.left = (forecast.left - expected).max(0.0);
            }
        }
        if done {
            self.total.inc(1);
        }
        self.print_line(&format!("{words}; {}", self.rate()));
    }

    /// Prints a line.
    pub fn print_line(&self, words: &str) {
        if self.is_terminal {
            // A closed terminal is ignored.
            let _ = self.all.println(words);
        } else {
            println!("{words}");
        }
    }

    /// Rate and time left.
    fn rate(&self) -> String {
        let forecast = self.forecast.lock();
        let running: f64 = self.activities.iter().map(Activity::seconds).sum();
        let wall = forecast.begun.elapsed().as_secs_f64().max(1e-3);
        let factor = (forecast.simulated + running) / wall;
        if factor < 1e-3 {
            return "no rate yet".to_owned();
        }
        format!(
            "{factor:.2}x real time, {} left",
            duration((forecast.left - running).max(0.0) / factor)
        )
    }

    /// Shows the progress until `finished`.
    pub fn show_until(&self, mut finished: impl FnMut() -> bool) {
        while !finished() {
            if self.is_terminal {
                self.total.set_message(self.rate());
                let titles = self.titles.lock().clone();
                let lines = self.lines.iter().zip(&self.activities);
                for ((line, activity), title) in lines.zip(titles) {
                    if title.is_empty() {
                        if !line.is_finished() {
                            line.finish_and_clear();
                        }
                        continue;
                    }
                    if line.is_finished() {
                        line.reset();
                    }
                    line.set_message(format!("{title}: {}", activity.line()));
                    line.tick();
                }
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        for line in &self.lines {
            line.finish_and_clear();
        }
        self.total.finish_and_clear();
    }
}
