//! Diagrams: drawn into memory, written as PNG.

use std::path::Path;
use std::sync::OnceLock;

use anyhow::Context;
use plotters::backend::BitMapBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::style::{FontStyle, WHITE, register_font};

/// The drawing area of a diagram.
pub type Paper<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// Draws a diagram of (width, height) pixels into a PNG file.
///
/// # Errors
/// Errors of `draw`, or when the file cannot be written.
pub fn save(
    path: &Path,
    size: (u32, u32),
    draw: impl FnOnce(&Paper<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    register_fonts();
    let mut pixels = vec![0; size.0 as usize * size.1 as usize * 3];
    {
        let paper = BitMapBackend::with_buffer(&mut pixels, size).into_drawing_area();
        paper.fill(&WHITE)?;
        draw(&paper)?;
        paper.present()?;
    }
    let file = std::fs::File::create(path).with_context(|| path.display().to_string())?;
    let mut encoder = png::Encoder::new(std::io::BufWriter::new(file), size.0, size.1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&pixels)?;
    Ok(())
}

/// Registers the font once.
fn register_fonts() {
    static DONE: OnceLock<()> = OnceLock::new();
    DONE.get_or_init(|| {
        // A rejected font leads to an error of the first diagram.
        let _ = register_font(
            "sans-serif",
            FontStyle::Normal,
            epaint_default_fonts::UBUNTU_LIGHT,
        );
    });
}
