//! Text and its room on the sheet.

use std::borrow::Cow;
use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, GlyphId};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::error::DrawError;
use super::style::{Area, GREY, INK, SANS_SERIF, text};

/// Width of a text, pixels.
pub fn width(words: &str, size: u32) -> i32 {
    let font = ("sans-serif", size).into_font();
    // Without a font no text is rendered, so any number works.
    font.box_size(&legible(words)).map_or(0, |(w, _)| w as i32)
}

/// Words with `[U+4E2D]` in the place of each character that the built-in font lacks: it
/// has Latin, Greek and Cyrillic letters, no Chinese, Japanese, Korean, Arabic or emoji.
fn legible(words: &str) -> Cow<'_, str> {
    static FONT: LazyLock<Option<FontRef<'static>>> =
        LazyLock::new(|| FontRef::try_from_slice(SANS_SERIF).ok());
    let Some(font) = FONT.as_ref() else {
        return words.into();
    };
    let lacks = |letter: char| font.glyph_id(letter) == GlyphId(0) || letter.is_control();
    if !words.contains(lacks) {
        return words.into();
    }
    let mut out = String::new();
    for letter in words.chars() {
        match letter {
            '\n' | '\r' | '\t' => out.push(' '),
            _ if lacks(letter) => out.push_str(&format!("[U+{:04X}]", u32::from(letter))),
            _ => out.push(letter),
        }
    }
    out.into()
}

/// Narrowest letter, part of the height of the letters.
const NARROWEST: f64 = 0.1;

/// Words that fit into `room` pixels: in smaller letters where they are long, cut
/// where they would be too small to read, at a word if there is one. An instruction may
/// have 65,536 bytes, so only what could fit is measured.
pub fn fitted(words: &str, room: i32, letters: u32) -> (String, u32) {
    let least = (letters * 2 / 3).max(11);
    let most = (f64::from(room.max(1)) / (NARROWEST * f64::from(least))) as usize;
    let kept: String = words.chars().take(most).collect();
    let is_whole = kept.len() == words.len();
    for size in (least..=letters).rev().filter(|_| is_whole) {
        if width(&kept, size) <= room {
            return (kept, size);
        }
    }
    let ends = |at: usize| format!("{} …", kept[..at].trim_end());
    let longest = |ends_at: &[usize]| {
        let fit = ends_at.partition_point(|&at| width(&ends(at), least) <= room);
        fit.checked_sub(1).map(|last| ends(ends_at[last]))
    };
    let spaces: Vec<usize> = kept.match_indices(' ').map(|(at, _)| at).collect();
    let letters: Vec<usize> = kept.char_indices().map(|(at, _)| at).collect();
    let cut = longest(&spaces).or_else(|| longest(&letters));
    (cut.unwrap_or_default(), least)
}

/// Draws text whose left end has its middle at (x, y); returns its width, pixels.
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

/// Draws text whose right end has its middle at (x, y).
pub fn right(
    area: &Area<'_>,
    words: &str,
    at: (i32, i32),
    size: u32,
    colour: RGBColor,
) -> Result<(), DrawError> {
    put(area, words, at, size, colour, HPos::Right)
}

/// Draws text whose middle is at (x, y).
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
    area.draw(&Text::new(legible(words).into_owned(), at, style))
}

/// How a legend shows the meaning of a name.
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

/// Text size of a legend.
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

/// Draws a legend within a width; returns its number of rows.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::style;

    #[test]
    fn a_long_instruction_is_made_smaller_and_then_cut_at_a_word() {
        assert!(style::register());
        let words = "Pick up the yellow mustard bottle from the coffee table";
        assert_eq!(fitted(words, 4000, 30), (words.to_owned(), 30));
        let (whole, size) = fitted(words, width(words, 24), 30);
        assert_eq!((whole.as_str(), size), (words, 24));
        let (cut, size) = fitted(words, 200, 30);
        assert!(cut.ends_with(" …") && width(&cut, size) <= 200);
        assert!(words.starts_with(cut.trim_end_matches(" …")));
    }

    #[test]
    fn the_longest_instruction_is_cut_without_measuring_all_of_it() {
        assert!(style::register());
        for words in [
            "word ".repeat(13_000),
            "x".repeat(65_536),
            "漢".repeat(20_000),
        ] {
            // As often as a video has frames.
            for _ in 0..30 {
                let (cut, size) = fitted(&words, 1900, 40);
                assert!(
                    cut.chars().count() > 10 && width(&cut, size) <= 1900,
                    "{cut}"
                );
                assert!(words.starts_with(cut.trim_end_matches(" …")), "{cut}");
            }
        }
    }

    #[test]
    fn letters_missing_in_the_font_are_reported() {
        assert_eq!(
            legible("Hol die Tasse, côté gauche · Ж"),
            "Hol die Tasse, côté gauche · Ж"
        );
        assert_eq!(legible("拿 mug 🥤"), "[U+62FF] mug [U+1F964]");
        assert_eq!(legible("a\nb"), "a b");
        assert!(width("拿", 20) > width("m", 20));
    }
}
