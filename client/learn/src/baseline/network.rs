//! The network of the paper: what is seen, said and measured in each row is fused to
//! 128 numbers, an LSTM goes over the rows, and its last state tells the next poses.

use burn::prelude::*;
use burn::tensor::activation::{relu, sigmoid, tanh};

use super::columns::OUTPUTS;
use super::depth::{DepthNetwork, WIDTH};
use crate::network::{Embedding, Linear};

/// Numbers of a word's vector.
pub const WORD: usize = 300;
/// Layers of the fusion, and the LSTM's state.
const FUSION: [usize; 3] = [512, 256, 128];

/// Sizes of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Numbers of what is seen in a row; 0: no pictures.
    pub seen: usize,
    /// Depth pictures of a row; 0: no depth.
    pub depths: usize,
    /// Columns of state.
    pub state: usize,
    /// Words of the vocabulary.
    pub words: usize,
    /// Times ahead that are told.
    pub ahead: usize,
}

/// The network.
#[derive(Module, Debug)]
pub struct Baseline {
    words: Embedding,
    depth: Option<DepthNetwork>,
    fusion: Vec<Linear>,
    /// Gates of what comes in: input, forget, cell, output.
    input: Linear,
    /// Gates of the state before.
    state: Linear,
    head: Linear,
}

impl Baseline {
    /// With random weights.
    #[must_use]
    pub fn new(sizes: &Sizes, device: &Device) -> Self {
        let mut width = sizes.seen + sizes.depths * WIDTH + sizes.state + WORD;
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

    /// With vectors of words from elsewhere, vocabulary × 300.
    #[must_use]
    pub fn with_words(mut self, vectors: Tensor<2>) -> Self {
        self.words.weight = burn::module::Param::from_tensor(vectors);
        self
    }

    /// Rows (batch × rows × what is seen and measured), depth pictures (batch * rows *
    /// cameras × 1 × side × side) where the sizes have any, and shares of words (batch ×
    /// vocabulary) to outputs (batch × times ahead × 16).
    #[must_use]
    pub fn forward(
        &self,
        rows: Tensor<3>,
        depth: Option<Tensor<4>>,
        words: Tensor<2>,
    ) -> Tensor<3> {
        let [batch, length, _] = rows.dims();
        let said = words.matmul(self.words.weight.val());
        let said = said.unsqueeze_dim::<3>(1).expand([batch, length, WORD]);
        let mut parts = vec![rows, said];
        if let Some((network, pictures)) = self.depth.as_ref().zip(depth) {
            let told = network.forward(pictures);
            let [pictures, numbers] = told.dims();
            parts.push(told.reshape([batch, length, pictures / (batch * length) * numbers]));
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
