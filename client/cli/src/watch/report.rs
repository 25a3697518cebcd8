//! One report of `wheelarm watch`: streams, episode, task, as text and JSON.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use wheelarm_proto::v1;

use super::meter::{Figures, Meter};
use crate::control::evaluation_lines;

/// A recorder that is connected.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recorder {
    /// Its name.
    pub name: String,
    /// `idle`, `ready`, `finished`, `failed` or `unknown`.
    pub state: &'static str,
    /// Images accepted in this episode (count).
    pub accepted_frames: u64,
    /// Samples lost in this episode (count).
    pub missed: u64,
    /// The finished file contains every published sample.
    pub complete: bool,
    /// Path of the finished file; empty before.
    pub path: String,
    /// Problem, as text; empty without one.
    pub message: String,
}

impl Recorder {
    /// From the server's status.
    #[must_use]
    pub fn new(status: &v1::RecorderStatus) -> Self {
        Self {
            name: status.recorder.clone(),
            state: match status.state() {
                v1::RecorderState::Unspecified => "unknown",
                v1::RecorderState::Idle => "idle",
                v1::RecorderState::Ready => "ready",
                v1::RecorderState::Finishing => "finishing its file",
                v1::RecorderState::Finished => "finished",
                v1::RecorderState::Failed => "failed",
            },
            accepted_frames: status.accepted_frames,
            missed: status.missed,
            complete: status.complete,
            path: status.path.clone(),
            message: status.message.clone(),
        }
    }
}

/// One condition of the task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Condition {
    /// Predicate with its arguments.
    pub name: String,
    /// It holds now.
    pub holds: bool,
    /// It is required for success.
    pub required: bool,
    /// The measured quantity, SI.
    pub value: f64,
}

/// State of the task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Task {
    /// Name; empty for none.
    pub name: String,
    /// All required conditions hold.
    pub success: bool,
    /// It is over.
    pub done: bool,
    /// Reason of the failure; empty otherwise.
    pub failure: String,
    /// Simulated seconds since it began, s.
    pub elapsed: f64,
    /// Its conditions.
    pub conditions: Vec<Condition>,
}

/// The running episode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Episode {
    /// Number within the server's run.
    pub number: u64,
    /// File label.
    pub label: String,
    /// Instruction sentence.
    pub instruction: String,
    /// Simulated seconds since it began, s.
    pub seconds: f64,
}

/// Everything at one moment.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Server name.
    pub sim: String,
    /// Server version.
    pub version: String,
    /// Simulation time, s.
    pub time: f64,
    /// Simulated seconds per wall second.
    pub factor: f64,
    /// Time is paused by command.
    pub paused: bool,
    /// Commander or recorder that the simulation waits for; empty when it does not wait.
    pub waiting_for: String,
    /// Commander that holds control; empty when control is free.
    pub holder: String,
    /// Commands refused since the start (count).
    pub refused: u64,
    /// Round trip of a query, s.
    pub round_trip: f64,
    /// The running episode.
    pub episode: Option<Episode>,
    /// State of the task.
    pub task: Task,
    /// Recorders that are connected.
    pub recorders: Vec<Recorder>,
    /// Figures by stream.
    pub streams: BTreeMap<String, Figures>,
    #[serde(skip)]
    evaluation: v1::Evaluation,
}

