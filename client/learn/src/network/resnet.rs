//! ResNet18 (He et al. 2016) without its last layer, with torchvision's names.

use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::pool::{MaxPool2d, MaxPool2dConfig};
use burn::nn::{Initializer, PaddingConfig2d};
use burn::prelude::*;
use burn::tensor::activation::relu;

use super::layer::ChannelNorm;
use super::shape::Shape;

/// Batch × 3 × height × width to batch × 8 width × height / 32 × width / 32.
#[derive(Module, Debug)]
pub struct ResNet18 {
    conv1: Conv2d,
    bn1: ChannelNorm,
    pool: MaxPool2d,
    layer1: Vec<Block>,
    layer2: Vec<Block>,
    layer3: Vec<Block>,
    layer4: Vec<Block>,
}

impl ResNet18 {
    /// With random weights.
    #[must_use]
    pub fn new(shape: &Shape, device: &Device) -> Self {
        let width = shape.width;
        let stage = |number: u32| {
            let outputs = width << number;
            let (inputs, stride) = match number {
                0 => (width, 1),
                _ => (outputs / 2, 2),
            };
            vec![
                Block::new(shape, inputs, outputs, stride, device),
                Block::new(shape, outputs, outputs, 1, device),
            ]
        };
        Self {
            conv1: conv(3, width, 7, 2, device),
            bn1: ChannelNorm::new(shape, width, device),
            pool: MaxPool2dConfig::new([3, 3])
                .with_strides([2, 2])
                .with_padding(PaddingConfig2d::Explicit(1, 1, 1, 1))
                .init(),
            layer1: stage(0),
            layer2: stage(1),
            layer3: stage(2),
            layer4: stage(3),
        }
    }

    /// Features of images.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<4> {
        self.modulated(images, &[])
    }

    /// Features modulated by a sentence: the output of each stage is scaled and shifted channel by
    /// channel (FiLM, Perez et al. 2018). `film` has for each stage the scales minus 1, then the
    /// shifts, images × 2 channels; it may be empty.
    #[must_use]
    pub fn modulated(&self, images: Tensor<4>, film: &[Tensor<2>]) -> Tensor<4> {
        let first = self.bn1.forward(self.conv1.forward(images));
        let mut x = self.pool.forward(relu(first));
        let stages = [&self.layer1, &self.layer2, &self.layer3, &self.layer4];
        for (number, stage) in stages.into_iter().enumerate() {
            x = stage.iter().fold(x, |x, block| block.forward(x));
            if let Some(film) = film.get(number) {
                let [count, channels, ..] = x.dims();
                let half = |from: usize| {
                    let part = film.clone().slice([0..count, from..from + channels]);
                    part.reshape([count, channels, 1, 1])
                };
                x = x * (half(0) + 1.0) + half(channels);
            }
        }
        x
    }
}

/// The basic block.
#[derive(Module, Debug)]
struct Block {
    conv1: Conv2d,
    bn1: ChannelNorm,
    conv2: Conv2d,
    bn2: ChannelNorm,
    downsample: Option<Downsample>,
}

/// Adapts a shortcut to the block's output; PyTorch calls its parts `0` and `1`.
#[derive(Module, Debug)]
struct Downsample {
    conv: Conv2d,
    norm: ChannelNorm,
}

impl Block {
    fn new(shape: &Shape, inputs: usize, outputs: usize, stride: usize, device: &Device) -> Self {
        let norm = || ChannelNorm::new(shape, outputs, device);
        let fits = stride == 1 && inputs == outputs;
        Self {
            conv1: conv(inputs, outputs, 3, stride, device),
            bn1: norm(),
            conv2: conv(outputs, outputs, 3, 1, device),
            bn2: norm(),
            downsample: (!fits).then(|| Downsample {
                conv: conv(inputs, outputs, 1, stride, device),
                norm: norm(),
            }),
        }
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let y = relu(self.bn1.forward(self.conv1.forward(x.clone())));
        let y = self.bn2.forward(self.conv2.forward(y));
        let x = match &self.downsample {
            Some(down) => down.norm.forward(down.conv.forward(x)),
            None => x,
        };
        relu(y + x)
    }
}

fn conv(inputs: usize, outputs: usize, side: usize, stride: usize, device: &Device) -> Conv2d {
    let pad = side / 2;
    Conv2dConfig::new([inputs, outputs], [side, side])
        .with_stride([stride, stride])
        .with_padding(PaddingConfig2d::Explicit(pad, pad, pad, pad))
        .with_bias(false)
        .with_initializer(Initializer::KaimingNormal {
            gain: std::f64::consts::SQRT_2,
            fan_out_only: true,
        })
        .init(device)
}
