//! Training of the baseline: as the paper prints it, and corrected.

use std::path::Path;

use anyhow::{Context, ensure};
use burn::prelude::*;
use burn::tensor::TensorData;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::columns::{OUTPUTS, Trial};
use super::depth::{Depths, SIDE};
use super::errors::{Predictions, lasts};
use super::features::Features;
use super::network::{Baseline, Sizes, WORD};
use crate::episodes::{Episode, LEAST_DEVIATION};
use crate::language::{Vocabulary, vocabulary};
use crate::train::{self, Progress};
use crate::weights::Weights;

/// File of the weights in a run's folder.
const FILE: &str = "baseline.safetensors";
/// Least deviation of a change, in its own unit, so that constant outputs (the chair's height) are
/// not amplified.
const LEAST_CHANGE: f32 = 1e-3;

/// Rows of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// As the paper describes it: unscaled columns and poses.
    AsPrinted,
    /// Standardized columns; the outputs are changes since the last row in units of their
    /// deviation.
    Corrected,
    /// The same, without images.
    CorrectedBlind,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::AsPrinted, Self::Corrected, Self::CorrectedBlind];

    /// Name of its row and folder.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::AsPrinted => "as printed",
            Self::Corrected => "corrected",
            Self::CorrectedBlind => "corrected, without images",
        }
    }
}

/// Options of a training; the defaults are the paper's.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TaskOptions {
    /// Which row of the table.
    pub kind: Kind,
    /// Rows of a window.
    pub length: usize,
    /// Predicted rows ahead.
    pub ahead: Vec<usize>,
    /// Batch size, windows.
    pub batch: usize,
    /// Learning rate of the first epochs.
    pub rate: f64,
    /// Epochs after which the learning rate falls to a tenth, repeatedly.
    pub fall: u64,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl TaskOptions {
    /// The options of the paper.
    #[must_use]
    pub fn of(kind: Kind) -> Self {
        Self {
            kind,
            length: 20,
            ahead: vec![1, 10, 20],
            batch: 16,
            rate: 1e-4,
            fall: 5,
            seed: 0,
        }
    }

    pub(super) fn longest(&self) -> usize {
        self.ahead.iter().copied().max().unwrap_or(1)
    }
}

/// Means and deviations.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Scale {
    /// Mean and deviation of the columns; the last one is the time.
    state: [Vec<f32>; 2],
    /// Deviation of the changes, by time ahead.
    change: Vec<[f32; OUTPUTS]>,
}

/// Trials, and the training of a network on them.
#[derive(Debug)]
pub struct BaselineTask<'a> {
    options: TaskOptions,
    episodes: &'a [Episode],
    features: Option<&'a Features>,
    depths: Option<Depths>,
    learned: &'a [Trial],
    held: &'a [Trial],
    /// Trial and last row of all windows.
    windows: Vec<(usize, usize)>,
    vocabulary: Vec<String>,
    places: Vocabulary,
    vectors: Option<Vec<f32>>,
    scale: Scale,
    device: Device,
}

/// Windows as tensors.
struct Batch {
    rows: Tensor<3>,
    depth: Option<Tensor<4>>,
    words: Tensor<2>,
    wanted: Tensor<3>,
}

impl Batch {
    fn predict(self, network: &Baseline) -> Tensor<3> {
        network.forward(self.rows, self.depth, self.words)
    }

    fn loss(self, network: &Baseline) -> Tensor<1> {
        let wanted = self.wanted.clone();
        (self.predict(network) - wanted).square().mean()
    }
}