impl Report {
    /// Combines the server's status and the measurements until `now`, s.
    #[must_use]
    pub fn new(
        sim: &str,
        status: &v1::Status,
        round_trip: f64,
        meters: &BTreeMap<String, Meter>,
        now: f64,
    ) -> Self {
        let header = status.header.clone().unwrap_or_default();
        let evaluation = status.evaluation.clone().unwrap_or_default();
        let time = header.stamp_nanos as f64 * 1e-9;
        let factor = status.real_time_factor;
        Self {
            sim: sim.to_owned(),
            version: status.version.clone(),
            time,
            factor,
            paused: status.paused,
            waiting_for: status.waiting_for.clone(),
            holder: status.holder.clone(),
            refused: status.refused,
            round_trip,
            episode: status.episode.as_ref().map(|started| {
                let first = started.header.clone().unwrap_or_default();
                Episode {
                    number: first.episode,
                    label: started.label.clone(),
                    instruction: started.instruction.clone(),
                    seconds: header.stamp_nanos.saturating_sub(first.stamp_nanos) as f64 * 1e-9,
                }
            }),
            task: Task {
                name: status
                    .scenario
                    .as_ref()
                    .map(|s| s.task().to_owned())
                    .unwrap_or_default(),
                success: evaluation.success,
                done: evaluation.done,
                failure: evaluation.failure.clone(),
                elapsed: evaluation.elapsed_seconds,
                conditions: evaluation
                    .conditions
                    .iter()
                    .map(|c| Condition {
                        name: c.name.clone(),
                        holds: c.holds,
                        required: c.required,
                        value: c.value,
                    })
                    .collect(),
            },
            recorders: status.recorders.iter().map(Recorder::new).collect(),
            streams: meters
                .iter()
                .map(|(name, meter)| (name.clone(), meter.figures(now, factor)))
                .collect(),
            evaluation,
        }
    }
}

fn milliseconds(seconds: Option<f64>) -> String {
    seconds.map_or_else(|| "-".to_owned(), |s| format!("{:.1}", s * 1e3))
}

/// Bytes per second in a unit that fits.
#[must_use]
pub fn rate_of_bytes(rate: f64) -> String {
    if rate >= 1e6 {
        format!("{:.1} MB/s", rate * 1e-6)
    } else if rate < 1e3 {
        format!("{rate:.0} B/s")
    } else {
        format!("{:.1} kB/s", rate * 1e-3)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} (version {})  {:.2} s{}  {:.2} simulated s per s  round trip {:.1} ms  refused {}",
            self.sim,
            self.version,
            self.time,
            if self.paused { " paused" } else { "" },
            self.factor,
            self.round_trip * 1e3,
            self.refused
        )?;
        let holder = if self.holder.is_empty() {
            "none"
        } else {
            &self.holder
        };
        write!(f, "control     {holder}")?;
        if !self.waiting_for.is_empty() {
            write!(f, "   waits for {}", self.waiting_for)?;
        }
        writeln!(f)?;
        match &self.episode {
            Some(e) => writeln!(
                f,
                "episode     {} {:?} {:.1} s: {:?}",
                e.number, e.label, e.seconds, e.instruction
            )?,
            None => writeln!(f, "episode     none runs")?,
        }
        for r in &self.recorders {
            writeln!(
                f,
                "recorder    {} {}, {} frames, {} missed{}{}",
                r.name,
                r.state,
                r.accepted_frames,
                r.missed,
                if r.message.is_empty() { "" } else { ": " },
                r.message
            )?;
        }
        self.write_streams(f)?;
        if !self.task.name.is_empty() {
            write!(
                f,
                "\ntask {}\n{}",
                self.task.name,
                evaluation_lines(&self.evaluation)
            )?;
        }
        Ok(())
    }
}

impl Report {
    fn write_streams(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:<18}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>12}{:>8}",
            "stream", "Hz", "mean ms", "jitter", "max ms", "delay+", "max", "payload", "missed"
        )?;
        for (name, s) in &self.streams {
            let rate = s.rate_hz.map_or("-".to_owned(), |r| format!("{r:.1}"));
            writeln!(
                f,
                "{name:<18}{rate:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>12}{:>8}{}",
                milliseconds(s.interval_mean),
                milliseconds(s.jitter),
                milliseconds(s.interval_max),
                milliseconds(s.delay_mean),
                milliseconds(s.delay_max),
                s.bytes_per_second
                    .map_or_else(|| "-".to_owned(), rate_of_bytes),
                s.missed,
                match (s.disordered, s.unreadable) {
                    (0, 0) => String::new(),
                    (d, 0) => format!("  {d} out of order"),
                    (_, u) => format!("  {u} UNREADABLE: versions differ?"),
                }
            )?;
        }
        if self.streams.is_empty() {
            writeln!(f, "(no samples: time is paused, or see `wheelarm doctor`)")?;
        }
        Ok(())
    }
}
