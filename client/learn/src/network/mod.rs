//! The networks. Parameters have the names and the layout of LeRobot's ACT and of PyTorch (`weight`
//! is outputs by inputs), so that weights are exchanged without conversion.
//!
//! No module here reads a file or depends on a robot: tensors in, tensors out.

mod act;
mod attention;
mod flow;
mod layer;
mod position_encoding;
mod resnet;
mod shape;
mod text;
mod transformer;

pub use act::Act;
pub use flow::Flow;
pub use layer::{ChannelNorm, Embedding, Linear};
pub use resnet::ResNet18;
pub use shape::{Kind, NormKind, Shape, ShapeError};
pub use text::TextEncoder;

use burn::prelude::*;

/// The whole network with its words, as trained, stored and served.
#[derive(Module, Debug)]
pub struct Network {
    model: Act,
    flow: Option<Flow>,
    words: Option<Embedding>,
    text: Option<TextEncoder>,
}

/// Input sentences of a batch.
#[expect(clippy::large_enum_variant, reason = "one value per batch")]
#[derive(Clone, Debug)]
pub enum Words {
    /// Share of each word of the vocabulary: batch × words.
    Shares(Tensor<2>),
    /// Indices of each sentence's words in the vocabulary, in order: for a network with a text
    /// encoder.
    InOrder(Vec<Vec<i32>>),
}

/// Inputs of a network, in the units of its training.
#[derive(Clone, Debug)]
pub struct Inputs {
    /// Images, cameras of an observation together: batch * cameras × 3 × height × width.
    pub images: Tensor<4>,
    /// Batch × state.
    pub state: Tensor<2>,
    /// The sentence of each.
    pub words: Option<Words>,
}

impl Network {
    /// With random weights from the device's seed.
    #[must_use]
    pub fn new(shape: &Shape, device: &Device) -> Self {
        let flow = (shape.kind == Kind::Flow).then(|| Flow::new(shape, device));
        let width = match shape.text_layers {
            0 => shape.word_width,
            _ => shape.text_width,
        };
        let words = (shape.words > 0).then(|| Embedding::new(shape.words, width, 1.0, device));
        let reads = shape.words > 0 && shape.text_layers > 0;
        Self {
            model: Act::new(shape, device),
            flow,
            words,
            text: reads.then(|| TextEncoder::new(shape, device)),
        }
    }

    /// Actions, batch × chunk × action, in the units of training. A flow starts from
    /// `noise` of that shape; ACT needs none.
    #[must_use]
    pub fn forward(&self, inputs: Inputs, noise: Option<Tensor<3>>) -> Tensor<3> {
        let language = self.language(inputs.words);
        let Some(flow) = &self.flow else {
            return self.model.forward(inputs.images, inputs.state, language);
        };
        let memory = self.model.encode(inputs.images, inputs.state, language);
        flow.actions(noise.expect("a flow starts from noise"), memory)
    }

    /// Encodes the sentences: batch × word width.
    fn language(&self, words: Option<Words>) -> Option<Tensor<2>> {
        let vectors = self.words.as_ref()?.weight.val();
        let rows = match words? {
            Words::Shares(shares) => return Some(shares.matmul(vectors)),
            Words::InOrder(rows) => rows,
        };
        let text = self
            .text
            .as_ref()
            .expect("words in order for a text encoder");
        let (device, [_, width]) = (vectors.device(), vectors.dims());
        let read = rows.into_iter().map(|row| {
            // An empty sentence is one word with a zero vector.
            let sentence = match row.is_empty() {
                true => Tensor::zeros([1, width], &device),
                false => {
                    let words = Tensor::<1, Int>::from_data(&row[..], &device);
                    vectors.clone().select(0, words)
                }
            };
            text.forward(sentence.unsqueeze_dim(0))
        });
        Some(Tensor::cat(read.collect(), 0))
    }
}
