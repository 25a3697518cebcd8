//! LeRobot's layers of ACT: positions are added to queries and keys in every layer,
//! norms stand behind.

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

    /// Tokens batch × count × dim, their places 1 × count × dim.
    pub fn forward(
        &self,
        x: Tensor<3>,
        places: &Tensor<3>,
        hidden: Option<&Tensor<2, Bool>>,
    ) -> Tensor<3> {
        let layers = self.layers.iter();
        layers.fold(x, |x, layer| layer.forward(x, places, hidden))
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
        places: &Tensor<3>,
        hidden: Option<&Tensor<2, Bool>>,
    ) -> Tensor<3> {
        let placed = x.clone() + places.clone();
        let seen = self
            .self_attn
            .forward(placed.clone(), placed, x.clone(), hidden.cloned());
        let x = self.norm1.forward(x + seen);
        let y = relu(self.linear1.forward(x.clone()));
        self.norm2.forward(x + self.linear2.forward(y))
    }
}

/// Layers that ask a memory, and a norm behind them.
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

    /// `place` 1 × chunk × dim; `key` is the memory with its places.
    pub fn forward(&self, x: Tensor<3>, place: &Tensor<3>, memory: &Memory) -> Tensor<3> {
        let layers = self.layers.iter();
        let x = layers.fold(x, |x, layer| layer.forward(x, place, memory));
        self.norm.forward(x)
    }
}

/// What the encoder knows: batch × tokens × dim.
#[derive(Clone, Debug)]
pub struct Memory {
    /// The tokens.
    pub tokens: Tensor<3>,
    /// The tokens and their places.
    pub placed: Tensor<3>,
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

    fn forward(&self, x: Tensor<3>, place: &Tensor<3>, memory: &Memory) -> Tensor<3> {
        let placed = x.clone() + place.clone();
        let seen = self
            .self_attn
            .forward(placed.clone(), placed, x.clone(), None);
        let x = self.norm1.forward(x + seen);
        let asked = self.multihead_attn.forward(
            x.clone() + place.clone(),
            memory.placed.clone(),
            memory.tokens.clone(),
            None,
        );
        let x = self.norm2.forward(x + asked);
        let y = relu(self.linear1.forward(x.clone()));
        self.norm3.forward(x + self.linear2.forward(y))
    }
}
