//! A trained policy: observations in, rows of actions out.

use std::path::Path;

use anyhow::{Context, ensure};
use burn::prelude::*;
use burn::tensor::TensorData;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use wheelarm_policy::ActionKind;
use wheelarm_proto::v1;
use wheelarm_sdk::policy::PolicyService;

use crate::card::Card;
use crate::image;
use crate::language::Vocabulary;
use crate::network::{Inputs, Kind, Network, Words};
use crate::weights::WeightsFile;

/// Most observations of one forward pass.
const MAX_BATCH: u32 = 16;

/// A network with its card, which replies to observations.
#[derive(Debug)]
pub struct Trained {
    network: Network,
    card: Card,
    spec: v1::PolicySpec,
    vocabulary: Vocabulary,
    hidden: Vec<bool>,
    device: Device,
}

impl Trained {
    /// Reads a policy.
    ///
    /// # Errors
    /// When the file is not a policy, or its weights do not fit its card.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let file = WeightsFile::read(path)?;
        let text = file.card.with_context(|| {
            format!(
                "{} has no model card: use a policy of python/train.py, python/export.py or wheelarm-learn",
                path.display()
            )
        })?;
        let mut card = Card::parse(&text).with_context(|| path.display().to_string())?;
        // The latent's encoder is stored only for further training.
        card.network.vae_layers = 0;
        let device = Device::flex();
        let network = Network::new(&card.network, &device);
        let network = file.weights.into_network(network);
        let network = network.with_context(|| path.display().to_string())?;
        Self::new(network, card, file.sha256)
    }

    /// From a network, on the device of its weights, and its card.
    ///
    /// # Errors
    /// When a policy cannot have the card's actions.
    pub fn new(network: Network, card: Card, sha256: String) -> anyhow::Result<Self> {
        let hidden = card.state.names.iter();
        Ok(Self {
            vocabulary: Vocabulary::new(&card.vocabulary),
            hidden: hidden.map(|n| card.state.hidden.contains(n)).collect(),
            spec: spec(&card, sha256)?,
            device: network.devices().first().cloned().unwrap_or(Device::flex()),
            network,
            card,
        })
    }

    /// Its card.
    #[must_use]
    pub fn card(&self) -> &Card {
        &self.card
    }

    /// Checks an observation; its newest step.
    fn check<'a>(
        &self,
        observation: &'a v1::PolicyObservation,
    ) -> anyhow::Result<&'a v1::PolicyStep> {
        let step = observation.steps.last().context("it has no steps")?;
        let expected = self.card.state.names.len();
        ensure!(
            step.state_values.len() == expected,
            "its state has {} numbers, expected {expected}",
            step.state_values.len()
        );
        let names = self.card.state.names.iter();
        if let Some((name, value)) = names.zip(&step.state_values).find(|(_, v)| !v.is_finite()) {
            anyhow::bail!("{name} is {value}");
        }
        ensure!(
            step.images.len() == self.card.cameras.len(),
            "it has {} images, expected {}",
            step.images.len(),
            self.card.cameras.len()
        );
        for (image, camera) in step.images.iter().zip(&self.card.cameras) {
            ensure!(
                image.camera == camera.name,
                "an image of {:?}, expected one of {:?}",
                image.camera,
                camera.name
            );
            let size = [image.width as usize, image.height as usize];
            ensure!(
                size == [camera.width, camera.height],
                "the image of {} is {}x{}, expected {}x{}",
                camera.name,
                size[0],
                size[1],
                camera.width,
                camera.height
            );
            let bytes = camera.width * camera.height * 3;
            ensure!(
                image.color.len() == bytes,
                "the image of {} has {} bytes, expected {bytes}",
                camera.name,
                image.color.len()
            );
        }
        Ok(step)
    }

    /// Rows of one observation, chunk × action in their units; a flow starts from `noise`.
    ///
    /// # Errors
    /// When the observation does not fit.
    pub fn answer(
        &self,
        observation: &v1::PolicyObservation,
        noise: &[f32],
    ) -> anyhow::Result<Vec<f32>> {
        let step = self.check(observation)?;
        let shape = &self.card.network;
        let count = shape.chunk * shape.action;
        ensure!(
            noise.len() == count,
            "{} numbers of noise, expected {count}",
            noise.len()
        );
        let rows = self.rows(&[(observation, step)], &|_, _| noise.to_vec());
        rows.into_iter().next().context("no rows")
    }

    /// Rows of every observation, in their units; all have been checked. A flow starts from the
    /// noise of seed and tick.
    fn rows(
        &self,
        observations: &[(&v1::PolicyObservation, &v1::PolicyStep)],
        noise: &dyn Fn(u64, u64) -> Vec<f32>,
    ) -> Vec<Vec<f32>> {
        let (shape, batch) = (&self.card.network, observations.len());
        let images = observations.iter().flat_map(|(_, step)| &step.images);
        let images: Vec<&[u8]> = images.map(|p| p.color.as_ref()).collect();
        let states = observations.iter().flat_map(|(_, step)| self.state(step));
        let states = TensorData::new(states.collect::<Vec<_>>(), [batch, shape.state]);
        let sentences = observations.iter().map(|(s, _)| s.instruction.as_str());
        let words = (shape.words > 0).then(|| match shape.text_layers {
            0 => {
                let shares = sentences.flat_map(|sentence| self.vocabulary.shares(sentence));
                let shares = TensorData::new(shares.collect::<Vec<_>>(), [batch, shape.words]);
                Words::Shares(Tensor::from_data(shares, &self.device))
            }
            _ => Words::InOrder(
                sentences
                    .map(|sentence| self.vocabulary.in_order(sentence))
                    .collect(),
            ),
        });
        let noise = (shape.kind == Kind::Flow).then(|| {
            let noise = observations.iter().flat_map(|(s, _)| noise(s.seed, s.tick));
            let noise: Vec<f32> = noise.collect();
            let noise = TensorData::new(noise, [batch, shape.chunk, shape.action]);
            Tensor::from_data(noise, &self.device)
        });
        let inputs = Inputs {
            images: image::to_tensor(&self.card, &images, &self.device),
            state: Tensor::from_data(states, &self.device),
            words,
        };
        let found = self.network.forward(inputs, noise).into_data();
        let found: Vec<f32> = found.convert::<f32>().try_into_vec().unwrap_or_default();
        let action = &self.card.action;
        let scaled = |row: &[f32]| -> Vec<f32> {
            let numbers = row.iter().zip(&action.mean).zip(&action.std);
            numbers.map(|((v, mean), std)| v * std + mean).collect()
        };
        let each = found.chunks(shape.chunk * shape.action);
        each.map(|rows| rows.chunks(shape.action).flat_map(scaled).collect())
            .collect()
    }

    /// The state as the network's input: standardized, 0 for hidden numbers.
    fn state(&self, step: &v1::PolicyStep) -> Vec<f32> {
        let state = &self.card.state;
        let numbers = step.state_values.iter().zip(&state.mean);
        let numbers = numbers.zip(&state.std).zip(&self.hidden);
        numbers
            .map(|(((&v, mean), std), &hidden)| match hidden {
                true => 0.0,
                false => (v as f32 - mean) / std,
            })
            .collect()
    }
}

