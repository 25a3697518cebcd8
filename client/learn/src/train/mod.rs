//! One loop for all that is trained in Rust: steps, a line and a point of the curves
//! per interval, checkpoints, the best weights, an early end, and going on.
//!
//! What a step draws follows from the seed and the number of the step alone, so that
//! a run that was cut goes on as if it had not been.

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

/// What is learned.
pub trait Lesson {
    /// The network.
    type Network: Module;

    /// The loss of a step, and numbers for the log.
    fn loss(&self, network: &Self::Network, step: u64) -> (Tensor<1>, Vec<(&'static str, f64)>);

    /// How good a network is on what it has not seen, less being better; and
    /// numbers for the log. Nothing where nothing was held out.
    fn validate(&self, network: &Self::Network) -> Option<f64>;

    /// The learning rate of a step.
    fn rate(&self, step: u64) -> f64;

    /// Writes what can be used.
    ///
    /// # Errors
    /// When it cannot be written.
    fn keep(&self, network: &Self::Network, told: &Told, folder: &Path) -> anyhow::Result<()>;
}

/// How long and how.
#[derive(Clone, Debug)]
pub struct Schedule {
    /// Folder for checkpoint, log, curves and result.
    pub out: PathBuf,
    /// Steps in all.
    pub steps: u64,
    /// Ends this call after so long, wall time.
    pub limit: Option<Duration>,
    /// Steps between lines of the log.
    pub interval: u64,
    /// Intervals without a better validation after which it ends.
    pub patience: Option<usize>,
    /// Weight decay of AdamW.
    pub weight_decay: f32,
    /// Longest gradient, over all parameters.
    pub clip: f64,
}

/// Where a run stands.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Told {
    /// Steps that were made.
    pub step: u64,
    /// Seconds that they took, wall time.
    pub seconds: f64,
    /// Best validation so far, and its step.
    pub best: Option<(f64, u64)>,
    /// It ended: all steps, or no progress.
    pub is_over: bool,
    /// One entry per interval.
    pub log: Vec<Entry>,
}

/// Trains, or goes on where a checkpoint lies in the folder. The network has to be
/// on a device with gradients.
///
/// # Errors
/// When the folder cannot be written or its checkpoint is of something else.
pub fn run<L: Lesson>(
    lesson: &L,
    network: L::Network,
    schedule: &Schedule,
) -> anyhow::Result<(L::Network, Told)> {
    let begun = Instant::now();
    std::fs::create_dir_all(&schedule.out).with_context(|| schedule.out.display().to_string())?;
    let optimiser = AdamWConfig::new()
        .with_epsilon(1e-8)
        .with_weight_decay(schedule.weight_decay)
        .init();
    let (mut network, mut optimiser, mut told) = resumed(network, optimiser, &schedule.out)?;
    let before = told.seconds;
    let bar = bar(schedule.steps, told.step);
    let mut sums: Vec<(&'static str, f64)> = Vec::new();
    let mut counted = 0.0;
    while told.step < schedule.steps && !told.is_over {
        let (loss, parts) = lesson.loss(&network, told.step);
        let gradients = GradientsParams::from_grads(loss.backward(), &network);
        let gradients = clip::clipped(gradients, &network, schedule.clip);
        let rate = lesson.rate(told.step);
        network = optimiser.step(rate, network, gradients);
        told.step += 1;
        counted += 1.0;
        for (i, (name, value)) in parts.into_iter().enumerate() {
            match sums.get_mut(i) {
                Some(sum) => sum.1 += value,
                None => sums.push((name, value)),
            }
        }
        bar.inc(1);
        let is_late = schedule.limit.is_some_and(|limit| begun.elapsed() > limit);
        told.seconds = before + begun.elapsed().as_secs_f64();
        if told.step % schedule.interval == 0 || told.step == schedule.steps {
            let means = sums
                .iter()
                .map(|(name, sum)| ((*name).to_owned(), sum / counted));
            let entry = Entry {
                step: told.step,
                training: means.collect(),
                validation: lesson.validate(&network.valid()),
                rate,
            };
            (sums, counted) = (Vec::new(), 0.0);
            bar.suspend(|| println!("{}", line(&entry, schedule.steps, told.seconds)));
            let is_best = entry
                .validation
                .is_none_or(|v| told.best.is_none_or(|(best, _)| v < best));
            if let Some(validation) = entry.validation.filter(|_| is_best) {
                told.best = Some((validation, told.step));
            }
            told.log.push(entry);
            told.is_over = told.step == schedule.steps || is_stuck(&told, schedule);
            curves::draw(&told.log, &schedule.out.join("curves.png"))?;
            save(&network, &optimiser, &told, &schedule.out)?;
            if is_best {
                lesson.keep(&network.valid(), &told, &schedule.out)?;
            }
        }
        if is_late {
            save(&network, &optimiser, &told, &schedule.out)?;
            break;
        }
    }
    bar.finish_and_clear();
    Ok((network, told))
}

/// No interval of the last few was better than the best before.
fn is_stuck(told: &Told, schedule: &Schedule) -> bool {
    let Some((patience, (_, best))) = schedule.patience.zip(told.best) else {
        return false;
    };
    let since = told.log.iter().filter(|entry| entry.step > best);
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
    told: PathBuf,
}

fn files(folder: &Path, ending: &str) -> Files {
    let name = |what: &str| folder.join(format!("checkpoint-{what}{ending}"));
    Files {
        network: name("network.bpk"),
        optimiser: name("optimiser.bpk"),
        told: name("run.json"),
    }
}

fn save<M: Module>(
    network: &M,
    optimiser: &ModuleOptimizer,
    told: &Told,
    folder: &Path,
) -> anyhow::Result<()> {
    let (part, whole) = (files(folder, ".part.bpk"), files(folder, ""));
    let wrong = |e: &dyn std::fmt::Display| anyhow::anyhow!("{}: {e}", folder.display());
    let network = network.clone().save_file(&part.network);
    network.map_err(|e| wrong(&e))?;
    optimiser.save(&part.optimiser).map_err(|e| wrong(&e))?;
    std::fs::write(&part.told, serde_json::to_vec_pretty(told)?)?;
    // What tells the step comes last: without it there is no checkpoint.
    let _ = std::fs::remove_file(&whole.told);
    std::fs::rename(part.network, whole.network)?;
    std::fs::rename(part.optimiser, whole.optimiser)?;
    std::fs::rename(part.told, whole.told)?;
    Ok(())
}

fn resumed<M: Module>(
    network: M,
    optimiser: ModuleOptimizer,
    folder: &Path,
) -> anyhow::Result<(M, ModuleOptimizer, Told)> {
    let files = files(folder, "");
    if !files.told.exists() {
        return Ok((network, optimiser, Told::default()));
    }
    let wrong = |e: &dyn std::fmt::Display| {
        anyhow::anyhow!(
            "the checkpoint in {} cannot be read ({e}): it may be of another network; choose another folder",
            folder.display()
        )
    };
    let told = std::fs::read(&files.told).map_err(|e| wrong(&e))?;
    let told: Told = serde_json::from_slice(&told).map_err(|e| wrong(&e))?;
    let network = network
        .try_load_file(&files.network)
        .map_err(|e| wrong(&e))?;
    let optimiser = optimiser.load(&files.optimiser).map_err(|e| wrong(&e))?;
    println!("goes on from step {}", told.step);
    Ok((network, optimiser, told))
}
