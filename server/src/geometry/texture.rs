//! Texture images, which repeat without a seam, and label images: PNG files below
//! `assets/textures`. Colours multiply the material's; a label is a complete image that
//! replaces the colour.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use wheelarm_proto::cache::{self, Key, Store};

use super::{PackedFile, Texture};

/// Pixels along each side.
pub const SIZE: usize = 512;

/// Mipmap levels down to one pixel, the full size included.
pub const LEVELS: usize = 10;

/// An invalid image.
#[derive(Debug, thiserror::Error)]
pub enum TextureError {
    /// A missing or damaged file.
    #[error("{path}: cannot be read ({reason}); put a PNG file there")]
    Read {
        /// The file.
        path: PathBuf,
        /// Message of the decoder.
        reason: String,
    },
    /// Another size or pixel format.
    #[error(
        "{path}: {found}, expected {SIZE}x{SIZE} pixels of 8 bits, grey or RGB; convert it to that"
    )]
    Format {
        /// The file.
        path: PathBuf,
        /// Its size and pixels.
        found: String,
    },
}

/// Names (without `.png`) of all images below the assets folder, sorted.
#[must_use]
pub fn names(assets: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(assets.join("textures"));
    let files = entries.into_iter().flatten().flatten();
    let paths = files.map(|entry| entry.path());
    let mut names: Vec<_> = paths
        .filter(|path| path.extension().is_some_and(|ending| ending == "png"))
        .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
        .collect();
    names.sort();
    names
}

/// Whether it is a label: fitted to the height of its body, replacing the colour.
#[must_use]
pub fn is_label(pattern: &str) -> bool {
    let name = pattern.rsplit('/').next().unwrap_or(pattern);
    name.starts_with("label_")
}

/// Whether it has a grain along `u` that follows the longer side of a board.
#[must_use]
pub fn has_grain(pattern: &str) -> bool {
    matches!(pattern, "wood" | "brushed")
}

/// Bytes of all levels.
const BYTES: usize = {
    let (mut bytes, mut level) = (0, 0);
    while level < LEVELS {
        bytes += 4 * (SIZE >> level) * (SIZE >> level);
        level += 1;
    }
    bytes
};

/// Kind of the entries in the cache. Their keys include the source of the decoder: images
/// of another one have other keys.
const KIND: &str = "texture";
const DECODER: &[u8] = include_bytes!("texture.rs");

/// An image with its mipmaps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// RGBA bytes from the largest to the 1 x 1 level; the first row is `v = 0`. A
    /// value is the square root of the linear colour.
    bytes: Vec<u8>,
}

impl Image {
    /// The levels, [`LEVELS`] of them, from the largest to 1 x 1.
    pub fn levels(&self) -> impl Iterator<Item = &[u8]> {
        let mut rest = &self.bytes[..];
        (0..LEVELS).map(move |level| {
            let side = SIZE >> level;
            let (bytes, smaller) = rest.split_at(4 * side * side);
            rest = smaller;
            bytes
        })
    }
}

/// The file of an image, not decoded yet.
#[derive(Clone, Debug)]
pub struct Source {
    path: PathBuf,
    file: Vec<u8>,
    key: Key,
}

/// Reads `textures/NAME.png` below the assets folder.
///
/// # Errors
/// When the file cannot be read.
pub fn read(assets: &Path, name: &str) -> Result<Source, TextureError> {
    let path = assets.join(format!("textures/{name}.png"));
    match std::fs::read(&path) {
        Ok(file) => Ok(Source {
            key: cache::key(KIND, &[DECODER, &file]),
            path,
            file,
        }),
        Err(error) => Err(TextureError::Read {
            path,
            reason: error.to_string(),
        }),
    }
}

/// Reads the image of a texture: of its pack, or below the assets folder.
///
/// # Errors
/// When the file cannot be read.
pub fn read_of(assets: &Path, texture: &Texture) -> Result<Source, TextureError> {
    match &texture.file {
        None => read(assets, &texture.pattern),
        Some(file) => Ok(packed(file)),
    }
}

fn packed(file: &PackedFile) -> Source {
    Source {
        path: PathBuf::from(file.asset_path()),
        file: file.bytes().to_vec(),
        key: cache::key(KIND, &[DECODER, file.bytes()]),
    }
}