impl<'a> BaselineTask<'a> {
    /// From trials for training and for validation, and the features of their images. `vectors` is
    /// a text file of word2vec: a word and 300 numbers a line.
    ///
    /// # Errors
    /// When the trials are too short, or the vectors cannot be read.
    pub fn new(
        options: TaskOptions,
        episodes: &'a [Episode],
        features: Option<&'a Features>,
        (learned, held): (&'a [Trial], &'a [Trial]),
        vectors: Option<&Path>,
    ) -> anyhow::Result<Self> {
        ensure!(
            options.length > 0 && options.batch > 0 && !options.ahead.contains(&0),
            "length, batch and ahead must be at least 1"
        );
        let windows = windows(learned, &options);
        ensure!(
            !windows.is_empty() && !self::windows(held, &options).is_empty(),
            "no episode is longer than a window of {} rows and {} predicted rows",
            options.length,
            options.longest()
        );
        let sentences = learned
            .iter()
            .map(|t| episodes[t.episode].about.instruction.as_str());
        let words = vocabulary(sentences);
        let vectors = vectors
            .map(|path| read_vectors(path, &words, options.seed))
            .transpose()?;
        let features = features.filter(|_| options.kind != Kind::CorrectedBlind);
        let is_metric = options.kind != Kind::AsPrinted;
        Ok(Self {
            depths: features.and_then(|_| Depths::of(episodes, is_metric)),
            features,
            scale: scale(learned, &options),
            places: Vocabulary::new(&words),
            vocabulary: words,
            device: Device::flex().autodiff(),
            windows,
            vectors,
            options,
            episodes,
            learned,
            held,
        })
    }

    /// Steps of an epoch.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.windows.len().div_ceil(self.options.batch) as u64
    }

    /// A network with random weights, for training.
    #[must_use]
    pub fn network(&self) -> Baseline {
        self.device.seed(self.options.seed);
        let network = Baseline::new(&self.sizes(), &self.device);
        match &self.vectors {
            Some(vectors) => {
                let data = TensorData::new(vectors.clone(), [self.vocabulary.len(), WORD]);
                network.with_words(Tensor::<2>::from_data(data, &self.device))
            }
            None => network,
        }
    }

    /// The best network of a run in a folder.
    ///
    /// # Errors
    /// When the file is missing or does not fit.
    pub fn best(&self, folder: &Path) -> anyhow::Result<Baseline> {
        let file = crate::weights::WeightsFile::read(&folder.join(FILE))?;
        let network = Baseline::new(&self.sizes(), &Device::flex());
        Ok(file.weights.into_network(network)?)
    }

    fn sizes(&self) -> Sizes {
        Sizes {
            visual: self.features.map_or(0, |f| f.width),
            depths: self.depths.as_ref().map_or(0, |d| d.cameras),
            state: self.scale.state[0].len(),
            words: self.vocabulary.len(),
            ahead: self.options.ahead.len(),
        }
    }

    /// Whether it uses depth.
    #[must_use]
    pub fn uses_depth(&self) -> bool {
        self.depths.is_some()
    }

    /// Inputs and true outputs of windows of trials, in the units of training.
    fn batch(&self, trials: &[Trial], windows: &[(usize, usize)], device: &Device) -> Batch {
        let (mut rows, mut words, mut wanted) = (Vec::new(), Vec::new(), Vec::new());
        let mut depth = Vec::new();
        for &(number, last) in windows {
            let trial = &trials[number];
            for row in last + 1 - self.options.length..=last {
                if let Some(features) = self.features {
                    rows.extend_from_slice(features.row(trial.episode, trial.first + row));
                }
                rows.extend(self.state(trial, row));
                if let Some(depths) = &self.depths {
                    let depths_of_row = depths.row(trial.episode, trial.first + row);
                    depth.extend(depths_of_row.iter().map(|&v| f32::from(v) / 255.0));
                }
            }
            words.extend(
                self.places
                    .shares(&self.episodes[trial.episode].about.instruction),
            );
            for (k, ahead) in self.options.ahead.iter().enumerate() {
                let (now, then) = (&trial.outputs[last], &trial.outputs[last + ahead]);
                wanted.extend((0..OUTPUTS).map(|i| match self.options.kind {
                    Kind::AsPrinted => then[i],
                    _ => (then[i] - now[i]) / self.scale.change[k][i],
                }));
            }
        }
        let (count, sizes) = (windows.len(), self.sizes());
        let width = sizes.visual + sizes.state;
        let shape = [count * self.options.length * sizes.depths, 1, SIDE, SIDE];
        let depth = (sizes.depths > 0).then(|| TensorData::new(depth, shape));
        let rows = TensorData::new(rows, [count, self.options.length, width]);
        let words = TensorData::new(words, [count, sizes.words]);
        let wanted = TensorData::new(wanted, [count, sizes.ahead, OUTPUTS]);
        Batch {
            rows: Tensor::from_data(rows, device),
            depth: depth.map(|depth| Tensor::from_data(depth, device)),
            words: Tensor::from_data(words, device),
            wanted: Tensor::from_data(wanted, device),
        }
    }

    fn state(&self, trial: &Trial, row: usize) -> Vec<f32> {
        let mut state = with_time(trial, row);
        if self.options.kind != Kind::AsPrinted {
            let [mean, deviation] = &self.scale.state;
            for (value, (mean, deviation)) in state.iter_mut().zip(mean.iter().zip(deviation)) {
                *value = (*value - mean) / deviation;
            }
        }
        state
    }

    /// Predictions for all windows of trials, by time ahead.
    #[must_use]
    pub fn predict(&self, network: &Baseline, trials: &[Trial]) -> Vec<Predictions> {
        let device = Device::flex();
        let empty = vec![Vec::new(); trials.len()];
        let mut out = vec![empty; self.options.ahead.len()];
        for part in windows(trials, &self.options).chunks(4 * self.options.batch) {
            let batch = self.batch(trials, part, &device);
            let found = batch.predict(network).into_data();
            let found: Vec<f32> = found.iter::<f32>().collect();
            let of_window = self.options.ahead.len() * OUTPUTS;
            for (&(number, last), values) in part.iter().zip(found.chunks(of_window)) {
                let now = &trials[number].outputs[last];
                for (k, values) in values.chunks(OUTPUTS).enumerate() {
                    out[k][number].push(std::array::from_fn(|i| match self.options.kind {
                        Kind::AsPrinted => values[i],
                        _ => now[i] + values[i] * self.scale.change[k][i],
                    }));
                }
            }
        }
        out
    }
}

