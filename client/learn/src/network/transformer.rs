//! LeRobot's layers of ACT: positions are added to queries and keys in every layer, norms follow
//! each part.

use burn::prelude::*;
use burn::tensor::activation::relu;

use super::attention::Attention;
use super::layer::{LayerNorm, Linear, xavier};
use super::shape::Shape;

/// Layers one after the other.
#[derive(Module, Debug)]
pub(super) struct Encoder {
    layers: Vec<EncoderLayer>,
}

impl Encoder {
    pub fn new(shape: &Shape, count: usize, device: &Device) -> Self {
        let layers = (0..count).map(|_| EncoderLayer::new(shape, device));
        Self {
            layers: layers.collect(),
        }
    }

    /// Tokens batch × count × dim, with positions 1 × count × dim.
    pub fn forward(
        &self,
        x: Tensor<3>,
        positions: &Tensor<3>,
        hidden: Option<&Tensor<2, Bool>>,
    ) -> Tensor<3> {
        let layers = self.layers.iter();
        layers.fold(x, |x, layer| layer.forward(x, positions, hidden))
    }
}

#[derive(Module, Debug)]
struct EncoderLayer {
    self_attn: Attention,
    linear1: Linear,
    linear2: Linear,
    norm1: LayerNorm,
    norm2: LayerNorm,
}

/// The two layers of a feed-forward part.
fn feedforward(shape: &Shape, device: &Device) -> (Linear, Linear) {
    let (dim, inner) = (shape.dim, shape.feedforward);
    let bound = xavier(dim, inner);
    (
        Linear::bounded(dim, inner, bound, device),
        Linear::bounded(inner, dim, bound, device),
    )
}

impl EncoderLayer {
    fn new(shape: &Shape, device: &Device) -> Self {
        let (linear1, linear2) = feedforward(shape, device);
        Self {
            self_attn: Attention::new(shape.dim, shape.heads, device),
            linear1,
            linear2,
            norm1: LayerNorm::new(shape.dim, device),
            norm2: LayerNorm::new(shape.dim, device),
        }
    }

    fn forward(
        &self,
        x: Tensor<3>,
        positions: &Tensor<3>,
        hidden: Option<&Tensor<2, Bool>>,
    ) -> Tensor<3> {
        let positioned = x.clone() + positions.clone();
        let attended =
            self.self_attn
                .forward(positioned.clone(), positioned, x.clone(), hidden.cloned());
        let x = self.norm1.forward(x + attended);
        let y = relu(self.linear1.forward(x.clone()));
        self.norm2.forward(x + self.linear2.forward(y))
    }
}

/// Layers that attend to a memory, and a final norm.
#[derive(Module, Debug)]
pub(super) struct Decoder {
    layers: Vec<DecoderLayer>,
    norm: LayerNorm,
}

impl Decoder {
    pub fn new(shape: &Shape, device: &Device) -> Self {
        let layers = (0..shape.decoder_layers).map(|_| DecoderLayer::new(shape, device));
        Self {
            layers: layers.collect(),
            norm: LayerNorm::new(shape.dim, device),
        }
    }

    /// `query_positions` is the positions of the queries, 1 × chunk × dim.
    pub fn forward(&self, x: Tensor<3>, query_positions: &Tensor<3>, memory: &Memory) -> Tensor<3> {
        let layers = self.layers.iter();
        let x = layers.fold(x, |x, layer| layer.forward(x, query_positions, memory));
        self.norm.forward(x)
    }
}

/// Output of the encoder: batch × tokens × dim.
#[derive(Clone, Debug)]
pub struct Memory {
    /// The tokens.
    pub tokens: Tensor<3>,
    /// The tokens with added positions.
    pub positioned: Tensor<3>,
}

#[derive(Module, Debug)]
struct DecoderLayer {
    self_attn: Attention,
    multihead_attn: Attention,
    linear1: Linear,
    linear2: Linear,
    norm1: LayerNorm,
    norm2: LayerNorm,
    norm3: LayerNorm,
}

impl DecoderLayer {
    fn new(shape: &Shape, device: &Device) -> Self {
        let (linear1, linear2) = feedforward(shape, device);
        let norm = || LayerNorm::new(shape.dim, device);
        Self {
            self_attn: Attention::new(shape.dim, shape.heads, device),
            multihead_attn: Attention::new(shape.dim, shape.heads, device),
            linear1,
            linear2,
            norm1: norm(),
            norm2: norm(),
            norm3: norm(),
        }
    }

    fn forward(&self, x: Tensor<3>, query_positions: &Tensor<3>, memory: &Memory) -> Tensor<3> {
        let positioned = x.clone() + query_positions.clone();
        let attended = self
            .self_attn
            .forward(positioned.clone(), positioned, x.clone(), None);
        let x = self.norm1.forward(x + attended);
        let attended = self.multihead_attn.forward(
            x.clone() + query_positions.clone(),
            memory.positioned.clone(),
            memory.tokens.clone(),
            None,
        );
        let x = self.norm2.forward(x + attended);
        let y = relu(self.linear1.forward(x.clone()));
        self.norm3.forward(x + self.linear2.forward(y))
    }
}
