//! How a campaign goes, on a terminal as bars and in a log as lines.

use std::io::IsTerminal;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::board::{Board, Progress, lock};
use super::estimate::duration;

/// The whole campaign's bar and a line for every lane that has something to do.
pub struct Show {
    all: MultiProgress,
    total: ProgressBar,
    lines: Vec<ProgressBar>,
    boards: Vec<Board>,
    titles: Mutex<Vec<String>>,
    reckoning: Mutex<Reckoning>,
    is_terminal: bool,
}

struct Reckoning {
    begun: Instant,
    /// Simulated seconds in finished attempts of this run.
    simulated: f64,
    /// Simulated seconds still expected.
    left: f64,
}

impl Show {
    /// Shows a campaign with `done` of `total` episodes and `left` simulated
    /// seconds to go.
    #[must_use]
    pub fn new(lanes: usize, done: usize, total: usize, left: f64) -> Self {
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
            lines: (0..lanes).map(line).collect(),
            boards: (0..lanes).map(|_| Arc::default()).collect(),
            titles: Mutex::new(vec![String::new(); lanes]),
            reckoning: Mutex::new(Reckoning {
                begun: Instant::now(),
                simulated: 0.0,
                left,
            }),
            all,
            total,
            is_terminal,
        }
    }

    /// Where a lane tells how it goes.
    #[must_use]
    pub fn board(&self, lane: usize) -> Board {
        self.boards.get(lane).cloned().unwrap_or_default()
    }

    /// A lane begins something; an empty title is nothing.
    pub fn begin(&self, lane: usize, title: String) {
        *lock(&self.board(lane)) = Progress::default();
        if let Some(mine) = lock(&self.titles).get_mut(lane) {
            *mine = title;
        }
    }

    /// A lane's attempt is over after `seconds` simulated; `done` when its
    /// episode is in the dataset, which takes `expected` off what is left.
    pub fn end(&self, lane: usize, seconds: f64, expected: f64, done: bool, words: &str) {
        self.begin(lane, String::new());
        {
            let mut reckoning = lock(&self.reckoning);
            reckoning.simulated += seconds;
            if done {
                reckoning.left = (reckoning.left - expected).max(0.0);
            }
        }
        if done {
            self.total.inc(1);
        }
        self.say(&format!("{words}; {}", self.rate()));
    }

    /// A line for people.
    pub fn say(&self, words: &str) {
        if self.is_terminal {
            // A terminal that has gone shows nothing.
            let _ = self.all.println(words);
        } else {
            println!("{words}");
        }
    }

    /// Rate and time left.
    fn rate(&self) -> String {
        let reckoning = lock(&self.reckoning);
        let running: f64 = self.boards.iter().map(|board| lock(board).seconds).sum();
        let wall = reckoning.begun.elapsed().as_secs_f64().max(1e-3);
        let factor = (reckoning.simulated + running) / wall;
        if factor < 1e-3 {
            return "no rate yet".to_owned();
        }
        format!(
            "{factor:.2}x real time, {} left",
            duration((reckoning.left - running).max(0.0) / factor)
        )
    }

    /// Draws until `finished`.
    pub fn draw_until(&self, mut finished: impl FnMut() -> bool) {
        while !finished() {
            if self.is_terminal {
                self.total.set_message(self.rate());
                let titles = lock(&self.titles).clone();
                for ((line, board), title) in self.lines.iter().zip(&self.boards).zip(titles) {
                    if title.is_empty() {
                        if !line.is_finished() {
                            line.finish_and_clear();
                        }
                        continue;
                    }
                    if line.is_finished() {
                        line.reset();
                    }
                    let progress = lock(board).clone();
                    line.set_message(format!(
                        "{title}: {:6.1} s simulated, {}",
                        progress.seconds, progress.doing
                    ));
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