impl train::TrainingTask for BaselineTask<'_> {
    type Network = Baseline;

    fn loss(&self, network: &Baseline, step: u64) -> (Tensor<1>, Vec<(&'static str, f64)>) {
        let mut random = ChaCha8Rng::seed_from_u64(self.options.seed);
        random.set_stream(step + 1);
        let sampled = (0..self.options.batch)
            .map(|_| self.windows[random.random_range(0..self.windows.len())]);
        let sampled: Vec<_> = sampled.collect();
        let loss = self
            .batch(self.learned, &sampled, &self.device)
            .loss(network);
        let mse = loss.clone().into_scalar::<f64>();
        (loss, vec![("mse", mse)])
    }

    fn validate(&self, network: &Baseline) -> Option<f64> {
        let device = Device::flex();
        let (mut sum, mut count) = (0.0, 0.0);
        for part in windows(self.held, &self.options).chunks(4 * self.options.batch) {
            let error = self.batch(self.held, part, &device).loss(network);
            sum += error.into_scalar::<f64>() * part.len() as f64;
            count += part.len() as f64;
        }
        Some(sum / count)
    }

    fn rate(&self, step: u64) -> f64 {
        let falls = step / self.epoch() / self.options.fall.max(1);
        self.options.rate * 0.1_f64.powi(falls.min(100) as i32)
    }

    fn keep(
        &self,
        network: &Baseline,
        depths_of_row: &Progress,
        folder: &Path,
    ) -> anyhow::Result<()> {
        let seeds = |trials: &[Trial]| trials.iter().map(|t| t.seed).collect::<Vec<_>>();
        let card = serde_json::json!({
            "format": "wheelarm-baseline/1",
            "options": self.options,
            "vocabulary": self.vocabulary,
            "scale": self.scale,
            "training_seeds": seeds(self.learned),
            "validation_seeds": seeds(self.held),
            "steps": depths_of_row.step, "seconds": depths_of_row.seconds, "best": depths_of_row.best,
            "program": format!("wheelarm-learn {}", wheelarm_proto::program::version()),
        });
        let text = serde_json::to_string_pretty(&card)?;
        Weights::of_network(network).write(&folder.join(FILE), Some(&text))?;
        std::fs::write(folder.join("baseline.json"), text + "\n")?;
        Ok(())
    }
}

