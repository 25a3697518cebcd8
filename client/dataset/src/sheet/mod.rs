//! The contact sheet: one PNG that summarizes an episode. Images of
//! every camera with depth over time, then plots of the movement.

pub(crate) mod axis;
pub mod chart;
mod crowd;
pub(crate) mod error;
pub mod grid;
pub(crate) mod label;
mod mount;
pub(crate) mod plots;
pub(crate) mod raster;
pub(crate) mod style;

use std::path::Path;

use plotters::prelude::*;

pub use error::SheetError;

use crate::read::{Episode, Frame, ReadError, Summary};
use raster::Canvas;
use style::{
    AMBER, Area, COLUMNS, GAP, GREEN, GREY, GUTTER, HEADER, INK, MARGIN, PAPER, PLOTS, RED, TIMES,
    WIDTH,
};

/// One camera's images at the times of the columns.
struct Strip {
    camera: String,
    frames: Vec<Frame>,
    range: (f32, f32),
}

impl Strip {
    /// Rows of images: colour, and depth where it was recorded.
    fn rows(&self) -> i32 {
        let colour_alone = |frame: &Frame| frame.depth.is_empty();
        match !self.frames.is_empty() && self.frames.iter().all(colour_alone) {
            true => 1,
            false => 2,
        }
    }
}

/// Draws the sheet of an episode into `out`.
///
/// # Errors
/// [`SheetError`].
pub fn sheet(episode: &Episode, out: &Path) -> Result<(), SheetError> {
    if !style::register() {
        return Err(SheetError::Fonts);
    }
    let summary = episode.summary()?;
    let start = summary.span_nanos.0;
    let times = times(episode, &summary)?;
    let mut strips = Vec::new();
    for camera in episode.cameras()? {
        strips.push(strip(episode, &camera, &times)?);
    }

    let columns = COLUMNS as i32;
    let tile = (WIDTH as i32 - 2 * MARGIN - GUTTER - (columns - 1) * GAP) / columns;
    let heights: Vec<i32> = strips
        .iter()
        .map(|s| {
            s.frames
                .first()
                .map_or(40, |f| tile * f.height as i32 / f.width as i32)
        })
        .collect();
    let sizes = strips.iter().zip(&heights);
    let images: i32 = sizes.map(|(strip, h)| strip.rows() * (h + GAP) + GAP).sum();
    let height = HEADER + TIMES + images + PLOTS + MARGIN;
    let mut canvas = Canvas::new(WIDTH as usize, height as usize, PAPER.rgb());

    let mut rows = Vec::new();
    let mut y = HEADER + TIMES;
    for (strip, &h) in strips.iter().zip(&heights) {
        for (i, frame) in strip.frames.iter().enumerate() {
            let x = (MARGIN + GUTTER + i as i32 * (tile + GAP)) as usize;
            let (w, h) = (tile as usize, h as usize);
            canvas.put(&raster::colour(frame, w, h), x, y as usize);
            let below = y as usize + h + GAP as usize;
            if strip.rows() > 1 {
                canvas.put(&raster::depth(frame, strip.range, w, h), x, below);
            }
        }
        if strip.rows() > 1 && !strip.frames.is_empty() {
            bar(&mut canvas, MARGIN + GUTTER - 34, y + h + GAP, h);
        }
        rows.push((y, h));
        y += strip.rows() * (h + GAP) + GAP;
    }

    {
        let size = (WIDTH, height as u32);
        let root = BitMapBackend::with_buffer(&mut canvas.pixels, size).into_drawing_area();
        header(&root, &summary)?;
        let seconds: Vec<f64> = times.iter().map(|&t| (t - start) as f64 * 1e-9).collect();
        let phases = plots::phases_at(episode, start, &seconds);
        for (i, (t, phase)) in seconds.iter().zip(phases).enumerate() {
            let (x, y) = (MARGIN + GUTTER + i as i32 * (tile + GAP), HEADER + 34);
            let w = label::left(&root, &format!("{t:.2} s"), (x, y), 24, INK)?;
            label::left(&root, &phase, (x + w + 12, y), 20, GREY)?;
        }
        for (strip, &(y, h)) in strips.iter().zip(&rows) {
            labels(&root, strip, y, h)?;
        }
        let plot_area = root.clone().shrink(
            (MARGIN - 10, y + 6),
            (WIDTH - 2 * MARGIN as u32 + 20, PLOTS as u32),
        );
        plots::draw(episode, &plot_area, start)?;
        root.present()?;
    }
    canvas.write(out).map_err(|source| SheetError::Write {
        path: out.display().to_string(),
        source,
    })
}

/// Times of the columns, nanoseconds, spread over the whole episode.
fn times(episode: &Episode, summary: &Summary) -> Result<Vec<u64>, ReadError> {
    let mut best: Vec<u64> = Vec::new();
    for camera in episode.cameras()? {
        let camera = episode.camera(&camera)?;
        if camera.len() > best.len() {
            best = camera.stamps().to_vec();
        }
    }
    if best.is_empty() {
        let (first, last) = summary.span_nanos;
        let step = (last - first) / (COLUMNS as u64 - 1);
        return Ok((0..COLUMNS as u64).map(|i| first + i * step).collect());
    }
    let columns = best.len().min(COLUMNS);
    let last = best.len() - 1;
    let spread = |i: usize| {
        best[if columns > 1 {
            i * last / (columns - 1)
        } else {
            0
        }]
    };
    Ok((0..columns).map(spread).collect())
}

