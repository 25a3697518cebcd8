//! Action chunking transformer with the layers and names of LeRobot 0.4.

use burn::nn::PaddingConfig2d;
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::prelude::*;

use super::layer::{Embedding, Linear};
use super::position_encoding;
use super::resnet::ResNet18;
use super::shape::{Kind, Shape};
use super::transformer::{Decoder, Encoder, Memory};

/// The network; its parameters have LeRobot's names. Only training with PyTorch uses those of
/// `vae_encoder`, which a file contains too.
#[derive(Module, Debug)]
pub struct Act {
    vae_encoder: Option<Encoder>,
    vae_encoder_cls_embed: Option<Embedding>,
    vae_encoder_robot_state_input_proj: Option<Linear>,
    vae_encoder_action_input_proj: Option<Linear>,
    vae_encoder_latent_output_proj: Option<Linear>,
    backbone: ResNet18,
    film: Option<Vec<Linear>>,
    encoder: Encoder,
    encoder_robot_state_input_proj: Linear,
    encoder_env_state_input_proj: Option<Linear>,
    encoder_latent_input_proj: Linear,
    encoder_img_feat_input_proj: Conv2d,
    encoder_1d_feature_pos_embed: Embedding,
    decoder: Option<Decoder>,
    decoder_pos_embed: Option<Embedding>,
    action_head: Option<Linear>,
    cameras: usize,
    latent: usize,
}

impl Act {
    /// With random weights.
    #[must_use]
    pub fn new(shape: &Shape, device: &Device) -> Self {
        let dim = shape.dim;
        let is_act = shape.kind == Kind::Act;
        let learns = is_act && shape.vae_layers > 0;
        let linear = |inputs, outputs| Linear::new(inputs, outputs, device);
        let embedding = |rows| Embedding::new(rows, dim, 1.0, device);
        let language = shape.words > 0;
        Self {
            vae_encoder: learns.then(|| Encoder::new(shape, shape.vae_layers, device)),
            vae_encoder_cls_embed: learns.then(|| embedding(1)),
            vae_encoder_robot_state_input_proj: learns.then(|| linear(shape.state, dim)),
            vae_encoder_action_input_proj: learns.then(|| linear(shape.action, dim)),
            vae_encoder_latent_output_proj: learns.then(|| linear(dim, 2 * shape.latent)),
            backbone: ResNet18::new(shape, device),
            film: (shape.film && language).then(|| {
                let stages = (0..4).map(|stage| 2 * (shape.width << stage));
                stages
                    .map(|outputs| linear(shape.word_width, outputs))
                    .collect()
            }),
            encoder: Encoder::new(shape, shape.encoder_layers, device),
            encoder_robot_state_input_proj: linear(shape.state, dim),
            encoder_env_state_input_proj: language.then(|| linear(shape.word_width, dim)),
            encoder_latent_input_proj: linear(shape.latent, dim),
            encoder_img_feat_input_proj: Conv2dConfig::new([8 * shape.width, dim], [1, 1])
                .with_padding(PaddingConfig2d::Valid)
                .init(device),
            encoder_1d_feature_pos_embed: embedding(2 + usize::from(language)),
            decoder: is_act.then(|| Decoder::new(shape, device)),
            decoder_pos_embed: is_act.then(|| embedding(shape.chunk)),
            action_head: is_act.then(|| linear(dim, shape.action)),
            cameras: shape.cameras,
            latent: shape.latent,
        }
    }

    /// Encodes images (batch * cameras × 3 × height × width), state (batch × state) and language
    /// (batch × word width). The latent is 0.
    #[must_use]
    pub fn encode(
        &self,
        images: Tensor<4>,
        state: Tensor<2>,
        language: Option<Tensor<2>>,
    ) -> Memory {
        let (batch, device) = (state.dims()[0], state.device());
        let latent = Tensor::<2>::zeros([batch, self.latent], &device);
        let mut tokens: Vec<Tensor<3>> = vec![
            self.encoder_latent_input_proj
                .forward(latent)
                .unsqueeze_dim(1),
            self.encoder_robot_state_input_proj
                .forward(state)
                .unsqueeze_dim(1),
        ];
        const NEEDED: &str = "a sentence for a network with language";
        if let Some(project) = &self.encoder_env_state_input_proj {
            let language = language.clone().expect(NEEDED);
            tokens.push(project.forward(language).unsqueeze_dim(1));
        }
        let film = self.film.iter().flatten().map(|layer| {
            let modulation = layer.forward(language.clone().expect(NEEDED));
            let [_, numbers] = modulation.dims();
            // The cameras of an observation are consecutive images.
            let each = modulation.unsqueeze_dim::<3>(1);
            let each = each.expand([batch, self.cameras, numbers]);
            each.reshape([batch * self.cameras, numbers])
        });
        let film: Vec<Tensor<2>> = film.collect();
        let features = self.backbone.modulated(images, &film);
        let features = self.encoder_img_feat_input_proj.forward(features);
        let [_, dim, height, width] = features.dims();
        let image_tokens = features
            .reshape([batch, self.cameras, dim, height * width])
            .swap_dims(2, 3)
            .reshape([batch, self.cameras * height * width, dim]);
        tokens.push(image_tokens);
        let of_image = position_encoding::of_image(height, width, dim, &device);
        let mut positions = vec![self.encoder_1d_feature_pos_embed.weight.val()];
        positions.extend(std::iter::repeat_n(of_image, self.cameras));
        let positions = Tensor::cat(positions, 0).unsqueeze_dim::<3>(0);
        let tokens = self
            .encoder
            .forward(Tensor::cat(tokens, 1), &positions, None);
        Memory {
            positioned: tokens.clone() + positions,
            tokens,
        }
    }

    /// Actions, batch × chunk × action; arguments as for [`Act::encode`].
    ///
    /// # Panics
    /// When the network is the encoder of a flow.
    #[must_use]
    pub fn forward(
        &self,
        images: Tensor<4>,
        state: Tensor<2>,
        language: Option<Tensor<2>>,
    ) -> Tensor<3> {
        const NEEDED: &str = "the decoder of ACT";
        let memory = self.encode(images, state, language);
        let place = self.decoder_pos_embed.as_ref().expect(NEEDED);
        let place = place.weight.val().unsqueeze_dim::<3>(0);
        let [_, chunk, dim] = place.dims();
        let batch = memory.tokens.dims()[0];
        let query = Tensor::zeros([batch, chunk, dim], &memory.tokens.device());
        let decoder = self.decoder.as_ref().expect(NEEDED);
        let head = self.action_head.as_ref().expect(NEEDED);
        head.forward(decoder.forward(query, &place, &memory))
    }
}
