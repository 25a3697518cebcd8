//! Pictures as numbers: padded by their edge to what the network divides by, each
//! colour less its mean over its deviation.

use burn::prelude::*;
use burn::tensor::TensorData;

use crate::card::Card;

/// Numbers of `pictures` (rows from the top left, 3 bytes a pixel), batch * cameras
/// of them, all as large as the card says.
#[must_use]
pub fn numbers(card: &Card, pictures: &[&[u8]], device: &Device) -> Tensor<4> {
    let [height, width] = card
        .cameras
        .first()
        .map_or([0, 0], |camera| [camera.height, camera.width]);
    let [to_height, to_width] = card.padded();
    let (top, left) = ((to_height - height) / 2, (to_width - width) / 2);
    let table: Vec<[f32; 256]> = (0..3)
        .map(|colour| {
            let (mean, std) = (card.picture.mean[colour], card.picture.std[colour]);
            std::array::from_fn(|byte| (byte as f32 / 255.0 - mean) / std)
        })
        .collect();
    // Where a number comes from: the edge goes on outside.
    let from = |to: usize, before: usize, side: usize| -> usize {
        let at = to as i64 - before as i64;
        at.clamp(0, side as i64 - 1) as usize
    };
    let mut values = Vec::with_capacity(pictures.len() * 3 * to_height * to_width);
    let columns = (0..to_width).map(|x| from(x, left, width));
    let columns: Vec<usize> = columns.collect();
    for picture in pictures {
        for (colour, table) in table.iter().enumerate() {
            for y in 0..to_height {
                let row = from(y, top, height) * width;
                let pixels = columns.iter().map(|x| (row + x) * 3 + colour);
                values.extend(pixels.map(|at| table[usize::from(picture[at])]));
            }
        }
    }
    let shape = [pictures.len(), 3, to_height, to_width];
    Tensor::from_data(TensorData::new(values, shape), device)
}
