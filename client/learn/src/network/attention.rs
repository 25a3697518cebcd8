//! Attention with several heads, with the names of PyTorch's `MultiheadAttention`.

use burn::module::Param;
use burn::prelude::*;
use burn::tensor::activation::softmax;
use burn::tensor::module::linear;

use super::layer::{Linear, filled, uniform, xavier};

/// Queries, keys and values of batch × tokens × dim.
#[derive(Module, Debug)]
pub(super) struct Attention {
    in_proj_weight: Param<Tensor<2>>,
    in_proj_bias: Param<Tensor<1>>,
    out_proj: Linear,
    heads: usize,
}

impl Attention {
    pub fn new(dim: usize, heads: usize, device: &Device) -> Self {
        Self {
            in_proj_weight: uniform([3 * dim, dim], xavier(dim, 3 * dim), device),
            in_proj_bias: filled(3 * dim, 0.0, device),
            out_proj: Linear::bounded(dim, dim, xavier(dim, dim), device),
            heads,
        }
    }

    /// `hidden`: batch × keys, true for a key without attention.
    pub fn forward(
        &self,
        query: Tensor<3>,
        key: Tensor<3>,
        value: Tensor<3>,
        hidden: Option<Tensor<2, Bool>>,
    ) -> Tensor<3> {
        let [batch, tokens, dim] = query.dims();
        let (weight, bias) = (self.in_proj_weight.val(), self.in_proj_bias.val());
        let projected = |x: Tensor<3>, part: usize| {
            let part = part * dim..(part + 1) * dim;
            let weight = weight.clone().slice([part.clone()]).transpose();
            let x = linear(x, weight, Some(bias.clone().slice([part])));
            let count = x.dims()[1];
            x.reshape([batch, count, self.heads, dim / self.heads])
                .swap_dims(1, 2)
        };
        let (q, k, v) = (projected(query, 0), projected(key, 1), projected(value, 2));
        let keys = k.dims()[2];
        let scale = ((dim / self.heads) as f64).sqrt();
        let mut scores = q.matmul(k.swap_dims(2, 3)) / scale;
        if let Some(hidden) = hidden {
            let hidden = hidden.reshape([batch, 1, 1, keys]);
            let hidden = hidden.expand([batch, self.heads, tokens, keys]);
            scores = scores.mask_fill(hidden, f32::NEG_INFINITY);
        }
        let attended = softmax(scores, 3).matmul(v);
        self.out_proj
            .forward(attended.swap_dims(1, 2).reshape([batch, tokens, dim]))
    }
}