/// Trial and last row of all windows.
fn windows(trials: &[Trial], options: &TaskOptions) -> Vec<(usize, usize)> {
    let each = trials.iter().enumerate();
    let each = each.flat_map(|(number, trial)| {
        lasts(trial, options.length, options.longest()).map(move |last| (number, last))
    });
    each.collect()
}

/// The columns of a row, and the time since the start, s, at ten rows a second.
fn with_time(trial: &Trial, row: usize) -> Vec<f32> {
    let mut state = trial.state[row].clone();
    state.push((trial.first + row) as f32 * 0.1);
    state
}

fn scale(trials: &[Trial], options: &TaskOptions) -> Scale {
    let rows: Vec<Vec<f32>> = trials
        .iter()
        .flat_map(|t| (0..t.state.len()).map(|row| with_time(t, row)))
        .collect();
    let width = rows.first().map_or(0, Vec::len);
    let moments = |column: usize| {
        let values = rows.iter().map(|row| f64::from(row[column]));
        let mean = values.clone().sum::<f64>() / rows.len().max(1) as f64;
        let square = values.map(|v| (v - mean).powi(2)).sum::<f64>() / rows.len().max(1) as f64;
        (mean as f32, (square.sqrt() as f32).max(LEAST_DEVIATION))
    };
    let (mean, deviation) = (0..width).map(moments).unzip();
    let change = options.ahead.iter().map(|ahead| {
        std::array::from_fn(|i| {
            let changes = trials.iter().flat_map(|t| {
                let pairs = t.outputs.iter().zip(t.outputs.iter().skip(*ahead));
                pairs.map(move |(now, then)| f64::from(then[i] - now[i]))
            });
            let count = changes.clone().count().max(1) as f64;
            let square = changes.map(|c| c * c).sum::<f64>() / count;
            (square.sqrt() as f32).max(LEAST_CHANGE)
        })
    });
    Scale {
        state: [mean, deviation],
        change: change.collect(),
    }
}

/// Reads the vectors of the vocabulary's words from a text file of word2vec; missing words get
/// random vectors.
fn read_vectors(path: &Path, words: &[String], seed: u64) -> anyhow::Result<Vec<f32>> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut vectors: Vec<f32> = (0..words.len() * WORD)
        .map(|_| random.random_range(-1.0..1.0))
        .collect();
    let mut known = 0;
    for (number, line) in text.lines().enumerate() {
        let mut parts = line.split_whitespace();
        let Some(place) = parts
            .next()
            .and_then(|word| words.iter().position(|w| w == word))
        else {
            continue;
        };
        let values = parts.map(str::parse).collect::<Result<Vec<f32>, _>>();
        let values = values
            .ok()
            .filter(|v| v.len() == WORD && v.iter().all(|v| v.is_finite()));
        let values = values.with_context(|| {
            format!(
                "{}:{}: expected a word and {WORD} numbers",
                path.display(),
                number + 1
            )
        })?;
        vectors[place * WORD..(place + 1) * WORD].copy_from_slice(&values);
        known += 1;
    }
    ensure!(
        known > 0,
        "{} has none of the words {}",
        path.display(),
        words.join(", ")
    );
    Ok(vectors)
}
