//! Printed result of a demo.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use wheelarm_proto::{StreamId, v1};

use crate::control::evaluation_lines;
use wheelarm_rollout::Finished;

/// Result of one episode.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Seed of the scenario.
    pub seed: u64,
    /// Result of the driver and of the task.
    pub finished: Finished,
    /// Status of the recorder.
    pub recorded: v1::RecorderStatus,
    /// Graphics adapter.
    pub adapter: String,
    /// Time from the start of the server to the recorder's first image, s, with the
    /// resolution of one status request per second.
    pub first_image: Option<Duration>,
    /// Time from the start of the server to the finished file.
    pub wall: Duration,
    /// Path of the contact sheet, if it was rendered.
    pub sheet: Option<PathBuf>,
}

impl Summary {
    /// The task succeeded and the recording is complete.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.finished.succeeded() && self.recorded.complete && self.recorded.missed == 0
    }

    /// Reason why it is not good.
    #[must_use]
    pub fn problem(&self) -> String {
        self.finished.why().unwrap_or_else(|| {
            format!(
                "{} samples are missing {}",
                self.recorded.missed, self.recorded.message
            )
        })
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let simulated = self.finished.seconds().max(1e-9);
        writeln!(
            f,
            "seed {}: {:?}",
            self.seed, self.finished.started.instruction
        )?;
        if !self.is_good() {
            writeln!(f, "  NOT GOOD: {}", self.problem())?;
        }
        f.write_str(&evaluation_lines(&self.finished.evaluation))?;
        let stopped = &self.finished.stopped;
        let mut images = 0;
        for stream in &stopped.manifest {
            if StreamId::parse(&stream.stream).is_camera() {
                images += stream.count;
            }
            writeln!(
                f,
                "  {:>7} {:<20} {:7.2} per simulated s",
                stream.count,
                stream.stream,
                stream.count as f64 / simulated
            )?;
        }
        let wall = stopped.wall_seconds.max(1e-9);
        writeln!(
            f,
            "  images      {images}, each color, depth and segmentation, {:.1} per wall second on {}",
            images as f64 / wall,
            if self.adapter.is_empty() {
                "no adapter"
            } else {
                &self.adapter
            }
        )?;
        writeln!(
            f,
            "  missed      {} ({})",
            self.recorded.missed,
            if self.recorded.complete {
                "complete"
            } else {
                "NOT complete"
            }
        )?;
        let bytes = std::fs::metadata(&self.recorded.path).map_or(0, |m| m.len());
        writeln!(
            f,
            "  file        {} ({:.1} MB)",
            self.recorded.path,
            bytes as f64 * 1e-6
        )?;
        if let Some(sheet) = &self.sheet {
            writeln!(f, "  sheet       {}", sheet.display())?;
        }
        writeln!(
            f,
            "  time        {simulated:.1} s simulated in {wall:.1} s ({:.2}x real time), {:.1} s with start and file{}",
            simulated / wall,
            self.wall.as_secs_f64(),
            self.first_image
                .map(|first| format!(", first image after {:.1} s", first.as_secs_f64()))
                .unwrap_or_default()
        )
    }
}
