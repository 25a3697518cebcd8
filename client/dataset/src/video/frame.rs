//! One frame: the images, their names, and the text below them.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::layout::{Layout, Place};
use super::story::Story;
use crate::convert::{Size, scaled};
use crate::sheet::label;
use crate::sheet::raster::Canvas;
use crate::sheet::style::Area;

/// Background of text and between images.
const DARK: RGBColor = RGBColor(18, 21, 26);
const BRIGHT: RGBColor = RGBColor(240, 242, 244);
const DIM: RGBColor = RGBColor(150, 157, 166);

/// Colour of a phase on dark ground.
fn phase_colour(phase: u64) -> RGBColor {
    match phase {
        1 => RGBColor(86, 160, 233),
        2 => RGBColor(240, 170, 60),
        3 => RGBColor(232, 98, 84),
        4 => RGBColor(70, 190, 130),
        _ => RGBColor(120, 126, 134),
    }
}

/// Parts common to all frames.
pub(super) struct Painter<'a> {
    pub layout: &'a Layout,
    pub story: &'a Story,
    /// Names of the images.
    pub names: Vec<String>,
    /// Simulated seconds per second.
    pub speed: f64,
}

impl Painter<'_> {
    /// A frame, RGB8: `images` are as they were recorded, `moment` is simulation
    /// time, nanoseconds.
    ///
    /// # Errors
    /// When a frame cannot be rendered.
    pub fn frame(&self, images: Vec<(Vec<u8>, Size)>, moment: u64) -> anyhow::Result<Vec<u8>> {
        let Size { width, height } = self.layout.size;
        let mut canvas = Canvas::new(width, height, DARK.rgb());
        for ((pixels, size), place) in images.into_iter().zip(&self.layout.images) {
            let image = Canvas {
                width: place.size.width,
                height: place.size.height,
                pixels: scaled(pixels, size, place.size),
            };
            canvas.put(&image, place.x, place.y);
        }
        {
            let size = (width as u32, height as u32);
            let root = BitMapBackend::with_buffer(&mut canvas.pixels, size).into_drawing_area();
            if let Some((strip, words)) = self.layout.strip.zip(self.layout.words) {
                for (name, place) in self.names.iter().zip(&self.layout.images) {
                    self.name(&root, name, place)?;
                }
                self.strip(&root, &strip, moment)?;
                self.words(&root, &words, moment)?;
            }
            root.present()?;
        }
        Ok(canvas.pixels)
    }

    /// The name of an image in its upper left corner.
    fn name(&self, root: &Area<'_>, name: &str, place: &Place) -> anyhow::Result<()> {
        let letters = (self.layout.letters * 3 / 4).max(11) as u32;
        let (x, y) = (place.x as i32, place.y as i32);
        let (wide, high) = (
            label::width(name, letters) + letters as i32,
            letters as i32 * 3 / 2,
        );
        let ground = DARK.mix(0.55).filled();
        root.draw(&Rectangle::new([(x, y), (x + wide, y + high)], ground))?;
        label::left(
            root,
            name,
            (x + letters as i32 / 2, y + high / 2),
            letters,
            BRIGHT,
        )?;
        Ok(())
    }

    /// The phases over time; the future is dark.
    fn strip(&self, root: &Area<'_>, place: &Place, moment: u64) -> anyhow::Result<()> {
        let span = self.story.span;
        let across = |at: u64| {
            let share = at.saturating_sub(span.from) as f64 / (span.to - span.from).max(1) as f64;
            (share * place.size.width as f64).round() as i32
        };
        let (top, bottom) = (place.y as i32, (place.y + place.size.height) as i32);
        let bar = |from: u64, to: u64, colour: RGBAColor| {
            let corners = [(across(from), top), (across(to), bottom)];
            root.draw(&Rectangle::new(corners, colour.filled()))
        };
        for (phase, from, to) in self.story.stretches() {
            let colour = phase_colour(phase);
            bar(from, to, colour.mix(0.28))?;
            if from < moment {
                bar(from, to.min(moment), colour.to_rgba())?;
            }
        }
        Ok(())
    }

    /// The instruction; below it the phase, and on the right the time.
    fn words(&self, root: &Area<'_>, place: &Place, moment: u64) -> anyhow::Result<()> {
        let letters = self.layout.letters;
        let margin = (letters / 2) as i32;
        let room = place.size.width as i32 - 2 * margin;
        let (title, size) = label::fitted(&self.story.title, room, letters as u32);
        let first = (place.y + letters * 9 / 10) as i32;
        let second = (place.y + letters * 23 / 10) as i32;
        label::left(root, &title, (margin, first), size, BRIGHT)?;

        let small = (letters * 4 / 5).max(12) as u32;
        let seconds = moment.saturating_sub(self.story.span.start) as f64 * 1e-9;
        let mut time = format!("{seconds:.1} s");
        if (self.speed - 1.0).abs() > 1e-9 {
            time = format!("{}x   {time}", self.speed);
        }
        let end = Pos::new(HPos::Right, VPos::Center);
        let style = ("monospace", small).into_font().color(&DIM).pos(end);
        let at = (place.size.width as i32 - margin, second);
        root.draw(&Text::new(time, at, style))?;

        let Some(part) = self.story.part_at(moment) else {
            return Ok(());
        };
        if part.words.is_empty() {
            return Ok(());
        }
        let radius = small as i32 * 3 / 10;
        // Letters are a little above the middle of their line.
        let dot = (margin + radius, second - small as i32 / 6);
        root.draw(&Circle::new(dot, radius, phase_colour(part.phase).filled()))?;
        let x = margin + 3 * radius + 4;
        label::left(root, &part.words, (x, second), small, BRIGHT)?;
        Ok(())
    }
}