/// Standard normal numbers that follow from seed and tick alone (Box and Muller).
pub(crate) fn noise(seed: u64, tick: u64, count: usize) -> Vec<f32> {
    use rand::RngExt;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(tick);
    let mut sample = || {
        let (u, v): (f64, f64) = (random.random(), random.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    };
    (0..count).map(|_| sample() as f32).collect()
}

fn spec(card: &Card, sha256: String) -> anyhow::Result<v1::PolicySpec> {
    let action = match card.action_kind()? {
        ActionKind::NextPose => v1::PolicyAction::NextPose,
        ActionKind::NextJoints => v1::PolicyAction::NextJoints,
        ActionKind::Applied => anyhow::bail!(
            "a policy cannot have actions of the kind `applied`; train it on next-pose or next-joints"
        ),
    };
    let cameras = card.cameras.iter().map(|camera| v1::PolicyCamera {
        name: camera.name.clone(),
        width: camera.width as u32,
        height: camera.height as u32,
        depth: camera.depth,
    });
    Ok(v1::PolicySpec {
        name: card.name.clone(),
        weights_sha256: sha256,
        cameras: cameras.collect(),
        state_names: card.state.names.clone(),
        history: card.history as u32,
        rate_hz: card.rate_hz,
        chunk: card.chunk as u32,
        execute: card.execute as u32,
        action: action.into(),
        action_names: card.action.names.clone(),
        max_batch: MAX_BATCH,
        stochastic: card.stochastic,
        // The validation seeds selected the checkpoint, so they are not test seeds either.
        training_seeds: ranges(card.training_seeds.iter().chain(&card.validation_seeds)),
    })
}

/// Ranges of consecutive seeds.
fn ranges<'a>(seeds: impl Iterator<Item = &'a u64>) -> Vec<v1::SeedRange> {
    let mut seeds: Vec<u64> = seeds.copied().collect();
    seeds.sort_unstable();
    seeds.dedup();
    let mut out: Vec<v1::SeedRange> = Vec::new();
    for first in seeds {
        match out.last_mut() {
            Some(last) if last.end == first => last.end += 1,
            _ => out.push(v1::SeedRange {
                first,
                end: first.saturating_add(1),
            }),
        }
    }
    out
}

