//! Reads the words of a sentence in their order.

use burn::prelude::*;

use super::layer::Linear;
use super::position_encoding;
use super::shape::Shape;
use super::transformer::Encoder;

/// A small transformer over the vectors of the words.
#[derive(Module, Debug)]
pub struct TextEncoder {
    input: Linear,
    encoder: Encoder,
    output: Linear,
}

impl TextEncoder {
    /// With random weights.
    #[must_use]
    pub fn new(shape: &Shape, device: &Device) -> Self {
        let layers = Shape {
            dim: shape.text_dim,
            heads: shape.text_heads,
            feedforward: 4 * shape.text_dim,
            ..shape.clone()
        };
        Self {
            input: Linear::new(shape.text_width, shape.text_dim, device),
            encoder: Encoder::new(&layers, shape.text_layers, device),
            output: Linear::new(shape.text_dim, shape.word_width, device),
        }
    }

    /// Vectors of one sentence, 1 × words × text width, to 1 × word width.
    #[must_use]
    pub fn forward(&self, vectors: Tensor<3>) -> Tensor<2> {
        let x = self.input.forward(vectors);
        let [one, count, dim] = x.dims();
        let places = position_encoding::of_sequence(count, dim, &x.device()).unsqueeze_dim(0);
        let x = self.encoder.forward(x, &places, None);
        self.output.forward(x.mean_dim(1).reshape([one, dim]))
    }
}
