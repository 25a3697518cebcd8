//! ACT trained on the CPU: tiny ones, to see that everything learns.

use std::path::Path;

use burn::prelude::*;
use burn::tensor::TensorData;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Lesson, Told};
use crate::card::{ActionCard, CameraCard, Card, FORMAT, PictureCard, StateCard};
use crate::episodes::{Episode, statistics};
use crate::language::{Vocabulary, vocabulary};
use crate::network::{Inputs, Kind, Network, Shape, Words};
use crate::picture;
use crate::trained::noise;
use crate::weights::Weights;

/// Mean and deviation of pictures, as of ImageNet.
const PICTURE: [[f32; 3]; 2] = [[0.485, 0.456, 0.406], [0.229, 0.224, 0.225]];
/// What ResNet18 divides pictures by.
const MULTIPLE: usize = 32;
/// Rows that a validation looks at.
const LOOKS: usize = 64;

/// How it is taught.
#[derive(Clone, Debug)]
pub struct ActOptions {
    /// Name of the policy.
    pub name: String,
    /// Sizes; those that the episodes decide are taken from them.
    pub shape: Shape,
    /// Rows that are carried out before the next question; for the card.
    pub execute: usize,
    /// Rows of a step.
    pub batch: usize,
    /// Learning rate at its height.
    pub rate: f64,
    /// Steps until then.
    pub warm_up: u64,
    /// Steps in all, at whose end the cosine ends.
    pub steps: u64,
    /// Weight of the latent's divergence.
    pub divergence: f64,
    /// Pixels that pictures are shifted at most.
    pub shift: i32,
    /// The sentence is read.
    pub language: bool,
    /// Seed of all that is drawn.
    pub seed: u64,
}

/// Episodes, and what is to be learned of them.
#[derive(Debug)]
pub struct ActLesson {
    options: ActOptions,
    card: Card,
    vocabulary: Vocabulary,
    learned: Vec<Episode>,
    held: Vec<Episode>,
    /// Episode and row of all that is drawn from.
    places: Vec<(usize, usize)>,
    device: Device,
}

/// What a step sees.
struct Batch {
    inputs: Inputs,
    actions: Tensor<3>,
    /// Batch × chunk: a row behind the end.
    padding: Tensor<2, Bool>,
    /// Batch × chunk × 1: 0 where it is padding.
    counts: Tensor<3>,
}

