//! The training loop: it reduces the error, continues from a checkpoint with the same bits, and
//! ends without progress.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use burn::module::Module;
use burn::prelude::*;
use burn::tensor::TensorData;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use wheelarm_learn::network::Linear;
use wheelarm_learn::train::{self, Progress, Schedule, TrainingTask};
use wheelarm_learn::weights::{Weights, WeightsFile};

/// The process has one generator of random numbers: these tests run one at a time.
static GENERATOR: Mutex<()> = Mutex::new(());

fn lock_generator() -> MutexGuard<'static, ()> {
    GENERATOR.lock().unwrap_or_else(PoisonError::into_inner)
}

const BATCH: usize = 8;

/// The line y = 2 x + 1 by a layer with `outputs` equal outputs.
struct Line {
    outputs: usize,
}

impl Line {
    fn network(&self) -> Linear {
        let device = Device::flex().autodiff();
        device.seed(1);
        Linear::new(1, self.outputs, &device)
    }

    fn error(&self, network: &Linear, seed: u64, device: &Device) -> Tensor<1> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let x: Vec<f32> = (0..BATCH).map(|_| random.random_range(-1.0..1.0)).collect();
        let x = Tensor::<2>::from_data(TensorData::new(x, [BATCH, 1]), device);
        let wanted = (x.clone() * 2.0 + 1.0).expand([BATCH, self.outputs]);
        (network.forward(x) - wanted).square().mean()
    }
}

impl TrainingTask for Line {
    type Network = Linear;

    fn loss(&self, network: &Linear, step: u64) -> (Tensor<1>, Vec<(&'static str, f64)>) {
        let loss = self.error(network, step, &Device::flex().autodiff());
        let value = loss.clone().into_scalar::<f64>();
        (loss, vec![("square", value)])
    }

    fn validate(&self, network: &Linear) -> Option<f64> {
        let error = self.error(network, u64::MAX, &Device::flex());
        Some(error.into_scalar::<f64>())
    }

    fn rate(&self, _: u64) -> f64 {
        0.05
    }

    fn keep(&self, network: &Linear, _: &Progress, folder: &Path) -> anyhow::Result<()> {
        Ok(Weights::of_network(network).write(&folder.join("line.safetensors"), None)?)
    }
}

fn schedule(out: &Path, steps: u64) -> Schedule {
    Schedule {
        out: out.to_owned(),
        steps,
        limit: None,
        interval: 20,
        patience: None,
        weight_decay: 0.0,
        clip: 10.0,
    }
}

#[test]
fn line_is_learned_and_the_best_weights_are_kept() {
    let _alone = lock_generator();
    let folder = tempfile::tempdir().expect("a folder");
    let line = Line { outputs: 1 };
    let before = line.validate(&line.network().valid()).expect("an error");
    let out = folder.path().join("run");
    let done = train::run(&line, line.network(), &schedule(&out, 300));
    let (network, progress) = done.expect("a run");
    assert!(progress.is_over && progress.step == 300);
    let after = line.validate(&network.valid()).expect("an error");
    assert!(after < 0.01 * before, "{before} became {after}");
    let curves = std::fs::metadata(out.join("curves.png")).expect("curves");
    assert!(curves.len() > 1000);
    let kept = WeightsFile::read(&out.join("line.safetensors")).expect("weights");
    let (_, weight) = kept.weights.get("weight").expect("the weight");
    assert!((weight[0] - 2.0).abs() < 0.1, "{weight:?}");
}

#[test]
fn interrupted_run_continues_with_the_same_bits() {
    let _alone = lock_generator();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let weights = |out: &Path, cuts: bool| {
        let line = Line { outputs: 1 };
        if cuts {
            let cut = Schedule {
                limit: Some(Duration::ZERO),
                ..schedule(out, 40)
            };
            for made in 1..=2 {
                let (_, progress) = train::run(&line, line.network(), &cut).expect("a run");
                assert_eq!((progress.step, progress.is_over), (made, false));
            }
        }
        let done = train::run(&line, line.network(), &schedule(out, 40));
        let (network, progress) = done.expect("a run");
        assert_eq!((progress.step, progress.log.len()), (40, 2));
        Weights::of_network(&network.valid())
    };
    let whole = weights(&folder.join("whole"), false);
    let pieces = weights(&folder.join("pieces"), true);
    assert!(whole == pieces, "the same bits");
    // A checkpoint of another network is rejected.
    let other = Line { outputs: 2 };
    let refused = train::run(
        &other,
        other.network(),
        &schedule(&folder.join("whole"), 80),
    );
    let words = refused.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(words.contains("choose another folder"), "{words}");
}

#[test]
fn run_without_progress_ends() {
    let _alone = lock_generator();
    let folder = tempfile::tempdir().expect("a folder");
    let line = Line { outputs: 1 };
    let stuck = Schedule {
        interval: 1,
        patience: Some(2),
        // A gradient of zero: no progress.
        clip: 0.0,
        ..schedule(&folder.path().join("run"), 400)
    };
    let (_, progress) = train::run(&line, line.network(), &stuck).expect("a run");
    assert!(progress.is_over && progress.step < 10, "{}", progress.step);
}