/// Reads and decodes `textures/NAME.png` below the assets folder.
///
/// # Errors
/// As [`read`] and [`Source::decode`].
pub fn load(assets: &Path, name: &str) -> Result<Image, TextureError> {
    read(assets, name)?.decode()
}

impl Source {
    /// Identifies the image: equal keys have equal images.
    #[must_use]
    pub fn key(&self) -> &Key {
        &self.key
    }

    /// The image, from the cache if it is there. Returns a failed write to the cache too.
    ///
    /// # Errors
    /// As [`Source::decode`].
    pub fn decode_with(&self, store: &Store) -> Result<Image, TextureError> {
        let stored = store.get(&self.key).filter(|bytes| bytes.len() == BYTES);
        if let Some(bytes) = stored {
            return Ok(Image { bytes });
        }
        let image = self.decode()?;
        if let Err(problem) = store.put(&self.key, &image.bytes) {
            tracing::warn!("{problem}");
        }
        Ok(image)
    }

    /// Decodes the file and computes the mipmaps.
    ///
    /// # Errors
    /// When the file has another size or pixel format, or is damaged.
    pub fn decode(&self) -> Result<Image, TextureError> {
        let path = &self.path;
        let broken = |reason: String| TextureError::Read {
            path: path.clone(),
            reason,
        };
        let decoder = png::Decoder::new(Cursor::new(&self.file[..]));
        let mut reader = decoder.read_info().map_err(|e| broken(e.to_string()))?;
        let info = reader.info();
        let channels = match info.color_type {
            png::ColorType::Grayscale => 1,
            png::ColorType::Rgb => 3,
            _ => 0,
        };
        let side = SIZE as u32;
        let eight = info.bit_depth == png::BitDepth::Eight;
        if channels == 0 || !eight || (info.width, info.height) != (side, side) {
            return Err(TextureError::Format {
                found: format!(
                    "{}x{} pixels, {:?}, {:?} bits",
                    info.width, info.height, info.color_type, info.bit_depth
                ),
                path: path.clone(),
            });
        }
        let mut bytes = vec![0; SIZE * SIZE * channels];
        reader
            .next_frame(&mut bytes)
            .map_err(|e| broken(e.to_string()))?;
        let pixel = |p: &[u8]| match *p {
            [r, g, b] => [r, g, b],
            [grey] => [grey; 3],
            _ => [0; 3],
        };
        // Files start at the top row.
        let rows = bytes.chunks_exact(SIZE * channels).rev();
        let pixels = rows.flat_map(|row| row.chunks_exact(channels).map(pixel));
        Ok(with_mipmaps(pixels.collect()))
    }
}

/// An image with its mipmaps, from rows that start at `v = 0`.
fn with_mipmaps(pixels: Vec<[u8; 3]>) -> Image {
    let linear = |c: u8| (f32::from(c) / 255.0).powi(2);
    let linear: [f32; 256] = std::array::from_fn(|c| linear(c as u8));
    let mut bytes = Vec::with_capacity(BYTES);
    // The largest level has the bytes of the file.
    bytes.extend(pixels.iter().flat_map(|[r, g, b]| [*r, *g, *b, 255]));
    let mut level: Vec<[f32; 3]> = pixels
        .iter()
        .map(|p| p.map(|c| linear[usize::from(c)]))
        .collect();
    let mut side = SIZE;
    while side > 1 {
        let half = side / 2;
        let mut smaller = Vec::with_capacity(half * half);
        for rows in level.chunks_exact(2 * side) {
            let (top, bottom) = rows.split_at(side);
            let pairs = top.chunks_exact(2).zip(bottom.chunks_exact(2));
            smaller.extend(pairs.map(|(above, below)| -> [f32; 3] {
                let [a, b, c, d] = [above[0], above[1], below[0], below[1]];
                std::array::from_fn(|k| 0.25 * (a[k] + b[k] + c[k] + d[k]))
            }));
        }
        bytes.extend(smaller.iter().flat_map(|c| texel(*c)));
        level = smaller;
        side = half;
    }
    Image { bytes }
}

