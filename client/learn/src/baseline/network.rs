//! The network of the paper: features of images, words and state of each row are fused to 128
//! numbers, an LSTM reads the rows, and a head computes the next poses from its last state.

use burn::prelude::*;
use burn::tensor::activation::{relu, sigmoid, tanh};

use super::columns::OUTPUTS;
use super::depth::{DepthNetwork, WIDTH};
use crate::network::{Embedding, Linear};

/// Width of a word's vector.
pub const WORD: usize = 300;
/// Widths of the fusion's layers; the last is that of the LSTM's state.
const FUSION: [usize; 3] = [512, 256, 128];

/// Sizes of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Visual features of a row; 0: without images.
    pub visual: usize,
    /// Depth images of a row; 0: without depth.
    pub depths: usize,
    /// Columns of state.
    pub state: usize,
    /// Words of the vocabulary.
    pub words: usize,
    /// Number of predicted times ahead.
    pub ahead: usize,
}

/// The network.
#[derive(Module, Debug)]
pub struct Baseline {
    words: Embedding,
    depth: Option<DepthNetwork>,
    fusion: Vec<Linear>,
    /// Gates of the input, in the order input, forget, cell, output.
    input: Linear,
    /// Gates of the previous state.
    state: Linear,
    head: Linear,
}

impl Baseline {
    /// With random weights.
    #[must_use]
    pub fn new(sizes: &Sizes, device: &Device) -> Self {
        let mut width = sizes.visual + sizes.depths * WIDTH + sizes.state + WORD;
        let mut fusion = Vec::new();
        for outputs in FUSION {
            fusion.push(Linear::new(width, outputs, device));
            width = outputs;
        }
        Self {
            words: Embedding::new(sizes.words, WORD, 1.0, device),
            depth: (sizes.depths > 0).then(|| DepthNetwork::new(device)),
            fusion,
            input: Linear::new(width, 4 * width, device),
            state: Linear::new(width, 4 * width, device),
            head: Linear::new(width, OUTPUTS * sizes.ahead, device),
        }
    }

    /// With given word vectors, vocabulary × 300.
    #[must_use]
    pub fn with_words(mut self, vectors: Tensor<2>) -> Self {
        self.words.weight = burn::module::Param::from_tensor(vectors);
        self
    }

    /// Rows (batch × rows × visual features and state), depth images (batch * rows * cameras × 1 ×
    /// side × side) if the sizes have any, and shares of words (batch × vocabulary) to outputs
    /// (batch × times ahead × 16).
    #[must_use]
    pub fn forward(
        &self,
        rows: Tensor<3>,
        depth: Option<Tensor<4>>,
        words: Tensor<2>,
    ) -> Tensor<3> {
        let [batch, length, _] = rows.dims();
        let sentence = words.matmul(self.words.weight.val());
        let sentence = sentence.unsqueeze_dim::<3>(1).expand([batch, length, WORD]);
        let mut parts = vec![rows, sentence];
        if let Some((network, images)) = self.depth.as_ref().zip(depth) {
            let depth_features = network.forward(images);
            let [images, numbers] = depth_features.dims();
            parts.push(depth_features.reshape([
                batch,
                length,
                images / (batch * length) * numbers,
            ]));
        }
        let mut x = Tensor::cat(parts, 2);
        for layer in &self.fusion {
            x = relu(layer.forward(x));
        }
        let [.., width] = x.dims();
        let gates = self.input.forward(x);
        let mut hidden = Tensor::<2>::zeros([batch, width], &gates.device());
        let mut cell = hidden.clone();
        for row in 0..length {
            let of_row = gates.clone().slice([0..batch, row..row + 1]);
            let all = of_row.flatten::<2>(1, 2) + self.state.forward(hidden);
            let gate = |k: usize| all.clone().slice([0..batch, k * width..(k + 1) * width]);
            cell = sigmoid(gate(1)) * cell + sigmoid(gate(0)) * tanh(gate(2));
            hidden = sigmoid(gate(3)) * tanh(cell.clone());
        }
        let out = self.head.forward(hidden);
        let ahead = out.dims()[1] / OUTPUTS;
        out.reshape([batch, ahead, OUTPUTS])
    }
}
