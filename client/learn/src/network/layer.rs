//! Layers with PyTorch's names and layout.

use burn::module::Param;
use burn::prelude::*;
use burn::tensor::Distribution;
use burn::tensor::module::{layer_norm, linear};

use super::shape::{NormKind, Shape};

/// Added to variances, as PyTorch does.
const EPSILON: f64 = 1e-5;

pub(super) fn uniform<const D: usize>(
    shape: [usize; D],
    bound: f64,
    device: &Device,
) -> Param<Tensor<D>> {
    Param::from_tensor(Tensor::random(
        shape,
        Distribution::Uniform(-bound, bound),
        device,
    ))
}

pub(super) fn normal<const D: usize>(
    shape: [usize; D],
    deviation: f64,
    device: &Device,
) -> Param<Tensor<D>> {
    Param::from_tensor(Tensor::random(
        shape,
        Distribution::Normal(0.0, deviation),
        device,
    ))
}

pub(super) fn filled(count: usize, value: f64, device: &Device) -> Param<Tensor<1>> {
    Param::from_tensor(Tensor::full([count], value, device))
}

/// Bound of Xavier's uniform distribution.
pub(super) fn xavier(inputs: usize, outputs: usize) -> f64 {
    (6.0 / (inputs + outputs) as f64).sqrt()
}

/// An affine layer.
#[derive(Module, Debug)]
pub struct Linear {
    /// Outputs × inputs.
    pub weight: Param<Tensor<2>>,
    /// Outputs.
    pub bias: Param<Tensor<1>>,
}

impl Linear {
    /// With random weights as in PyTorch.
    #[must_use]
    pub fn new(inputs: usize, outputs: usize, device: &Device) -> Self {
        Self::bounded(inputs, outputs, 1.0 / (inputs as f64).sqrt(), device)
    }

    /// With random weights up to `bound`.
    #[must_use]
    pub fn bounded(inputs: usize, outputs: usize, bound: f64, device: &Device) -> Self {
        Self {
            weight: uniform([outputs, inputs], bound, device),
            bias: uniform([outputs], 1.0 / (inputs as f64).sqrt(), device),
        }
    }

    /// With weights 0.
    pub(super) fn zero(inputs: usize, outputs: usize, device: &Device) -> Self {
        Self {
            weight: Param::from_tensor(Tensor::zeros([outputs, inputs], device)),
            bias: filled(outputs, 0.0, device),
        }
    }

    /// Maps the last dimension from inputs to outputs.
    #[must_use]
    pub fn forward<const D: usize>(&self, x: Tensor<D>) -> Tensor<D> {
        linear(x, self.weight.val().transpose(), Some(self.bias.val()))
    }
}

/// A table of vectors.
#[derive(Module, Debug)]
pub struct Embedding {
    /// Rows × numbers of a row.
    pub weight: Param<Tensor<2>>,
}

impl Embedding {
    /// With normal random numbers of this deviation.
    #[must_use]
    pub fn new(rows: usize, width: usize, deviation: f64, device: &Device) -> Self {
        Self {
            weight: normal([rows, width], deviation, device),
        }
    }
}

/// Norm over the last dimension.
#[derive(Module, Debug)]
pub(super) struct LayerNorm {
    weight: Param<Tensor<1>>,
    bias: Param<Tensor<1>>,
}

impl LayerNorm {
    pub fn new(width: usize, device: &Device) -> Self {
        Self {
            weight: filled(width, 1.0, device),
            bias: filled(width, 0.0, device),
        }
    }

    pub fn forward<const D: usize>(&self, x: Tensor<D>) -> Tensor<D> {
        layer_norm(x, self.weight.val(), Some(self.bias.val()), EPSILON)
    }
}

/// Norm of a ResNet's channels: group norm, or batch norm with constant statistics.
#[derive(Module, Debug)]
pub struct ChannelNorm {
    weight: Param<Tensor<1>>,
    bias: Param<Tensor<1>>,
    running_mean: Option<Param<Tensor<1>>>,
    running_var: Option<Param<Tensor<1>>>,
    groups: usize,
}

impl ChannelNorm {
    /// For this number of channels.
    #[must_use]
    pub fn new(shape: &Shape, channels: usize, device: &Device) -> Self {
        let frozen = shape.norm == NormKind::FrozenBatch;
        let constant = |value| filled(channels, value, device).set_require_grad(false);
        let parameter = |value| match frozen {
            true => constant(value),
            false => filled(channels, value, device),
        };
        Self {
            weight: parameter(1.0),
            bias: parameter(0.0),
            running_mean: frozen.then(|| constant(0.0)),
            running_var: frozen.then(|| constant(1.0)),
            groups: (channels / shape.group_channels).max(1),
        }
    }

    /// Batch × channels × height × width.
    #[must_use]
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let [batch, channels, height, width] = x.dims();
        let each = |v: Tensor<1>| v.reshape([1, channels, 1, 1]);
        if let (Some(mean), Some(variance)) = (&self.running_mean, &self.running_var) {
            let scale = self.weight.val() / (variance.val() + EPSILON).sqrt();
            let shift = self.bias.val() - mean.val() * scale.clone();
            return x * each(scale) + each(shift);
        }
        let grouped = x.reshape([batch, self.groups, channels / self.groups * height * width]);
        let mean = grouped.clone().mean_dim(2);
        let centred = grouped - mean;
        let variance = centred.clone().square().mean_dim(2);
        let normed = centred / (variance + EPSILON).sqrt();
        let normed = normed.reshape([batch, channels, height, width]);
        normed * each(self.weight.val()) + each(self.bias.val())
    }
}
