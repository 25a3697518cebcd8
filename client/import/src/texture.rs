//! Images of walls, floors and materials: JPEG or PNG, resampled to the square of a pack.

use png::{BitDepth, ColorType, Encoder, Transformations};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Pixels along each side of an image of a pack.
pub const SIDE: usize = 512;
/// Largest number of pixels along a side of an image that is read.
const MOST: usize = 8_192;

/// An image, three bytes a pixel, the first row at the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels along x.
    pub width: usize,
    /// Pixels along y.
    pub height: usize,
    /// Red, green, blue.
    pub pixels: Vec<u8>,
}

/// Decodes a JPEG or PNG file.
///
/// # Errors
/// When it is neither, damaged, or above 8192 pixels along a side.
pub fn decode(bytes: &[u8]) -> Result<Image, String> {
    if bytes.starts_with(&[0xff, 0xd8]) {
        decode_jpeg(bytes)
    } else if bytes.starts_with(b"\x89PNG") {
        decode_png(bytes)
    } else {
        Err("neither JPEG nor PNG; save it as one of them".into())
    }
}

fn decode_jpeg(bytes: &[u8]) -> Result<Image, String> {
    let options = DecoderOptions::default()
        .set_max_width(MOST)
        .set_max_height(MOST)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let pixels = decoder.decode().map_err(|error| format!("{error:?}"))?;
    let (width, height) = decoder.dimensions().ok_or("it has no size")?;
    checked(width, height, pixels)
}

fn decode_png(bytes: &[u8]) -> Result<Image, String> {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    if width > MOST || height > MOST {
        return Err(format!(
            "{width} x {height} pixels, at most {MOST} along a side are read"
        ));
    }
    let size = reader.output_buffer_size().ok_or("it is too large")?;
    let mut buffer = vec![0; size];
    let frame = reader
        .next_frame(&mut buffer)
        .map_err(|error| error.to_string())?;
    buffer.truncate(frame.buffer_size());
    let pixels = match frame.color_type {
        ColorType::Rgb => buffer,
        ColorType::Rgba => buffer
            .chunks_exact(4)
            .flat_map(|p| [p[0], p[1], p[2]])
            .collect(),
        ColorType::Grayscale => buffer.iter().flat_map(|&p| [p, p, p]).collect(),
        ColorType::GrayscaleAlpha => buffer
            .chunks_exact(2)
            .flat_map(|p| [p[0], p[0], p[0]])
            .collect(),
        ColorType::Indexed => return Err("its palette cannot be read".into()),
    };
    checked(width, height, pixels)
}

fn checked(width: usize, height: usize, pixels: Vec<u8>) -> Result<Image, String> {
    if width == 0 || height == 0 || pixels.len() != 3 * width * height {
        return Err(format!(
            "{} bytes for {width} x {height} pixels",
            pixels.len()
        ));
    }
    Ok(Image {
        width,
        height,
        pixels,
    })
}

/// A square PNG of 512 x 512 pixels that shows the image `times` times from top to bottom.
#[must_use]
pub fn square_png(image: &Image, times: usize) -> Option<Vec<u8>> {
    let mut pixels = Vec::with_capacity(3 * SIDE * SIDE);
    let rows = image.height * times.max(1);
    for y in 0..SIDE {
        let (first, last) = (y * rows / SIDE, ((y + 1) * rows).div_ceil(SIDE));
        for x in 0..SIDE {
            let (left, right) = (
                x * image.width / SIDE,
                ((x + 1) * image.width).div_ceil(SIDE),
            );
            let mut sum = [0u64; 3];
            let mut count = 0;
            for row in first..last {
                for column in left..right {
                    let at = 3 * ((row % image.height) * image.width + column);
                    for (total, value) in sum.iter_mut().zip(&image.pixels[at..at + 3]) {
                        *total += u64::from(*value);
                    }
                    count += 1;
                }
            }
            pixels.extend(sum.map(|total| (total / count.max(1)) as u8));
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, SIDE as u32, SIDE as u32);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(&pixels).ok()?;
    writer.finish().ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn image_is_resampled_to_a_square() {
        let image = Image {
            width: 2,
            height: 1,
            pixels: vec![255, 0, 0, 0, 0, 255],
        };
        let bytes = square_png(&image, 3).unwrap();
        let square = decode(&bytes).unwrap();
        assert_eq!((square.width, square.height), (SIDE, SIDE));
        assert_eq!(square.pixels[..3], [255, 0, 0]);
        let last = square.pixels.len() - 3;
        assert_eq!(square.pixels[last..], [0, 0, 255]);
    }

    #[test]
    fn damaged_images_are_errors() {
        let good = square_png(
            &Image {
                width: 1,
                height: 1,
                pixels: vec![9; 3],
            },
            1,
        )
        .unwrap();
        for bytes in [
            &b""[..],
            b"GIF89a",
            &good[..60],
            &[0xff, 0xd8, 0xff, 0xe0, 0, 4],
        ] {
            assert!(decode(bytes).is_err());
        }
    }
}
