//! Flow matching: from noise to actions, with a diffusion transformer that attends to the
//! encoder's memory.

use burn::module::Param;
use burn::prelude::*;
use burn::tensor::TensorData;
use burn::tensor::activation::{gelu_approximate, silu};
use burn::tensor::module::layer_norm;

use super::attention::Attention;
use super::layer::{Embedding, LayerNorm, Linear, normal};
use super::shape::Shape;
use super::transformer::Memory;

/// Velocity of actions from noise at time 0 to data at time 1 (Lipman et al. 2023).
#[derive(Module, Debug)]
pub struct Flow {
    action_in: Linear,
    place: Embedding,
    time1: Linear,
    time2: Linear,
    /// Has another name in files of weights; see `weights::name_of`.
    modulation: Linear,
    layers: Vec<FlowLayer>,
    norm: LayerNorm,
    action_out: Linear,
    steps: usize,
}

impl Flow {
    /// With random weights.
    #[must_use]
    pub fn new(shape: &Shape, device: &Device) -> Self {
        let dim = shape.dim;
        let layers = (0..shape.flow_layers).map(|_| FlowLayer::new(shape, device));
        Self {
            action_in: Linear::new(shape.action, dim, device),
            place: Embedding::new(shape.chunk, dim, 1.0, device),
            time1: Linear::new(dim, dim, device),
            time2: Linear::new(dim, dim, device),
            modulation: Linear::zero(dim, 9 * dim, device),
            layers: layers.collect(),
            norm: LayerNorm::new(dim, device),
            action_out: Linear::zero(dim, shape.action, device),
            steps: shape.flow_steps,
        }
    }

    /// Actions, batch × chunk × action, from noise of that shape, by Euler steps.
    #[must_use]
    pub fn actions(&self, noise: Tensor<3>, memory: Memory) -> Tensor<3> {
        let steps = 0..self.steps;
        steps.fold(noise, |x, step| {
            let time = step as f64 / self.steps as f64;
            let velocity = self.velocity(x.clone(), time, &memory);
            x + velocity / self.steps as f64
        })
    }

    /// Velocity at one time, 0 to 1.
    fn velocity(&self, actions: Tensor<3>, time: f64, memory: &Memory) -> Tensor<3> {
        let [batch, _, _] = actions.dims();
        let device = actions.device();
        let place = self.place.weight.val();
        let dim = place.dims()[1];
        let modulation = self.time1.forward(of_time(time, dim, &device));
        let modulation = self
            .modulation
            .forward(silu(self.time2.forward(silu(modulation))));
        let modulation = modulation.reshape([9, dim]);
        let mut x = self.action_in.forward(actions) + place.unsqueeze_dim::<3>(0);
        for layer in &self.layers {
            x = layer.forward(x, memory, modulation.clone());
        }
        debug_assert_eq!(x.dims()[0], batch);
        self.action_out.forward(self.norm.forward(x))
    }
}

/// Cosines and sines of a time, 1 × dim.
fn of_time(time: f64, dim: usize, device: &Device) -> Tensor<2> {
    let half = dim / 2;
    // In single precision as in PyTorch: the angles reach 1000.
    let rates = (0..half).map(|i| (i as f32 * (-(1e4_f64.ln()) / half as f64) as f32).exp());
    let angles: Vec<f32> = rates.map(|rate| 1000.0 * time as f32 * rate).collect();
    let waves = angles.iter().map(|a| a.cos());
    let waves: Vec<f32> = waves.chain(angles.iter().map(|a| a.sin())).collect();
    Tensor::from_data(TensorData::new(waves, [1, dim]), device)
}

/// A layer of the transformer. All layers share the modulation by time; each adds a table of its
/// own (Chen et al. 2023, PixArt).
#[derive(Module, Debug)]
struct FlowLayer {
    self_attn: Attention,
    cross_attn: Attention,
    linear1: Linear,
    linear2: Linear,
    table: Param<Tensor<2>>,
}

impl FlowLayer {
    fn new(shape: &Shape, device: &Device) -> Self {
        let dim = shape.dim;
        Self {
            self_attn: Attention::new(dim, shape.heads, device),
            cross_attn: Attention::new(dim, shape.heads, device),
            linear1: Linear::new(dim, shape.feedforward, device),
            linear2: Linear::new(shape.feedforward, dim, device),
            table: normal([9, dim], 1.0 / (dim as f64).sqrt(), device),
        }
    }

    /// `modulation` 9 × dim: shift, scale and gate of the three parts.
    fn forward(&self, x: Tensor<3>, memory: &Memory, modulation: Tensor<2>) -> Tensor<3> {
        let modulation = modulation + self.table.val();
        let dim = modulation.dims()[1];
        let part = |k: usize| modulation.clone().narrow(0, k, 1).reshape([1, 1, dim]);
        let device = x.device();
        let norm = |x: Tensor<3>, k: usize| {
            let normed = layer_norm(x, Tensor::ones([dim], &device), None, 1e-5);
            normed * (part(k + 1) + 1.0) + part(k)
        };
        let y = norm(x.clone(), 0);
        let y = self.self_attn.forward(y.clone(), y.clone(), y, None);
        let x = x + part(2) * y;
        let y = self.cross_attn.forward(
            norm(x.clone(), 3),
            memory.positioned.clone(),
            memory.tokens.clone(),
            None,
        );
        let x = x + part(5) * y;
        let y = gelu_approximate(self.linear1.forward(norm(x.clone(), 6)));
        x + part(8) * self.linear2.forward(y)
    }
}
