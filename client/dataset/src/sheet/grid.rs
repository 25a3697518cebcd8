//! A grid of images with text below them, as one PNG.

use std::path::Path;

use plotters::prelude::*;

use super::error::SheetError;
use super::raster::Canvas;
use super::style::{GREEN, GREY, INK, PAPER, RED};
use super::{label, style};

/// One image of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
    /// RGB8, row-major from the top left; empty for none.
    pub rgb: Vec<u8>,
    /// The text below it.
    pub title: String,
    /// Smaller text beside it.
    pub note: String,
    /// The mark beside the text: green or red.
    pub is_good: bool,
}

/// Room around images, pixels.
const GAP: usize = 12;
/// Room for the text, pixels.
const WORDS: usize = 40;

/// Draws `cells` in rows of `columns` into `out`. All images have one size.
///
/// # Errors
/// [`SheetError`].
pub fn grid(cells: &[Cell], columns: usize, out: &Path) -> Result<(), SheetError> {
    if !style::register() {
        return Err(SheetError::Fonts);
    }
    let columns = columns.max(1);
    let width = cells.iter().map(|cell| cell.width).max().unwrap_or(1);
    let height = cells.iter().map(|cell| cell.height).max().unwrap_or(1);
    let rows = cells.len().div_ceil(columns).max(1);
    let (step_x, step_y) = (width + GAP, height + WORDS + GAP);
    let mut canvas = Canvas::new(GAP + columns * step_x, GAP + rows * step_y, PAPER.rgb());
    let corner = |index: usize| {
        (
            GAP + index % columns * step_x,
            GAP + index / columns * step_y,
        )
    };
    for (index, cell) in cells.iter().enumerate() {
        if cell.rgb.len() != 3 * cell.width * cell.height {
            continue;
        }
        let (x, y) = corner(index);
        let image = Canvas {
            width: cell.width,
            height: cell.height,
            pixels: cell.rgb.clone(),
        };
        canvas.put(&image, x, y);
    }
    {
        let size = (canvas.width as u32, canvas.height as u32);
        let root = BitMapBackend::with_buffer(&mut canvas.pixels, size).into_drawing_area();
        for (index, cell) in cells.iter().enumerate() {
            let (x, y) = corner(index);
            let (x, y) = (x as i32, (y + height + WORDS / 2) as i32);
            let colour = if cell.is_good { GREEN } else { RED };
            root.draw(&Circle::new((x + 9, y + 1), 7, colour.filled()))?;
            let words = label::left(&root, &cell.title, (x + 26, y), 24, INK)?;
            label::left(&root, &cell.note, (x + 26 + words + 14, y), 20, GREY)?;
        }
        root.present()?;
    }
    canvas.write(out).map_err(|source| SheetError::Write {
        path: out.display().to_string(),
        source,
    })
}
