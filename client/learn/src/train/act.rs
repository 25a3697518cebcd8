//! Training of small ACT networks on the CPU.

use std::path::Path;

use burn::prelude::*;
use burn::tensor::TensorData;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Progress, TrainingTask};
use crate::card::{ActionCard, CameraCard, Card, FORMAT, ImageCard, StateCard};
use crate::episodes::{Episode, statistics};
use crate::image;
use crate::language::{Vocabulary, vocabulary};
use crate::network::{Inputs, Kind, Network, Shape, Words};
use crate::trained::noise;
use crate::weights::Weights;

/// Mean and deviation of ImageNet's channels.
const IMAGE_NORMAL: [[f32; 3]; 2] = [[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]];
/// Stride of ResNet18, pixels.
const MULTIPLE: usize = 32;
/// Rows of a validation.
const VALIDATION_ROWS: usize = 64;

/// Options of a training.
#[derive(Clone, Debug)]
pub struct ActOptions {
    /// Name of the policy.
    pub name: String,
    /// Sizes; those of state, action, cameras and words follow from the episodes.
    pub shape: Shape,
    /// Rows that are executed before the next request; for the card.
    pub execute: usize,
    /// Batch size, rows.
    pub batch: usize,
    /// Largest learning rate.
    pub rate: f64,
    /// Steps until the largest learning rate.
    pub warm_up: u64,
    /// Total number of steps, over which the cosine schedule extends.
    pub steps: u64,
    /// Weight of the latent's divergence.
    pub divergence: f64,
    /// Largest random shift of an image, pixels.
    pub shift: i32,
    /// Whether the network reads the sentence.
    pub language: bool,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Episodes, and the training of a network on them.
#[derive(Debug)]
pub struct ActTask {
    options: ActOptions,
    card: Card,
    vocabulary: Vocabulary,
    learned: Vec<Episode>,
    held: Vec<Episode>,
    /// Episode and row of all training rows.
    samples: Vec<(usize, usize)>,
    device: Device,
}

/// Inputs and true actions of a step.
struct Batch {
    inputs: Inputs,
    actions: Tensor<3>,
    /// Batch × chunk: true for a row after the end.
    padding: Tensor<2, Bool>,
    /// Batch × chunk × 1: 0 for padding, else 1.
    counts: Tensor<3>,
}

impl ActTask {
    /// From episodes for training and for validation.
    ///
    /// # Errors
    /// When the sizes do not fit the episodes.
    pub fn new(
        options: ActOptions,
        learned: Vec<Episode>,
        held: Vec<Episode>,
    ) -> anyhow::Result<Self> {
        let card = card(&options, &learned, &held)?;
        let each = learned.iter().enumerate();
        let samples = each.flat_map(|(e, episode)| (0..episode.rows()).map(move |row| (e, row)));
        Ok(Self {
            samples: samples.collect(),
            vocabulary: Vocabulary::new(&card.vocabulary),
            device: Device::flex().autodiff(),
            options,
            card,
            learned,
            held,
        })
    }

    /// A network with random weights.
    #[must_use]
    pub fn network(&self) -> Network {
        self.device.seed(self.options.seed);
        Network::new(&self.card.network, &self.device)
    }

    /// The card of the policy.
    #[must_use]
    pub fn card(&self) -> &Card {
        &self.card
    }

