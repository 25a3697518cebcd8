//! A trained policy at work: observations in, rows of action out.

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
use crate::language::Vocabulary;
use crate::network::{Inputs, Kind, Network, Words};
use crate::picture;
use crate::weights::WeightsFile;

/// Observations that one request may hold.
const MAX_BATCH: u32 = 16;

/// A network with its card.
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
    /// When the file is none, or its weights do not fit its card.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let file = WeightsFile::read(path)?;
        let text = file.card.with_context(|| {
            format!(
                "{} has no model card: policies are written by python/train.py, python/export.py and wheelarm-learn",
                path.display()
            )
        })?;
        let mut card = Card::parse(&text).with_context(|| path.display().to_string())?;
        // What is stored for PyTorch to go on with is not needed here.
        card.network.vae_layers = 0;
        let device = Device::flex();
        let network = Network::new(&card.network, &device);
        let network = file.weights.into_network(network);
        let network = network.with_context(|| path.display().to_string())?;
        Self::new(network, card, file.sha256)
    }

    /// Of a network on the device of its weights, and its card.
    ///
    /// # Errors
    /// When the card says what cannot be served.
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

    /// What is wrong with an observation, or its newest moment.
    fn moment<'a>(&self, seen: &'a v1::PolicyObservation) -> anyhow::Result<&'a v1::PolicyStep> {
        let moment = seen.steps.last().context("there is no moment in it")?;
        let expected = self.card.state.names.len();
        ensure!(
            moment.state_values.len() == expected,
            "its state has {} numbers, expected {expected}",
            moment.state_values.len()
        );
        let names = self.card.state.names.iter();
        if let Some((name, value)) = names
            .zip(&moment.state_values)
            .find(|(_, v)| !v.is_finite())
        {
            anyhow::bail!("{name} is {value}");
        }
        ensure!(
            moment.images.len() == self.card.cameras.len(),
            "it has {} pictures, expected {}",
            moment.images.len(),
            self.card.cameras.len()
        );
        for (picture, camera) in moment.images.iter().zip(&self.card.cameras) {
            ensure!(
                picture.camera == camera.name,
                "a picture of {:?} where one of {:?} belongs",
                picture.camera,
                camera.name
            );
            let size = [picture.width as usize, picture.height as usize];
            ensure!(
                size == [camera.width, camera.height],
                "the picture of {} is {}x{}, expected {}x{}",
                camera.name,
                size[0],
                size[1],
                camera.width,
                camera.height
            );
            let bytes = camera.width * camera.height * 3;
            ensure!(
                picture.color.len() == bytes,
                "the picture of {} has {} bytes, expected {bytes}",
                camera.name,
                picture.color.len()
            );
        }
        Ok(moment)
    }

    /// The rows of one observation, a flow's from a noise of the caller's.
    ///
    /// # Errors
    /// When the observation does not fit.
    pub fn answer(&self, seen: &v1::PolicyObservation, noise: &[f32]) -> anyhow::Result<Vec<f32>> {
        let moment = self.moment(seen)?;
        let shape = &self.card.network;
        let count = shape.chunk * shape.action;
        ensure!(
            noise.len() == count,
            "{} numbers of noise, expected {count}",
            noise.len()
        );
        let rows = self.rows(&[(seen, moment)], &|_, _| noise.to_vec());
        rows.into_iter().next().context("no answer")
    }

    /// Rows of every observation, in their units; all have been checked. A flow
    /// starts from the noise of seed and tick.
    fn rows(
        &self,
        seen: &[(&v1::PolicyObservation, &v1::PolicyStep)],
        noise: &dyn Fn(u64, u64) -> Vec<f32>,
    ) -> Vec<Vec<f32>> {
        let (shape, batch) = (&self.card.network, seen.len());
        let pictures = seen.iter().flat_map(|(_, moment)| &moment.images);
        let pictures: Vec<&[u8]> = pictures.map(|p| p.color.as_ref()).collect();
        let states = seen.iter().flat_map(|(_, moment)| self.state(moment));
        let states = TensorData::new(states.collect::<Vec<_>>(), [batch, shape.state]);
        let sentences = seen.iter().map(|(s, _)| s.instruction.as_str());
        let words = (shape.words > 0).then(|| match shape.text_layers {
            0 => {
                let shares = sentences.flat_map(|told| self.vocabulary.shares(told));
                let shares = TensorData::new(shares.collect::<Vec<_>>(), [batch, shape.words]);
                Words::Shares(Tensor::from_data(shares, &self.device))
            }
            _ => Words::InOrder(
                sentences
                    .map(|told| self.vocabulary.in_order(told))
                    .collect(),
            ),
        });
        let noise = (shape.kind == Kind::Flow).then(|| {
            let noise = seen.iter().flat_map(|(s, _)| noise(s.seed, s.tick));
            let noise: Vec<f32> = noise.collect();
            let noise = TensorData::new(noise, [batch, shape.chunk, shape.action]);
            Tensor::from_data(noise, &self.device)
        });
        let inputs = Inputs {
            pictures: picture::numbers(&self.card, &pictures, &self.device),
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

    /// The state as the network was trained with.
    fn state(&self, moment: &v1::PolicyStep) -> Vec<f32> {
        let state = &self.card.state;
        let numbers = moment.state_values.iter().zip(&state.mean);
        let numbers = numbers.zip(&state.std).zip(&self.hidden);
        numbers
            .map(|(((&v, mean), std), &hidden)| match hidden {
                true => 0.0,
                false => (v as f32 - mean) / std,
            })
            .collect()
    }
}

/// Standard normal numbers that seed and tick alone decide (Box and Muller).
pub(crate) fn noise(seed: u64, tick: u64, count: usize) -> Vec<f32> {
    use rand::RngExt;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(tick);
    let mut draw = || {
        let (u, v): (f64, f64) = (random.random(), random.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    };
    (0..count).map(|_| draw() as f32).collect()
}

fn spec(card: &Card, sha256: String) -> anyhow::Result<v1::PolicySpec> {
    let action = match card.action_kind()? {
        ActionKind::NextPose => v1::PolicyAction::NextPose,
        ActionKind::NextJoints => v1::PolicyAction::NextJoints,
        ActionKind::Applied => anyhow::bail!("nobody plays what was applied"),
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
        // What chose among checkpoints was seen too.
        training_seeds: ranges(card.training_seeds.iter().chain(&card.validation_seeds)),
    })
}

/// Runs of seeds.
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
        let seen: Vec<_> = request.observations.iter().collect();
        let checked: Vec<_> = seen.iter().map(|s| self.moment(s)).collect();
        let fit = seen.iter().zip(&checked);
        let fit = fit.filter_map(|(s, m)| m.as_ref().ok().map(|m| (*s, *m)));
        let fit: Vec<_> = fit.collect();
        let count = self.card.network.chunk * self.card.network.action;
        let mut rows = Vec::with_capacity(fit.len());
        for part in fit.chunks(MAX_BATCH as usize) {
            rows.append(&mut self.rows(part, &|seed, tick| noise(seed, tick, count)));
        }
        let mut rows = rows.into_iter();
        let chunks = seen.iter().zip(&checked).map(|(seen, checked)| {
            let mut chunk = v1::PolicyChunk {
                episode_key: seen.episode_key.clone(),
                tick: seen.tick,
                ..v1::PolicyChunk::default()
            };
            match checked {
                Err(problem) => chunk.problem = format!("the observation does not fit: {problem}"),
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
    fn seeds_are_told_in_runs() {
        let told = ranges([7, 3, 4, 5, 9, 4].iter());
        let told: Vec<_> = told.iter().map(|r| (r.first, r.end)).collect();
        assert_eq!(told, [(3, 6), (7, 8), (9, 10)]);
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
