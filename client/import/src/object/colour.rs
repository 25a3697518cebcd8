//! The color of an object in one word.

use super::mesh::{Mesh, Surface};
use crate::sh3d::Rgb;
use crate::texture;

/// Pixels of an image between those that are averaged.
const STRIDE: usize = 97;

/// The word for the color of the largest part of a mesh.
pub fn word(mesh: &Mesh) -> &'static str {
    let mut areas: Vec<(&'static str, f64)> = Vec::new();
    for (index, surface) in mesh.surfaces.iter().enumerate() {
        let own = mesh.faces.iter().filter(|face| face.surface == index);
        let area: f64 = own.map(super::mesh::Face::area).sum();
        let word = word_of(mean(surface), surface.metallic);
        match areas.iter_mut().find(|(other, _)| *other == word) {
            Some((_, sum)) => *sum += area,
            None => areas.push((word, area)),
        }
    }
    let largest = areas.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    largest.map_or("grey", |(word, _)| word)
}

/// The color of a surface, with the mean of its image.
fn mean(surface: &Surface) -> Rgb {
    let image = surface.image.as_ref();
    let Some(image) = image.and_then(|bytes| texture::decode(bytes).ok()) else {
        return surface.colour;
    };
    let mut sum = [0_u64; 3];
    let mut count = 0;
    for pixel in image.pixels.chunks_exact(3).step_by(STRIDE) {
        for (total, value) in sum.iter_mut().zip(pixel) {
            *total += u64::from(*value);
        }
        count += 255;
    }
    let own = surface.colour;
    [0, 1, 2].map(|k| (sum[k] * u64::from(own[k]) / count.max(1)) as u8)
}

fn word_of(colour: Rgb, metallic: f64) -> &'static str {
    let [red, green, blue] = colour.map(f64::from);
    let high = red.max(green).max(blue);
    let low = red.min(green).min(blue);
    let chroma = high - low;
    if chroma < 0.14 * high.max(60.0) || high < 45.0 {
        return match high {
            _ if metallic > 0.5 && high > 90.0 => "silver",
            h if h > 200.0 => "white",
            h if h > 70.0 => "grey",
            _ => "black",
        };
    }
    let hue = match high {
        h if h == red => 60.0 * ((green - blue) / chroma).rem_euclid(6.0),
        h if h == green => 60.0 * ((blue - red) / chroma + 2.0),
        _ => 60.0 * ((red - green) / chroma + 4.0),
    };
    match hue {
        _ if high > 215.0 && chroma < 0.2 * high => "white",
        h if (12.0..50.0).contains(&h) && high < 175.0 => "brown",
        h if (12.0..40.0).contains(&h) => "orange",
        h if (40.0..70.0).contains(&h) => "yellow",
        h if (70.0..165.0).contains(&h) => "green",
        h if (165.0..260.0).contains(&h) => "blue",
        h if (260.0..320.0).contains(&h) => "purple",
        _ if high > 200.0 && low > 120.0 => "pink",
        _ => "red",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_have_their_words() {
        for (colour, metallic, word) in [
            ([250, 250, 248], 0.0, "white"),
            ([190, 190, 190], 0.0, "grey"),
            ([190, 190, 190], 1.0, "silver"),
            ([20, 20, 22], 0.0, "black"),
            ([200, 30, 30], 0.0, "red"),
            ([30, 60, 200], 0.0, "blue"),
            ([40, 160, 60], 0.0, "green"),
            ([240, 220, 40], 0.0, "yellow"),
            ([110, 70, 30], 0.0, "brown"),
            ([240, 140, 20], 0.0, "orange"),
        ] {
            assert_eq!(word_of(colour, metallic), word, "{colour:?}");
        }
    }
}
