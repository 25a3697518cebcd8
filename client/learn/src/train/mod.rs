//! The training loop of all networks in Rust: steps, a log entry and a point of the curves per
//! interval, checkpoints, the best weights, an early end, and resuming.
//!
//! The random numbers of a step follow from the seed and the number of the step alone, so that an
//! interrupted run ends with the same bits.

mod clip;
mod curves;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use burn::optim::{AdamWConfig, GradientsParams, ModuleOptimizer};
use burn::prelude::*;
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};

pub use self::curves::Entry;

/// A network with its data and loss.
pub trait TrainingTask {
    /// The network.
    type Network: Module;

    /// The loss of a step, and numbers for the log.
    fn loss(&self, network: &Self::Network, step: u64) -> (Tensor<1>, Vec<(&'static str, f64)>);

    /// Error of a network on held-out data, smaller is better; `None` without held-out data.
    fn validate(&self, network: &Self::Network) -> Option<f64>;

    /// The learning rate of a step.
    fn rate(&self, step: u64) -> f64;

    /// Writes the trained network for use.
    ///
    /// # Errors
    /// When it cannot be written.
    fn keep(
        &self,
        network: &Self::Network,
        progress: &Progress,
        folder: &Path,
    ) -> anyhow::Result<()>;
}

/// Length and settings of a training.
#[derive(Clone, Debug)]
pub struct Schedule {
    /// Folder for checkpoint, log, curves and result.
    pub out: PathBuf,
    /// Total number of steps.
    pub steps: u64,
    /// Ends this call after this wall time.
    pub limit: Option<Duration>,
    /// Steps between lines of the log.
    pub interval: u64,
    /// Ends after this number of intervals without a better validation.
    pub patience: Option<usize>,
    /// Weight decay of AdamW.
    pub weight_decay: f32,
    /// Largest norm of the gradient over all parameters.
    pub clip: f64,
}

/// Progress of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Completed steps.
    pub step: u64,
    /// Their wall time, s.
    pub seconds: f64,
    /// Best validation so far, and its step.
    pub best: Option<(f64, u64)>,
    /// Whether it ended: all steps, or no progress.
    pub is_over: bool,
    /// One entry per interval.
    pub log: Vec<Entry>,
}

/// Trains a network, or continues from a checkpoint in the folder. The network must be on a device
/// with gradients.
///
/// # Errors
/// When the folder cannot be written, or its checkpoint is of another network.
pub fn run<L: TrainingTask>(
    task: &L,
    network: L::Network,
    schedule: &Schedule,
) -> anyhow::Result<(L::Network, Progress)> {
    let begun = Instant::now();
    std::fs::create_dir_all(&schedule.out).with_context(|| schedule.out.display().to_string())?;
    let optimiser = AdamWConfig::new()
        .with_epsilon(1e-8)
        .with_weight_decay(schedule.weight_decay)
        .init();
    let (mut network, mut optimiser, mut progress) = resume(network, optimiser, &schedule.out)?;
    let before = progress.seconds;
    let bar = bar(schedule.steps, progress.step);
    let mut sums: Vec<(&'static str, f64)> = Vec::new();
    let mut counted = 0.0;
    while progress.step < schedule.steps && !progress.is_over {
        let (loss, parts) = task.loss(&network, progress.step);
        let gradients = GradientsParams::from_grads(loss.backward(), &network);
        let gradients = clip::clipped(gradients, &network, schedule.clip);
        let rate = task.rate(progress.step);
        network = optimiser.step(rate, network, gradients);
        progress.step += 1;
        counted += 1.0;
        for (i, (name, value)) in parts.into_iter().enumerate() {
            match sums.get_mut(i) {
                Some(sum) => sum.1 += value,
                None => sums.push((name, value)),
            }
        }
        bar.inc(1);
        let is_late = schedule.limit.is_some_and(|limit| begun.elapsed() > limit);
        progress.seconds = before + begun.elapsed().as_secs_f64();
        if progress.step % schedule.interval == 0 || progress.step == schedule.steps {
            let means = sums
                .iter()
                .map(|(name, sum)| ((*name).to_owned(), sum / counted));
            let entry = Entry {
                step: progress.step,
                training: means.collect(),
                validation: task.validate(&network.valid()),
                rate,
            };
            (sums, counted) = (Vec::new(), 0.0);
            bar.suspend(|| println!("{}", line(&entry, schedule.steps, progress.seconds)));
            let is_best = entry
                .validation
                .is_none_or(|v| progress.best.is_none_or(|(best, _)| v < best));
            if let Some(validation) = entry.validation.filter(|_| is_best) {
                progress.best = Some((validation, progress.step));
            }
            progress.log.push(entry);
            progress.is_over = progress.step == schedule.steps || is_stuck(&progress, schedule);
            curves::draw(&progress.log, &schedule.out.join("curves.png"))?;
            save(&network, &optimiser, &progress, &schedule.out)?;
            if is_best {
                task.keep(&network.valid(), &progress, &schedule.out)?;
            }
        }
        if is_late {
            save(&network, &optimiser, &progress, &schedule.out)?;
            break;
        }
    }
    bar.finish_and_clear();
    Ok((network, progress))
}

/// Whether none of the last `patience` intervals was better than the best before.
fn is_stuck(progress: &Progress, schedule: &Schedule) -> bool {
    let Some((patience, (_, best))) = schedule.patience.zip(progress.best) else {
        return false;
    };
    let since = progress.log.iter().filter(|entry| entry.step > best);
    since.count() >= patience
}

fn line(entry: &Entry, steps: u64, seconds: f64) -> String {
    let mut words = format!("step {} of {steps}, {seconds:.0} s:", entry.step);
    for (name, value) in &entry.training {
        words += &format!(" {name} {value:.4}");
    }
    if let Some(validation) = entry.validation {
        words += &format!(", held out {validation:.4}");
    }
    words
}

fn bar(steps: u64, done: u64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps).with_position(done);
    let style = "{elapsed_precise} {bar:30} {pos} of {len} steps, {per_sec}, {eta} left";
    if let Ok(style) = ProgressStyle::with_template(style) {
        bar.set_style(style);
    }
    bar.reset_eta();
    bar
}

/// Files of a checkpoint.
struct Files {
    network: PathBuf,
    optimiser: PathBuf,
    progress: PathBuf,
}

fn files(folder: &Path, ending: &str) -> Files {
    let name = |what: &str| folder.join(format!("checkpoint-{what}{ending}"));
    Files {
        network: name("network.bpk"),
        optimiser: name("optimiser.bpk"),
        progress: name("run.json"),
    }
}

fn save<M: Module>(
    network: &M,
    optimiser: &ModuleOptimizer,
    progress: &Progress,
    folder: &Path,
) -> anyhow::Result<()> {
    let (part, whole) = (files(folder, ".part.bpk"), files(folder, ""));
    let wrong = |e: &dyn std::fmt::Display| anyhow::anyhow!("{}: {e}", folder.display());
    let network = network.clone().save_file(&part.network);
    network.map_err(|e| wrong(&e))?;
    optimiser.save(&part.optimiser).map_err(|e| wrong(&e))?;
    std::fs::write(&part.progress, serde_json::to_vec_pretty(progress)?)?;
    // The file with the step is written last: without it the checkpoint does not count.
    let _ = std::fs::remove_file(&whole.progress);
    std::fs::rename(part.network, whole.network)?;
    std::fs::rename(part.optimiser, whole.optimiser)?;
    std::fs::rename(part.progress, whole.progress)?;
    Ok(())
}

fn resume<M: Module>(
    network: M,
    optimiser: ModuleOptimizer,
    folder: &Path,
) -> anyhow::Result<(M, ModuleOptimizer, Progress)> {
    let files = files(folder, "");
    if !files.progress.exists() {
        return Ok((network, optimiser, Progress::default()));
    }
    let wrong = |e: &dyn std::fmt::Display| {
        anyhow::anyhow!(
            "cannot read the checkpoint in {}: {e}; it may be of another network: choose another folder",
            folder.display()
        )
    };
    let progress = std::fs::read(&files.progress).map_err(|e| wrong(&e))?;
    let progress: Progress = serde_json::from_slice(&progress).map_err(|e| wrong(&e))?;
    let network = network
        .try_load_file(&files.network)
        .map_err(|e| wrong(&e))?;
    let optimiser = optimiser.load(&files.optimiser).map_err(|e| wrong(&e))?;
    println!("continues from step {}", progress.step);
    Ok((network, optimiser, progress))
}