fn texel(linear: [f32; 3]) -> [u8; 4] {
    let [r, g, b] = linear.map(|c| (c.sqrt() * 255.0 + 0.5) as u8);
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assets() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
    }

    #[test]
    fn images_repeat_without_a_seam_and_are_not_flat() {
        let names = names(&assets());
        assert!(names.len() >= 16, "{names:?}");
        for name in names {
            let image = load(&assets(), &name).unwrap_or_else(|error| panic!("{error}"));
            let levels: Vec<&[u8]> = image.levels().collect();
            assert_eq!((levels.len(), levels[LEVELS - 1].len()), (LEVELS, 4));
            let top = levels[0];
            let pixel = |x: usize, y: usize| &top[(y * SIZE + x) * 4..][..3];
            let step = |a: &[u8], b: &[u8]| -> f64 {
                a.iter()
                    .zip(b)
                    .map(|(a, b)| f64::from(a.abs_diff(*b)))
                    .sum()
            };
            let column = |a: usize, b: usize| -> f64 {
                (0..SIZE).map(|y| step(pixel(a, y), pixel(b, y))).sum()
            };
            let row = |a: usize, b: usize| -> f64 {
                (0..SIZE).map(|x| step(pixel(x, a), pixel(x, b))).sum()
            };
            let most = |f: &dyn Fn(usize, usize) -> f64| {
                (0..SIZE - 1).map(|i| f(i, i + 1)).fold(0.0, f64::max)
            };
            let (widest, tallest) = (most(&column), most(&row));
            assert!(
                column(SIZE - 1, 0) <= 1.1 * widest,
                "{name}: seam left to right"
            );
            if !is_label(&name) {
                assert!(
                    row(SIZE - 1, 0) <= 1.1 * tallest,
                    "{name}: seam bottom to top"
                );
            }
            assert!(widest + tallest > 0.0, "{name} is flat");
            assert!(top.iter().step_by(4).any(|r| *r > 150), "{name} is dark");
        }
    }

    #[test]
    fn the_first_level_contains_the_bytes_of_the_file_from_the_bottom_up() {
        let image = with_mipmaps(
            (0..SIZE * SIZE)
                .map(|i| [(i % 256) as u8, (i / SIZE % 256) as u8, 7])
                .collect(),
        );
        let levels: Vec<&[u8]> = image.levels().collect();
        for (i, pixel) in levels[0].chunks_exact(4).enumerate() {
            assert_eq!(pixel, [(i % 256) as u8, (i / SIZE % 256) as u8, 7, 255]);
        }
        // A byte survives the square and the root, as in the smaller levels.
        for c in 0..=255u8 {
            assert_eq!(texel([(f32::from(c) / 255.0).powi(2); 3])[0], c);
        }
        // The mean of the squares.
        assert_eq!(levels[1][..4], [1, 1, 7, 255]);
    }

    #[test]
    fn the_cache_returns_the_decoded_image_or_none() {
        let folder = std::env::temp_dir().join(format!("images{}", std::process::id()));
        let store = Store::at(Some(folder.clone()), cache::LIMIT);
        let [wood, tiles] = ["wood", "tiles"].map(|name| read(&assets(), name).unwrap());
        assert!(store.get(wood.key()).is_none());
        let image = wood.decode().unwrap();
        assert_eq!(wood.decode_with(&store).unwrap(), image);
        assert_eq!(store.get(wood.key()).unwrap(), image.bytes);
        assert_eq!(wood.decode_with(&store).unwrap(), image);
        // Another file has another key, and an entry of another length is not an image.
        assert_ne!(tiles.decode_with(&store).unwrap(), image);
        store.put(wood.key(), b"short").unwrap();
        assert_eq!(wood.decode_with(&store).unwrap(), image);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn an_invalid_image_file_is_rejected_with_the_fix() {
        let folder = std::env::temp_dir().join(format!("textures{}", std::process::id()));
        std::fs::create_dir_all(folder.join("textures")).unwrap();
        let message = |name: &str| load(&folder, name).unwrap_err().to_string();
        assert!(message("none").contains("put a PNG file there"));
        std::fs::write(folder.join("textures/text.png"), "not an image").unwrap();
        assert!(
            message("text").contains("cannot be read"),
            "{}",
            message("text")
        );
        let file = std::fs::File::create(folder.join("textures/small.png")).unwrap();
        let mut encoder = png::Encoder::new(file, 2, 2);
        encoder.set_color(png::ColorType::Rgba);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&[9; 16]).unwrap();
        drop(writer);
        let small = message("small");
        assert!(
            small.contains("2x2") && small.contains("512x512"),
            "{small}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