impl ActLesson {
    /// Of episodes to learn from and others to be held against.
    ///
    /// # Errors
    /// When no network fits them.
    pub fn new(
        options: ActOptions,
        learned: Vec<Episode>,
        held: Vec<Episode>,
    ) -> anyhow::Result<Self> {
        let card = card(&options, &learned, &held)?;
        let each = learned.iter().enumerate();
        let places = each.flat_map(|(e, episode)| (0..episode.rows()).map(move |row| (e, row)));
        Ok(Self {
            places: places.collect(),
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

    /// The card of what is learned.
    #[must_use]
    pub fn card(&self) -> &Card {
        &self.card
    }

    fn batch(
        &self,
        episodes: &[Episode],
        places: &[(usize, usize)],
        shifts: Option<&[[i32; 2]]>,
        device: &Device,
    ) -> Batch {
        let (shape, card) = (&self.card.network, &self.card);
        let (count, chunk) = (places.len(), shape.chunk);
        let mut pictures = Vec::new();
        let (mut states, mut words) = (Vec::new(), Vec::new());
        let (mut actions, mut counts) = (Vec::new(), Vec::new());
        for &(episode, row) in places {
            let episode = &episodes[episode];
            let names = card.cameras.iter();
            pictures.extend(names.map(|camera| episode.picture(&camera.name, row)));
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
                pictures: picture::numbers(card, &pictures, shifts, device),
                state: tensor2(states, shape.state),
                words: (shape.words > 0).then(|| Words::Shares(tensor2(words, shape.words))),
            },
            actions: Tensor::from_data(data, device),
            padding: counts.clone().lower_elem(0.5),
            counts: counts.unsqueeze_dim(2),
        }
    }

    /// Mean error of an answer on rows of episodes, normalised; and of holding the
    /// action of the row.
    #[must_use]
    pub fn errors(&self, network: &Network, episodes: &[Episode], most: usize) -> [f64; 2] {
        let each = episodes.iter().enumerate();
        let all: Vec<_> = each
            .flat_map(|(e, episode)| (0..episode.rows()).map(move |row| (e, row)))
            .collect();
        let step = (all.len() / most.max(1)).max(1);
        let places: Vec<_> = all.into_iter().step_by(step).collect();
        let device = Device::flex();
        let (mut sums, mut count) = ([0.0; 2], 0.0);
        for part in places.chunks(self.options.batch) {
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

impl Lesson for ActLesson {
    type Network = Network;

    fn loss(&self, network: &Network, step: u64) -> (Tensor<1>, Vec<(&'static str, f64)>) {
        let options = &self.options;
        let mut random = ChaCha8Rng::seed_from_u64(options.seed);
        random.set_stream(step);
        let drawn = (0..options.batch).map(|_| *self.places.choose(&mut random).unwrap_or(&(0, 0)));
        let places: Vec<_> = drawn.collect();
        let pictures = places.len() * self.card.cameras.len();
        let most = options.shift;
        let mut pixel = || random.random_range(-most..=most);
        let shifts: Vec<[i32; 2]> = (0..pictures).map(|_| [pixel(), pixel()]).collect();
        let batch = self.batch(&self.learned, &places, Some(&shifts), &self.device);
        let cost = |found: Tensor<3>| {
            let error = (found - batch.actions.clone()).abs() * batch.counts.clone();
            error.mean()
        };
        if self.card.network.vae_layers == 0 {
            let l1 = cost(network.forward(batch.inputs, None));
            let told = l1.clone().into_scalar::<f64>();
            return (l1, vec![("l1", told)]);
        }
        let latent = self.card.network.latent;
        let noise = noise(options.seed, step, places.len() * latent);
        let noise = TensorData::new(noise, [places.len(), latent]);
        let noise = Tensor::from_data(noise, &self.device);
        let (found, latent) =
            network.trained(batch.inputs, batch.actions.clone(), batch.padding, noise);
        let (l1, divergence) = (cost(found), latent.divergence());
        let told = [l1.clone(), divergence.clone()].map(|t| t.into_scalar::<f64>());
        let loss = l1 + divergence * options.divergence;
        (loss, vec![("l1", told[0]), ("kl", told[1])])
    }

    fn validate(&self, network: &Network) -> Option<f64> {
        let [error, _] = self.errors(network, &self.held, LOOKS);
        (!self.held.is_empty()).then_some(error)
    }

    fn rate(&self, step: u64) -> f64 {
        let options = &self.options;
        let warm = (step + 1) as f64 / options.warm_up.max(1) as f64;
        let way = step as f64 / options.steps.max(1) as f64;
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * way).cos());
        (options.rate * warm.min(1.0) * cosine).max(1e-7)
    }

    fn keep(&self, network: &Network, told: &Told, folder: &Path) -> anyhow::Result<()> {
        let mut card = self.card.clone();
        if let Some(training) = card.training.as_object_mut() {
            training.insert("steps".to_owned(), told.step.into());
            training.insert("seconds".to_owned(), told.seconds.into());
            training.insert("best".to_owned(), serde_json::json!(told.best));
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
        anyhow::bail!("there is no episode to learn from");
    };
    let about = &first.about;
    let cameras = first.cameras.iter().map(|(name, pictures)| CameraCard {
        name: name.clone(),
        width: pictures.width,
        height: pictures.height,
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
        picture: PictureCard {
            mean: PICTURE[0],
            std: PICTURE[1],
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
    // What is wrong with the sizes is told before anything is trained.
    Ok(Card::parse(&serde_json::to_string(&card)?)?)
}
