//! Gradients in double precision equal central differences, in every tensor of both networks and
//! with all norms.

use std::sync::OnceLock;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::prelude::*;
use burn::tensor::{Distribution, FloatDType, Gradients, TensorData};
use wheelarm_learn::network::{Inputs, Kind, Network, NormKind, Shape, Words};

/// Step of the differences.
const STEP: f64 = 1e-6;
/// Tested numbers of each tensor.
const TRIED: usize = 2;

/// The type of numbers of a device is set once per process.
fn device() -> Device {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    let device = DEVICE.get_or_init(|| {
        let mut device = Device::flex();
        device.configure(FloatDType::F64).expect("double precision");
        device
    });
    device.clone().autodiff()
}

fn tiny() -> Shape {
    Shape {
        state: 5,
        action: 4,
        chunk: 3,
        cameras: 1,
        words: 3,
        word_width: 4,
        width: 2,
        group_channels: 1,
        dim: 8,
        feedforward: 6,
        heads: 2,
        encoder_layers: 1,
        vae_layers: 1,
        latent: 2,
        flow_layers: 1,
        flow_steps: 2,
        ..Shape::default()
    }
}

/// Moves every number slightly, so that none is 0 by design.
struct Stir;

impl ModuleMapper for Stir {
    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let needs = parameter.val().is_require_grad();
        parameter.map(|tensor| {
            let more = tensor.random_like(Distribution::Uniform(0.05, 0.3));
            let tensor = (tensor + more).detach();
            if needs { tensor.require_grad() } else { tensor }
        })
    }
}

/// Adds to one number of one tensor.
struct Bump {
    tensor: usize,
    number: usize,
    by: f64,
    at: usize,
}

impl ModuleMapper for Bump {
    fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let at = self.at;
        self.at += 1;
        if at != self.tensor {
            return parameter;
        }
        parameter.map(|tensor| {
            let (shape, device) = (tensor.dims(), tensor.device());
            let mut numbers: Vec<f64> = tensor.into_data().try_into_vec().expect("f64");
            numbers[self.number] += self.by;
            Tensor::from_data(TensorData::new(numbers, shape), &device).require_grad()
        })
    }
}

/// Gradients by tensor, in the order of the parameters; `None` for constants.
struct Read<'a> {
    gradients: &'a Gradients,
    path: Vec<String>,
    found: Vec<(String, Option<Vec<f64>>)>,
}

impl ModuleVisitor for Read<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        let gradient = parameter.val().grad(self.gradients);
        let numbers = gradient.map(|g| g.into_data().try_into_vec().expect("f64"));
        self.found.push((self.path.join("."), numbers));
    }
}

fn check(shape: &Shape) {
    let device = device();
    device.seed(3);
    let mut network = Network::new(shape, &device).map(&mut Stir);
    let random = |size: [usize; 2]| Tensor::<2>::random(size, Distribution::Default, &device);
    let (images, state, words) = (random([2, 3 * 32 * 64]), random([2, 5]), random([2, 3]));
    let (actions, noise) = (random([2, 12]), random([2, 2]));
    let padding = Tensor::<2>::from_data([[0.0, 0.0, 0.0], [0.0, 1.0, 1.0]], &device);
    let loss = |network: &Network| -> Tensor<1> {
        let inputs = Inputs {
            images: images.clone().reshape([2, 3, 32, 64]),
            state: state.clone(),
            words: Some(Words::Shares(words.clone())),
        };
        let wanted = actions.clone().reshape([2, 3, 4]);
        if shape.kind == Kind::Flow {
            let found = network.forward(inputs, Some(wanted.clone() - 0.5));
            return (found - wanted).square().sum();
        }
        let padding = padding.clone().greater_elem(0.5);
        let (found, latent) =
            network.forward_training(inputs, wanted.clone(), padding, noise.clone());
        (found - wanted).square().sum() + latent.divergence()
    };
    let gradients = loss(&network).backward();
    let mut read = Read {
        gradients: &gradients,
        path: Vec::new(),
        found: Vec::new(),
    };
    network.visit(&mut read);
    let (mut worst, mut tried) = (0.0_f64, 0);
    for (tensor, (name, gradient)) in read.found.into_iter().enumerate() {
        let is_norm = name.contains("bn") || name.contains("downsample.norm");
        let frozen = shape.norm == NormKind::FrozenBatch && is_norm;
        let Some(gradient) = gradient else {
            assert!(frozen, "{name} has no gradient");
            continue;
        };
        assert!(!frozen, "{name} is constant");
        for k in 0..TRIED.min(gradient.len()) {
            let number = k * (gradient.len() - 1) / (TRIED - 1);
            let mut at = |by: f64| {
                let bump = &mut Bump {
                    tensor,
                    number,
                    by,
                    at: 0,
                };
                network = network.clone().map(bump);
                loss(&network).into_scalar::<f64>()
            };
            let (up, down) = (at(STEP), at(-2.0 * STEP));
            at(STEP);
            let difference = (up - down) / (2.0 * STEP);
            let scale = 1.0 + difference.abs().max(gradient[number].abs());
            let error = (difference - gradient[number]).abs() / scale;
            assert!(
                error < 1e-5,
                "{name}[{number}]: gradient {}, difference {difference}",
                gradient[number]
            );
            worst = worst.max(error);
            tried += 1;
        }
    }
    println!(
        "{:?} {:?}: {tried} numbers, worst {worst:e}",
        shape.kind, shape.norm
    );
    assert!(tried > 120, "{tried}");
}

#[test]
fn gradients_of_act_are_central_differences() {
    check(&tiny());
}

#[test]
fn gradients_with_frozen_norms_are_central_differences() {
    check(&Shape {
        norm: NormKind::FrozenBatch,
        ..tiny()
    });
}

#[test]
fn gradients_through_a_flow_are_central_differences() {
    check(&Shape {
        kind: Kind::Flow,
        ..tiny()
    });
}
