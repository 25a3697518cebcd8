//! Words and their room on the sheet.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::error::DrawError;
use super::style::{Area, GREY, INK, text};

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

/// How a legend shows what a name stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    Line,
    /// A coloured background.
    Block,
    Dot,
    Ring,
}

/// An entry of a legend.
#[derive(Clone, Debug)]
pub struct Key<'a> {
    pub name: &'a str,
    pub colour: RGBColor,
    pub mark: Mark,
}

impl<'a> Key<'a> {
    pub fn new(name: &'a str, colour: RGBColor, mark: Mark) -> Self {
        Self { name, colour, mark }
    }
}

/// Size of the words of a legend.
const WORDS: u32 = 20;
/// Height of a row of a legend, pixels.
const ROW: i32 = 27;
/// Left edge of titles and legends, pixels.
const LEFT: i32 = 16;
const MARK: i32 = 22;

/// Draws a title and a legend above a plot and returns the room below them.
pub fn heading<'a>(area: &Area<'a>, title: &str, keys: &[Key<'_>]) -> Result<Area<'a>, DrawError> {
    left(area, title, (LEFT, 24), 26, INK)?;
    let (width, _) = area.dim_in_pixel();
    let rows = legend(area, (LEFT, 24 + 31), width as i32 - LEFT, keys)?;
    Ok(area.split_vertically(44 + ROW * rows).1)
}

/// Draws a legend within a width, in as many rows as it takes; returns how many.
fn legend(
    area: &Area<'_>,
    (left_edge, mut y): (i32, i32),
    right_edge: i32,
    keys: &[Key<'_>],
) -> Result<i32, DrawError> {
    let (mut x, mut rows) = (left_edge, i32::from(!keys.is_empty()));
    for key in keys {
        let wide = MARK + 7 + width(key.name, WORDS);
        if x > left_edge && x + wide > right_edge {
            (x, y, rows) = (left_edge, y + ROW, rows + 1);
        }
        let middle = (x + MARK / 2, y);
        match key.mark {
            Mark::Line => {
                let line = [(x, y), (x + MARK, y)];
                area.draw(&PathElement::new(line, key.colour.stroke_width(4)))?;
            }
            Mark::Block => {
                let block = [(x, y - 9), (x + MARK, y + 9)];
                area.draw(&Rectangle::new(block, key.colour.filled()))?;
                area.draw(&Rectangle::new(block, GREY.stroke_width(1)))?;
            }
            Mark::Dot => area.draw(&Circle::new(middle, 5, key.colour.filled()))?,
            Mark::Ring => area.draw(&Circle::new(middle, 8, key.colour.stroke_width(3)))?,
        }
        left(area, key.name, (x + MARK + 7, y), WORDS, INK)?;
        x += wide + 18;
    }
    Ok(rows)
}