    fn batch(
        &self,
        episodes: &[Episode],
        samples: &[(usize, usize)],
        shifts: Option<&[[i32; 2]]>,
        device: &Device,
    ) -> Batch {
        let (shape, card) = (&self.card.network, &self.card);
        let (count, chunk) = (samples.len(), shape.chunk);
        let mut images = Vec::new();
        let (mut states, mut words) = (Vec::new(), Vec::new());
        let (mut actions, mut counts) = (Vec::new(), Vec::new());
        for &(episode, row) in samples {
            let episode = &episodes[episode];
            let names = card.cameras.iter();
            images.extend(names.map(|camera| episode.image(&camera.name, row)));
            let state = normal(episode.states.row(row), &card.state.mean, &card.state.std);
            states.extend(state);
            words.extend(self.vocabulary.shares(&episode.about.instruction));
            for at in row..row + chunk {
                let last = episode.rows() - 1;
                let action = episode.actions.row(at.min(last));
                actions.extend(normal(action, &card.action.mean, &card.action.std));
                counts.push(if at > last { 0.0_f32 } else { 1.0 });
            }
        }
        let tensor2 = |values: Vec<f32>, width: usize| {
            Tensor::<2>::from_data(TensorData::new(values, [count, width]), device)
        };
        let counts = tensor2(counts, chunk);
        let data = TensorData::new(actions, [count, chunk, shape.action]);
        Batch {
            inputs: Inputs {
                images: image::to_tensor(card, &images, shifts, device),
                state: tensor2(states, shape.state),
                words: (shape.words > 0).then(|| Words::Shares(tensor2(words, shape.words))),
            },
            actions: Tensor::from_data(data, device),
            padding: counts.clone().lower_elem(0.5),
            counts: counts.unsqueeze_dim(2),
        }
    }

    /// Mean error of chunks on at most `most` rows of episodes, in standardized units; and the error of
    /// holding the action of the row.
    #[must_use]
    pub fn errors(&self, network: &Network, episodes: &[Episode], most: usize) -> [f64; 2] {
        let each = episodes.iter().enumerate();
        let all: Vec<_> = each
            .flat_map(|(e, episode)| (0..episode.rows()).map(move |row| (e, row)))
            .collect();
        let step = (all.len() / most.max(1)).max(1);
        let samples: Vec<_> = all.into_iter().step_by(step).collect();
        let device = Device::flex();
        let (mut sums, mut count) = ([0.0; 2], 0.0);
        for part in samples.chunks(self.options.batch) {
            let batch = self.batch(episodes, part, None, &device);
            let found = network.forward(batch.inputs, None);
            let held = batch.actions.clone().slice([0..part.len(), 0..1]);
            let held = held.expand(batch.actions.dims());
            let error = |answer: Tensor<3>| {
                let error = (answer - batch.actions.clone()).abs() * batch.counts.clone();
                error.sum().into_scalar::<f64>()
            };
            sums[0] += error(found);
            sums[1] += error(held);
            count += batch.counts.clone().sum().into_scalar::<f64>();
        }
        sums.map(|sum| sum / (count * self.card.network.action as f64).max(1.0))
    }
}

fn normal<'a>(row: &'a [f32], mean: &'a [f32], std: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
    let numbers = row.iter().zip(mean).zip(std);
    numbers.map(|((v, mean), std)| (v - mean) / std)
}

impl TrainingTask for ActTask {
    type Network = Network;

    fn loss(&self, network: &Network, step: u64) -> (Tensor<1>, Vec<(&'static str, f64)>) {
        let options = &self.options;
        let mut random = ChaCha8Rng::seed_from_u64(options.seed);
        random.set_stream(step);
        let samples =
            (0..options.batch).map(|_| *self.samples.choose(&mut random).unwrap_or(&(0, 0)));
        let samples: Vec<_> = samples.collect();
        let images = samples.len() * self.card.cameras.len();
        let most = options.shift;
        let mut pixel = || random.random_range(-most..=most);
        let shifts: Vec<[i32; 2]> = (0..images).map(|_| [pixel(), pixel()]).collect();
        let batch = self.batch(&self.learned, &samples, Some(&shifts), &self.device);
        let cost = |found: Tensor<3>| {
            let error = (found - batch.actions.clone()).abs() * batch.counts.clone();
            error.mean()
        };
        if self.card.network.vae_layers == 0 {
            let l1 = cost(network.forward(batch.inputs, None));
            let value = l1.clone().into_scalar::<f64>();
            return (l1, vec![("l1", value)]);
        }
        let latent = self.card.network.latent;
        let noise = noise(options.seed, step, samples.len() * latent);
        let noise = TensorData::new(noise, [samples.len(), latent]);
        let noise = Tensor::from_data(noise, &self.device);
        let (found, latent) =
            network.forward_training(batch.inputs, batch.actions.clone(), batch.padding, noise);
        let (l1, divergence) = (cost(found), latent.divergence());
        let values = [l1.clone(), divergence.clone()].map(|t| t.into_scalar::<f64>());
        let loss = l1 + divergence * options.divergence;
        (loss, vec![("l1", values[0]), ("kl", values[1])])
    }

    fn validate(&self, network: &Network) -> Option<f64> {
        let [error, _] = self.errors(network, &self.held, VALIDATION_ROWS);
        (!self.held.is_empty()).then_some(error)
    }

    fn rate(&self, step: u64) -> f64 {
        let options = &self.options;
        let warm = (step + 1) as f64 / options.warm_up.max(1) as f64;
        let way = step as f64 / options.steps.max(1) as f64;
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * way).cos());
        (options.rate * warm.min(1.0) * cosine).max(1e-7)
    }

    fn keep(&self, network: &Network, progress: &Progress, folder: &Path) -> anyhow::Result<()> {
        let mut card = self.card.clone();
        if let Some(training) = card.training.as_object_mut() {
            training.insert("steps".to_owned(), progress.step.into());
            training.insert("seconds".to_owned(), progress.seconds.into());
            training.insert("best".to_owned(), serde_json::json!(progress.best));
        }
        let text = serde_json::to_string_pretty(&card)?;
        let path = folder.join("policy.safetensors");
        Weights::of_network(network).write(&path, Some(&text))?;
        std::fs::write(folder.join("policy.json"), text + "\n")?;
        Ok(())
    }
}

