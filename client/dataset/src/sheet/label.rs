//! Words and their room on the sheet.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::style::text;
use super::{Area, DrawError};

/// Width of words, pixels.
pub fn width(words: &str, size: u32) -> i32 {
    let font = ("sans-serif", size).into_font();
    // Without a font nothing is drawn, so any number will do.
    font.box_size(words).map_or(0, |(w, _)| w as i32)
}

/// Draws words whose left end has its middle at (x, y); returns their width.
pub fn left(
    area: &Area<'_>,
    words: &str,
    at: (i32, i32),
    size: u32,
    colour: RGBColor,
) -> Result<i32, DrawError> {
    put(area, words, at, size, colour, HPos::Left)?;
    Ok(width(words, size))
}

/// Draws words whose right end has its middle at (x, y).
pub fn right(
    area: &Area<'_>,
    words: &str,
    at: (i32, i32),
    size: u32,
    colour: RGBColor,
) -> Result<(), DrawError> {
    put(area, words, at, size, colour, HPos::Right)
}

/// Draws words whose middle is at (x, y).
pub fn centre(
    area: &Area<'_>,
    words: &str,
    at: (i32, i32),
    size: u32,
    colour: RGBColor,
) -> Result<(), DrawError> {
    put(area, words, at, size, colour, HPos::Center)
}

fn put(
    area: &Area<'_>,
    words: &str,
    at: (i32, i32),
    size: u32,
    colour: RGBColor,
    side: HPos,
) -> Result<(), DrawError> {
    let style = text(size, colour).pos(Pos::new(side, VPos::Center));
    area.draw(&Text::new(words.to_owned(), at, style))
}

/// Names of lines beside their colours, in a row that begins at (x, y).
pub fn legend(
    area: &Area<'_>,
    (mut x, y): (i32, i32),
    entries: &[(&str, RGBColor)],
) -> Result<(), DrawError> {
    for (name, colour) in entries {
        let mark = PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(4));
        area.draw(&mark)?;
        x += 20 + 7;
        x += left(area, name, (x, y), 18, super::style::INK)? + 18;
    }
    Ok(())
}
