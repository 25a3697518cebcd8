//! Images as tensors: padded with their edge pixels to a multiple of the network's stride, each
//! channel standardized.

use burn::prelude::*;
use burn::tensor::TensorData;

use crate::card::Card;

/// Converts batch * cameras `images` (rows from the top left, 3 bytes a pixel, of the card's size)
/// to a tensor of batch * cameras × 3 × height × width.
#[must_use]
pub fn to_tensor(card: &Card, images: &[&[u8]], device: &Device) -> Tensor<4> {
    let [height, width] = card
        .cameras
        .first()
        .map_or([0, 0], |camera| [camera.height, camera.width]);
    let [to_height, to_width] = card.padded();
    let (top, left) = ((to_height - height) / 2, (to_width - width) / 2);
    let table: Vec<[f32; 256]> = (0..3)
        .map(|channel| {
            let (mean, std) = (card.image.mean[channel], card.image.std[channel]);
            std::array::from_fn(|byte| (byte as f32 / 255.0 - mean) / std)
        })
        .collect();
    // Source row or column of a padded one; outside, the edge is repeated.
    let from = |to: usize, before: usize, side: usize| -> usize {
        let at = to as i64 - before as i64;
        at.clamp(0, side as i64 - 1) as usize
    };
    let mut values = Vec::with_capacity(images.len() * 3 * to_height * to_width);
    let columns = (0..to_width).map(|x| from(x, left, width));
    let columns: Vec<usize> = columns.collect();
    for image in images {
        for (channel, table) in table.iter().enumerate() {
            for y in 0..to_height {
                let row = from(y, top, height) * width;
                let pixels = columns.iter().map(|x| (row + x) * 3 + channel);
                values.extend(pixels.map(|at| table[usize::from(image[at])]));
            }
        }
    }
    let shape = [images.len(), 3, to_height, to_width];
    Tensor::from_data(TensorData::new(values, shape), device)
}
