//! Sizes of a network, as stored in a model card.

use serde::{Deserialize, Serialize};

/// Kind of network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Action chunking transformer (Zhao et al. 2023).
    #[default]
    Act,
    /// Flow matching on the same encoder.
    Flow,
}

/// Norms of the ResNet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum NormKind {
    /// Group norm, for training from scratch.
    #[default]
    #[serde(rename = "group")]
    Group,
    /// Batch norm with constant statistics, for pretrained weights.
    #[serde(rename = "frozen-bn")]
    FrozenBatch,
}

/// Sizes; the defaults are those of the distributed policies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Shape {
    /// Kind of network.
    pub kind: Kind,
    /// Numbers of a state.
    pub state: usize,
    /// Numbers of an action.
    pub action: usize,
    /// Rows of a chunk.
    pub chunk: usize,
    /// Cameras.
    pub cameras: usize,
    /// Words of the vocabulary including the unknown one; 0: without language.
    pub words: usize,
    /// Width of an encoded sentence, and without text layers of a word's vector.
    pub word_width: usize,
    /// Layers of a transformer that reads the words in their order; 0: their mean.
    pub text_layers: usize,
    /// With text layers: width of a word's vector.
    pub text_width: usize,
    /// Width of a token of the text's transformer.
    pub text_dim: usize,
    /// Heads of an attention of the text's transformer.
    pub text_heads: usize,
    /// Channels of the ResNet's first stage.
    pub width: usize,
    /// Whether the words scale and shift the output of each stage of the ResNet.
    pub film: bool,
    /// Norms of the ResNet.
    pub norm: NormKind,
    /// Channels of a group of a group norm.
    pub group_channels: usize,
    /// Width of a token.
    pub dim: usize,
    /// Inner width of a feed-forward part.
    pub feedforward: usize,
    /// Heads of an attention.
    pub heads: usize,
    /// Layers of the encoder.
    pub encoder_layers: usize,
    /// Layers of the decoder.
    pub decoder_layers: usize,
    /// Layers of the latent's encoder, in training; 0: without.
    pub vae_layers: usize,
    /// Width of the latent.
    pub latent: usize,
    /// Dropout of PyTorch's training; Rust's has none.
    pub dropout: f64,
    /// Layers of the flow.
    pub flow_layers: usize,
    /// Euler steps of the flow.
    pub flow_steps: usize,
}

impl Default for Shape {
    fn default() -> Self {
        Self {
            kind: Kind::Act,
            state: wheelarm_policy::STATE,
            action: 12,
            chunk: 20,
            cameras: 2,
            words: 0,
            word_width: 300,
            text_layers: 0,
            text_width: 100,
            text_dim: 96,
            text_heads: 4,
            width: 64,
            film: false,
            norm: NormKind::Group,
            group_channels: 16,
            dim: 256,
            feedforward: 1024,
            heads: 8,
            encoder_layers: 4,
            decoder_layers: 1,
            vae_layers: 4,
            latent: 32,
            dropout: 0.1,
            flow_layers: 6,
            flow_steps: 10,
        }
    }
}

/// An invalid size.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("invalid {what} = {value}: {rule}")]
pub struct ShapeError {
    what: &'static str,
    value: usize,
    rule: &'static str,
}

impl Shape {
    /// Rejects sizes that would panic or exhaust the memory later.
    ///
    /// # Errors
    /// [`ShapeError`] with the first size that is wrong.
    pub fn check(&self) -> Result<(), ShapeError> {
        let ranges = [
            ("state", self.state, 1, 4096),
            ("action", self.action, 1, 4096),
            ("chunk", self.chunk, 1, 1000),
            ("cameras", self.cameras, 1, 16),
            ("words", self.words, 0, 1 << 20),
            ("word_width", self.word_width, 1, 4096),
            ("text_layers", self.text_layers, 0, 64),
            ("text_width", self.text_width, 1, 4096),
            ("text_dim", self.text_dim, 1, 4096),
            ("text_heads", self.text_heads, 1, 256),
            ("width", self.width, 1, 512),
            ("group_channels", self.group_channels, 1, 4096),
            ("dim", self.dim, 4, 4096),
            ("feedforward", self.feedforward, 1, 1 << 16),
            ("heads", self.heads, 1, 256),
            ("encoder_layers", self.encoder_layers, 0, 64),
            ("decoder_layers", self.decoder_layers, 1, 64),
            ("vae_layers", self.vae_layers, 0, 64),
            ("latent", self.latent, 1, 4096),
            ("flow_layers", self.flow_layers, 1, 64),
            ("flow_steps", self.flow_steps, 1, 1000),
        ];
        for (what, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                let rule = "out of range";
                return Err(ShapeError { what, value, rule });
            }
        }
        let divides = [
            (
                "dim",
                self.dim,
                self.heads,
                "it must be a multiple of the heads",
            ),
            ("dim", self.dim, 4, "it must be a multiple of 4"),
            (
                "text_dim",
                self.text_dim,
                self.text_heads,
                "it must be a multiple of the text's heads",
            ),
        ];
        for (what, value, by, rule) in divides {
            if !value.is_multiple_of(by) {
                return Err(ShapeError { what, value, rule });
            }
        }
        if (self.film || self.text_layers > 0) && self.words == 0 {
            return Err(ShapeError {
                what: "words",
                value: self.words,
                rule: "film and text layers need words",
            });
        }
        if self.norm == NormKind::Group && !self.width.is_multiple_of(self.group_channels) {
            return Err(ShapeError {
                what: "width",
                value: self.width,
                rule: "with group norm it must be a multiple of group_channels",
            });
        }
        Ok(())
    }
}
