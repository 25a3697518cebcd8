//! Depth for the paper's baseline: small images, and a network of two layers that computes 64
//! features of each. The paper states neither strides nor kernel sizes; these are small enough
//! for a CPU.

use burn::nn::PaddingConfig2d;
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::prelude::*;
use burn::tensor::activation::relu;

use crate::episodes::Episode;
use crate::network::Linear;

/// Side of a small image, pixels.
pub const SIDE: usize = 64;
/// Features of an image.
pub const WIDTH: usize = 64;
/// Channels of the two layers.
const CHANNELS: [usize; 2] = [16, 32];
/// Range of metric depth, metres; distances are clamped to it.
const NEAR: f32 = 0.3;
const FAR: f32 = 10.0;

/// Small depth images, by episode.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Depths {
    /// Number of images of a row.
    pub cameras: usize,
    episodes: Vec<Vec<u8>>,
}

impl Depths {
    /// Small images of all episodes; `None` unless all have depth of all cameras. Without `metric`
    /// as the paper's program scales them: grey from the nearest to the farthest point of each
    /// image. With `metric`: inverse distance, equal in all images.
    #[must_use]
    pub fn of(episodes: &[Episode], metric: bool) -> Option<Self> {
        let cameras = episodes.first()?.cameras.len();
        let is_whole = |e: &Episode| e.cameras.keys().all(|c| e.depths.contains_key(c));
        if cameras == 0 || !episodes.iter().all(is_whole) {
            return None;
        }
        let of = |episode: &Episode| {
            let mut out = Vec::with_capacity(episode.rows() * cameras * SIDE * SIDE);
            for row in 0..episode.rows() {
                for camera in episode.cameras.keys() {
                    let size = &episode.depths[camera];
                    let depth: Vec<u16> = episode.depth(camera, row).collect();
                    let small = downsample(&depth, size.width, size.height);
                    out.extend(if metric {
                        inverse(&small)
                    } else {
                        grey(&small)
                    });
                }
            }
            out
        };
        Some(Self {
            cameras,
            episodes: episodes.iter().map(of).collect(),
        })
    }

    /// Images of a row of an episode, 0 to 255, camera after camera.
    #[must_use]
    pub fn row(&self, episode: usize, row: usize) -> &[u8] {
        let size = self.cameras * SIDE * SIDE;
        &self.episodes[episode][row * size..(row + 1) * size]
    }
}

/// Depth at [`SIDE`] × [`SIDE`] points, from the nearest pixel of each.
fn downsample(depth: &[u16], width: usize, height: usize) -> Vec<u16> {
    let at = |to: usize, side: usize| (2 * to + 1) * side / (2 * SIDE);
    let rows = (0..SIDE).map(|y| at(y, height) * width);
    let pixels = rows.flat_map(|row| (0..SIDE).map(move |x| row + at(x, width)));
    pixels.map(|pixel| depth[pixel]).collect()
}

/// Grey from the nearest to the farthest point; 0 without a surface.
fn grey(depth: &[u16]) -> Vec<u8> {
    let returns = || depth.iter().copied().filter(|d| *d > 0);
    let (least, most) = (returns().min().unwrap_or(0), returns().max().unwrap_or(1));
    let range = f32::from(most - least).max(1.0);
    let grey = |d: &u16| f32::from(d.saturating_sub(least)) / range * 255.0;
    depth.iter().map(|d| grey(d).round() as u8).collect()
}

/// Inverse distance: 255 at [`NEAR`], 0 at [`FAR`] and without a surface.
fn inverse(depth: &[u16]) -> Vec<u8> {
    let scaled = |d: &u16| {
        let metres = (f32::from(*d) / 1000.0).clamp(NEAR, FAR);
        let share = (1.0 / metres - 1.0 / FAR) / (1.0 / NEAR - 1.0 / FAR);
        if *d == 0 {
            0
        } else {
            (share * 255.0).round() as u8
        }
    };
    depth.iter().map(scaled).collect()
}

/// Computes features of depth images.
#[derive(Module, Debug)]
pub struct DepthNetwork {
    conv1: Conv2d,
    conv2: Conv2d,
    out: Linear,
}

impl DepthNetwork {
    /// With random weights.
    #[must_use]
    pub fn new(device: &Device) -> Self {
        let conv = |channels: [usize; 2], side: usize, stride: usize| {
            let pad = side / 2;
            Conv2dConfig::new(channels, [side, side])
                .with_stride([stride, stride])
                .with_padding(PaddingConfig2d::Explicit(pad, pad, pad, pad))
                .init(device)
        };
        Self {
            conv1: conv([1, CHANNELS[0]], 5, 4),
            conv2: conv(CHANNELS, 3, 2),
            out: Linear::new(CHANNELS[1], WIDTH, device),
        }
    }

    /// Images × 1 × side × side, 0 to 1, to images × 64.
    #[must_use]
    pub fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        let x = relu(self.conv1.forward(images));
        let x = relu(self.conv2.forward(x));
        let [count, channels, height, width] = x.dims();
        let x = x.reshape([count, channels, height * width]).mean_dim(2);
        relu(self.out.forward(x.reshape([count, channels])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_becomes_grey_per_image_or_metric_for_all() {
        assert_eq!(grey(&[1000, 2000, 3000, 0]), [0, 128, 255, 0]);
        assert_eq!(grey(&[0, 0]), [0, 0]);
        assert_eq!(inverse(&[300, 100, 10_000, 60_000, 0]), [255, 255, 0, 0, 0]);
        let image: Vec<u16> = (0..128 * 64).map(|i| i as u16).collect();
        let small = downsample(&image, 128, 64);
        assert_eq!(small.len(), SIDE * SIDE);
        assert_eq!(small[..3], [1, 3, 5]);
        assert_eq!(small[SIDE], 129);
    }

    #[test]
    fn features_of_near_and_far_images_differ() {
        let device = Device::flex();
        device.seed(1);
        let network = DepthNetwork::new(&device);
        let near = Tensor::<4>::ones([1, 1, SIDE, SIDE], &device);
        let both = Tensor::cat(vec![near.clone(), near * 0.1], 0);
        let features = network.forward(both);
        assert_eq!(features.dims(), [2, WIDTH]);
        let values: Vec<f32> = features.into_data().iter::<f32>().collect();
        let differ = values[..WIDTH].iter().zip(&values[WIDTH..]);
        assert!(differ.map(|(a, b)| (a - b).abs()).sum::<f32>() > 0.01);
    }
}