fn card(options: &ActOptions, learned: &[Episode], held: &[Episode]) -> anyhow::Result<Card> {
    let Some(first) = learned.first() else {
        anyhow::bail!("no episode for training: export successful episodes");
    };
    let about = &first.about;
    let cameras = first.cameras.iter().map(|(name, images)| CameraCard {
        name: name.clone(),
        width: images.width,
        height: images.height,
        depth: false,
    });
    let cameras: Vec<_> = cameras.collect();
    let words = match options.language {
        true => vocabulary(learned.iter().map(|e| e.about.instruction.as_str())),
        false => Vec::new(),
    };
    let (state_mean, state_std) = statistics(learned.iter().map(|e| &e.states));
    let (action_mean, action_std) = statistics(learned.iter().map(|e| &e.actions));
    let seeds = |episodes: &[Episode]| {
        let mut seeds: Vec<u64> = episodes.iter().map(|e| e.about.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        seeds
    };
    let mut tasks: Vec<String> = learned.iter().map(|e| e.about.task.clone()).collect();
    tasks.sort_unstable();
    tasks.dedup();
    let shape = Shape {
        kind: Kind::Act,
        state: about.state_names.len(),
        action: about.action_names.len(),
        cameras: cameras.len(),
        words: words.len(),
        ..options.shape.clone()
    };
    let rows: usize = learned.iter().map(Episode::rows).sum();
    let card = Card {
        format: FORMAT.to_owned(),
        name: options.name.clone(),
        chunk: shape.chunk,
        execute: options.execute.min(shape.chunk),
        network: shape,
        robot: about.robot.clone(),
        rate_hz: about.rate_hz,
        history: 1,
        stochastic: false,
        cameras,
        image: ImageCard {
            mean: IMAGE_NORMAL[0],
            std: IMAGE_NORMAL[1],
            multiple: MULTIPLE,
            padding: "edge".to_owned(),
        },
        state: StateCard {
            names: about.state_names.clone(),
            mean: state_mean,
            std: state_std,
            hidden: Vec::new(),
        },
        action: ActionCard {
            kind: about.action.clone(),
            names: about.action_names.clone(),
            units: about.action_units.clone(),
            mean: action_mean,
            std: action_std,
        },
        vocabulary: words,
        training_seeds: seeds(learned),
        validation_seeds: seeds(held),
        tasks,
        data: serde_json::json!({"episodes": learned.len(), "rows": rows}),
        training: serde_json::json!({
            "program": format!("wheelarm-learn {}", wheelarm_proto::program::version()),
            "batch": options.batch, "rate": options.rate, "kl": options.divergence,
            "shift": options.shift, "seed": options.seed,
        }),
        bits: 32,
    };
    // Rejects invalid sizes before the training.
    Ok(Card::parse(&serde_json::to_string(&card)?)?)
}
