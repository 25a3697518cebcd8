//! Sinusoidal position encodings of tokens.

use burn::prelude::*;
use burn::tensor::TensorData;

/// Longest wavelength over the shortest.
const TEMPERATURE: f64 = 10_000.0;

/// A table with the values of a function of row and column.
fn table(
    rows: usize,
    columns: usize,
    value: impl Fn(usize, usize) -> f64,
    device: &Device,
) -> Tensor<2> {
    let values = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let values: Vec<f32> = values.map(|(r, c)| value(r, c) as f32).collect();
    Tensor::from_data(TensorData::new(values, [rows, columns]), device)
}

/// Sine in even columns, cosine in odd ones.
fn wave(place: f64, column: usize, width: usize) -> f64 {
    let rate = TEMPERATURE.powf((2 * (column / 2)) as f64 / width as f64);
    match column % 2 {
        0 => (place / rate).sin(),
        _ => (place / rate).cos(),
    }
}

/// Positions of a sequence: count × dim (Vaswani et al. 2017).
pub(super) fn of_sequence(count: usize, dim: usize, device: &Device) -> Tensor<2> {
    table(
        count,
        dim,
        |row, column| wave(row as f64, column, dim),
        device,
    )
}

/// Positions of an image's features, row by row: height * width × dim. The first half of the
/// numbers encodes the row, the second the column, each as a share of a turn (Carion et al. 2020).
pub(super) fn of_image(height: usize, width: usize, dim: usize, device: &Device) -> Tensor<2> {
    let half = dim / 2;
    let turn =
        |place: usize, of: usize| (place + 1) as f64 / (of as f64 + 1e-6) * std::f64::consts::TAU;
    let value = |at: usize, column: usize| match column < half {
        true => wave(turn(at / width, height), column, half),
        false => wave(turn(at % width, width), column - half, half),
    };
    table(height * width, dim, value, device)
}