impl PolicyService for Trained {
    fn spec(&self) -> v1::PolicySpec {
        self.spec.clone()
    }

    fn reset(&mut self, _: &v1::PolicyResetRequest) {}

    fn infer(&mut self, request: &v1::InferRequest) -> v1::InferReply {
        let observations: Vec<_> = request.observations.iter().collect();
        let checked: Vec<_> = observations.iter().map(|s| self.check(s)).collect();
        let fit = observations.iter().zip(&checked);
        let fit = fit.filter_map(|(s, m)| m.as_ref().ok().map(|m| (*s, *m)));
        let fit: Vec<_> = fit.collect();
        let count = self.card.network.chunk * self.card.network.action;
        let mut rows = Vec::with_capacity(fit.len());
        for part in fit.chunks(MAX_BATCH as usize) {
            rows.append(&mut self.rows(part, &|seed, tick| noise(seed, tick, count)));
        }
        let mut rows = rows.into_iter();
        let chunks = observations
            .iter()
            .zip(&checked)
            .map(|(observation, checked)| {
                let mut chunk = v1::PolicyChunk {
                    episode_key: observation.episode_key.clone(),
                    tick: observation.tick,
                    ..v1::PolicyChunk::default()
                };
                match checked {
                    Err(problem) => {
                        chunk.problem = format!("the observation does not fit: {problem}")
                    }
                    Ok(_) => {
                        chunk.rows = self.card.chunk as u32;
                        chunk.values = rows.next().unwrap_or_default();
                    }
                }
                chunk
            });
        v1::InferReply {
            chunks: chunks.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_become_ranges() {
        let found = ranges([7, 3, 4, 5, 9, 4].iter());
        let found: Vec<_> = found.iter().map(|r| (r.first, r.end)).collect();
        assert_eq!(found, [(3, 6), (7, 8), (9, 10)]);
    }

    #[test]
    fn noise_is_standard_normal_and_follows_from_seed_and_tick() {
        let all = noise(3, 240, 20_000);
        assert_eq!(all, noise(3, 240, 20_000));
        assert_ne!(all[..9], noise(3, 264, 9)[..]);
        assert_ne!(all[..9], noise(4, 240, 9)[..]);
        let mean = |f: fn(f32) -> f32| all.iter().map(|&v| f(v)).sum::<f32>() / 20_000.0;
        assert!(mean(|v| v).abs() < 0.03 && (mean(|v| v * v) - 1.0).abs() < 0.05);
    }
}