fn strip(episode: &Episode, name: &str, times: &[u64]) -> Result<Strip, ReadError> {
    let camera = episode.camera(name)?;
    let mut frames = Vec::new();
    if !camera.is_empty() {
        for &time in times {
            let nearest = camera
                .stamps()
                .iter()
                .enumerate()
                .min_by_key(|(_, s)| s.abs_diff(time))
                .map_or(0, |(i, _)| i);
            frames.push(camera.frame(episode, nearest)?);
        }
    }
    let range = raster::depth_range(&frames);
    Ok(Strip {
        camera: name.to_owned(),
        frames,
        range,
    })
}

fn header(root: &Area<'_>, summary: &Summary) -> Result<(), SheetError> {
    let title = if summary.instruction.is_empty() {
        &summary.label
    } else {
        &summary.instruction
    };
    let (title, size) = label::fitted(title, WIDTH as i32 - 2 * MARGIN, 50);
    label::left(root, &title, (MARGIN, 54), size, INK)?;
    let x = badge(
        root,
        MARGIN,
        if summary.success {
            "SUCCESS"
        } else {
            "NOT SUCCEEDED"
        },
        if summary.success { GREEN } else { RED },
    )?;
    let x = badge(
        root,
        x,
        if summary.complete {
            "COMPLETE"
        } else {
            "PARTIAL"
        },
        if summary.complete { GREEN } else { AMBER },
    )?;
    let (first, last) = summary.span_nanos;
    let [task, ..] = &summary.task;
    let missed: u64 = summary.streams.iter().map(|s| s.missed).sum();
    let missed = match summary.streams.iter().all(|s| s.counted) {
        true => missed.to_string(),
        false => format!("at least {missed}"),
    };
    let facts = format!(
        "{}   ·   task {task}, seed {}   ·   {:.1} s   ·   {missed} samples missed   ·   {}",
        summary.label,
        summary.seed,
        (last - first) as f64 * 1e-9,
        summary.origin[1],
    );
    label::left(root, &facts, (x + 14, 119), 25, GREY)?;

    let (mut x, mut y) = (MARGIN, 168);
    for (name, holds, value) in &summary.conditions {
        let colour = if *holds { GREEN } else { RED };
        let words = format!("{name}: {value:.3}");
        if x + 26 + label::width(&words, 22) > WIDTH as i32 - MARGIN {
            (x, y) = (MARGIN, y + 29);
        }
        root.draw(&Circle::new((x + 8, y + 1), 7, colour.filled()))?;
        x += 26 + label::left(root, &words, (x + 26, y), 22, INK)? + 36;
    }
    label::left(root, &summary.failure_reason, (x, y), 22, RED)?;
    Ok(())
}

/// A coloured label; returns the position of the next one.
fn badge(root: &Area<'_>, x: i32, words: &str, colour: RGBColor) -> Result<i32, SheetError> {
    let w = label::width(words, 22) + 32;
    let corners = [(x, 100), (x + w, 138)];
    root.draw(&Rectangle::new(corners, colour.filled()))?;
    label::centre(root, words, (x + w / 2, 119), 22, WHITE)?;
    Ok(x + w + 12)
}

fn labels(root: &Area<'_>, strip: &Strip, y: i32, h: i32) -> Result<(), SheetError> {
    label::left(root, &strip.camera, (MARGIN, y + 16), 27, INK)?;
    if strip.frames.is_empty() {
        let at = (MARGIN + GUTTER, y + 16);
        label::left(root, "no images", at, 24, GREY)?;
        return Ok(());
    }
    label::left(root, "colour", (MARGIN, y + 48), 20, GREY)?;
    let below = y + h + GAP;
    if strip.rows() == 1 {
        return Ok(());
    }
    label::left(root, "depth", (MARGIN, below + 12), 20, GREY)?;
    let x = MARGIN + GUTTER - 42;
    let (near, far) = strip.range;
    label::right(root, &format!("{near:.1} m"), (x, below + 40), 18, GREY)?;
    label::right(root, &format!("{far:.1} m"), (x, below + h - 10), 18, GREY)?;
    Ok(())
}

/// The colour bar of a depth row: near above, far below.
fn bar(canvas: &mut Canvas, x: i32, y: i32, h: i32) {
    let mut column = Canvas::new(18, h.max(1) as usize, (0, 0, 0));
    for row in 0..column.height {
        let share = row as f32 / column.height as f32;
        let colour = raster::shade(share.exp(), (1.0, 1_f32.exp()));
        for k in 0..column.width {
            let at = 3 * (row * column.width + k);
            column.pixels[at..at + 3].copy_from_slice(&colour);
        }
    }
    canvas.put(&column, x as usize, y as usize);
}
