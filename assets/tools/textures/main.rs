//! Writes the textures of the home: all of them painted here, none taken from
//! a photograph or a maker's label. Run it again after a change and commit what
//! it writes.
//!
//! `cargo run --release -p wheelarm-tests --example textures -- assets/textures`

mod labels;
mod noise;
mod surfaces;

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use wheelarm_server::geometry::texture::SIZE;

/// Colour at `(u, v)` in 0..1, `v` upwards; sRGB-like values 0 to 1.
type Pattern = fn(f32, f32) -> [f32; 3];

/// Every image by the name of its file.
const PATTERNS: [(&str, Pattern); 19] = [
    ("planks", surfaces::planks),
    ("tiles", surfaces::tiles),
    ("plaster", surfaces::plaster),
    ("wood", surfaces::wood),
    ("fabric", surfaces::fabric),
    ("marble", surfaces::marble),
    ("checker", surfaces::checker),
    ("brushed", surfaces::brushed),
    ("leaves", surfaces::leaves),
    ("books", surfaces::books),
    ("stripes", surfaces::stripes),
    ("label_mustard", labels::mustard),
    ("label_soup", labels::soup),
    ("label_crackers", labels::crackers),
    ("label_meat", labels::meat),
    ("label_coke", labels::coke),
    ("label_sugar", labels::sugar),
    ("label_bottle", labels::bottle),
    ("label_coffee", labels::coffee),
];

fn main() -> anyhow::Result<()> {
    let folder = std::env::args()
        .nth(1)
        .map(PathBuf::from)
        .context("the folder for the textures is missing")?;
    std::fs::create_dir_all(&folder)?;
    for (name, color) in PATTERNS {
        let path = folder.join(format!("{name}.png"));
        write(&path, &paint(color)).with_context(|| format!("writing {}", path.display()))?;
        println!("{name:16} {:7} bytes", std::fs::metadata(&path)?.len());
    }
    Ok(())
}

/// RGB bytes, the first row at the top.
fn paint(color: Pattern) -> Vec<[u8; 3]> {
    let at = |k: usize| (k as f32 + 0.5) / SIZE as f32;
    let rows = (0..SIZE).rev();
    rows.flat_map(|y| (0..SIZE).map(move |x| (x, y)))
        .map(|(x, y)| color(at(x), at(y)).map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8))
        .collect()
}

/// Writes a PNG, grey if it has no color, with its origin as metadata.
fn write(path: &Path, pixels: &[[u8; 3]]) -> anyhow::Result<()> {
    let grey = pixels.iter().all(|[r, g, b]| r == g && g == b);
    let file = BufWriter::new(std::fs::File::create(path)?);
    let mut encoder = png::Encoder::new(file, SIZE as u32, SIZE as u32);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.add_text_chunk("Source".to_owned(), "painted for WheelArm".to_owned())?;
    encoder.add_text_chunk("Copyright".to_owned(), "Apache-2.0".to_owned())?;
    let bytes = if grey {
        encoder.set_color(png::ColorType::Grayscale);
        pixels.iter().map(|p| p[0]).collect()
    } else {
        encoder.set_color(png::ColorType::Rgb);
        pixels.concat()
    };
    encoder.write_header()?.write_image_data(&bytes)?;
    Ok(())
}
