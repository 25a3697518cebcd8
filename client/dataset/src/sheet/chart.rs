//! Charts of many episodes, as PNGs: squares of the outcome of each one, shares over
//! time, and bars of shares. The caller defines the meaning of colours.

use std::path::Path;

use plotters::prelude::*;

use super::error::SheetError;
use super::label::{self, Key, Mark};
use super::style::{Area, FAINT, GREEN, GREY, INK, LINES, PAPER, RED, register, strokes};

/// Width of every chart, pixels.
const WIDTH: u32 = 1400;
/// Room to the left for names, pixels.
const NAMES: i32 = 250;
/// Room around, pixels.
const MARGIN: i32 = 24;
/// Room for title and legend, pixels.
const HEADING: i32 = 40;
const LEGEND: i32 = 30;
/// Side of a square and its room, pixels.
const SQUARE: i32 = 20;
/// Squares in a line.
const LINE: usize = 50;
/// Height of a bar and its room, pixels.
const BAR: i32 = 38;
/// Height of a chart over time, pixels.
const TIME: u32 = 520;

/// Colour by index: 0 is green, for good; the fallback is grey.
fn colour(index: usize) -> RGBColor {
    const OTHERS: [RGBColor; 8] = [
        RED,
        LINES[1],
        RGBColor(240, 200, 40),
        LINES[0],
        LINES[3],
        LINES[4],
        RGBColor(120, 80, 50),
        RGBColor(60, 60, 60),
    ];
    match index {
        0 => GREEN,
        i => OTHERS.get(i - 1).copied().unwrap_or(GREY),
    }
}

/// A colour of a scale from nothing (grey) to all (green), `place` of `count`.
fn scale(place: usize, count: usize) -> RGBColor {
    let share = place as f64 / (count.max(2) - 1) as f64;
    let mix =
        |from: u8, to: u8| (f64::from(from) + share * (f64::from(to) - f64::from(from))) as u8;
    RGBColor(mix(222, 18), mix(222, 120), mix(214, 74))
}

/// Squares of one name: the meaning of each, and the index of its kind.
pub type Squares = (String, Vec<(u64, usize)>);

/// Draws a line of squares for each name, in the order of their seeds, coloured by
/// their kind: green for the first of `kinds`.
///
/// # Errors
/// [`SheetError`].
pub fn squares(
    title: &str,
    kinds: &[String],
    rows: &[Squares],
    out: &Path,
) -> Result<(), SheetError> {
    let lines: usize = rows
        .iter()
        .map(|(_, all)| all.len().div_ceil(LINE).max(1))
        .sum();
    let height = |legend: i32| {
        HEADING + legend + lines as i32 * (SQUARE + 4) + rows.len() as i32 * 8 + 2 * MARGIN
    };
    save(title, kinds, &|i| colour(i), height, out, &|area, top| {
        let mut y = top;
        for (name, all) in rows {
            label::left(area, name, (MARGIN, y + SQUARE / 2), 20, INK)?;
            for (i, (seed, kind)) in all.iter().enumerate() {
                let x = NAMES + (i % LINE) as i32 * (SQUARE + 2);
                let line = y + (i / LINE) as i32 * (SQUARE + 4);
                let corners = [(x, line), (x + SQUARE, line + SQUARE)];
                area.draw(&Rectangle::new(corners, colour(*kind).filled()))?;
                if i % LINE == 0 {
                    label::right(
                        area,
                        &seed.to_string(),
                        (x - 8, line + SQUARE / 2),
                        15,
                        GREY,
                    )?;
                }
            }
            y += all.len().div_ceil(LINE).max(1) as i32 * (SQUARE + 4) + 8;
        }
        Ok(())
    })
}

/// Draws, for each name, shares of its episodes that make up a whole, by `kinds` from
/// nothing to all.
///
/// # Errors
/// [`SheetError`].
pub fn bars(
    title: &str,
    kinds: &[String],
    rows: &[(String, Vec<f64>)],
    out: &Path,
) -> Result<(), SheetError> {
    let count = kinds.len();
    let height = |legend: i32| HEADING + legend + rows.len() as i32 * BAR + 34 + 2 * MARGIN;
    save(
        title,
        kinds,
        &|i| scale(i, count),
        height,
        out,
        &|area, top| {
            let room = WIDTH as i32 - NAMES - MARGIN - 20;
            let at = |share: f64| NAMES + (share * f64::from(room)).round() as i32;
            for (row, (name, shares)) in rows.iter().enumerate() {
                let y = top + row as i32 * BAR;
                label::left(area, name, (MARGIN, y + 14), 20, INK)?;
                let mut from = 0.0;
                for (kind, share) in shares.iter().enumerate() {
                    let corners = [(at(from), y), (at(from + share), y + BAR - 10)];
                    if *share > 0.0 {
                        area.draw(&Rectangle::new(corners, scale(kind, count).filled()))?;
                        if *share > 0.04 {
                            let middle = (i32::midpoint(corners[0].0, corners[1].0), y + 14);
                            let ink = if 2 * kind > count { PAPER } else { INK };
                            let words = format!("{:.0}", 100.0 * share);
                            label::centre(area, &words, middle, 17, ink)?;
                        }
                    }
                    from += share;
                }
            }
            let below = top + rows.len() as i32 * BAR + 8;
            for percent in (0..=100).step_by(20) {
                let x = at(f64::from(percent) / 100.0);
                label::centre(area, &format!("{percent} %"), (x, below), 17, GREY)?;
            }
            Ok(())
        },
    )
}

/// A line of a chart: its name and points.
pub type Steps = (String, Vec<(f64, f64)>);

/// Draws stairs from 0 to 1 over seconds.
///
/// # Errors
/// [`SheetError`].
pub fn shares_over_time(title: &str, lines: &[Steps], out: &Path) -> Result<(), SheetError> {
    let names: Vec<String> = lines.iter().map(|(name, _)| name.clone()).collect();
    let last = lines.iter().flat_map(|(_, points)| points).map(|p| p.0);
    let last = last.fold(1.0, f64::max) * 1.02;
    let hue = |i: usize| LINES[i % LINES.len()];
    let height = |legend: i32| HEADING + legend + TIME as i32 + MARGIN;
    save(title, &names, &hue, height, out, &|area, top| {
        let (_, area) = area.split_vertically(top);
        let mut chart = ChartBuilder::on(&area)
            .margin(MARGIN)
            .x_label_area_size(48)
            .y_label_area_size(74)
            .build_cartesian_2d(0.0..last, 0.0..1.02)?;
        strokes(&mut chart)
            .x_desc("simulated time, s")
            .y_desc("share done")
            .draw()?;
        for (i, (_, points)) in lines.iter().enumerate() {
            let mut stairs = vec![(0.0, 0.0)];
            let mut before = 0.0;
            for &(x, y) in points {
                stairs.extend([(x, before), (x, y)]);
                before = y;
            }
            stairs.push((last, before));
            // Beyond as many lines as there are colours, thinner ones.
            let wide = if i < LINES.len() { 3 } else { 1 };
            chart.draw_series(LineSeries::new(stairs, hue(i).stroke_width(wide)))?;
        }
        Ok(())
    })
}

/// Draws the count of each difference, and the 95 % interval of the mean's bootstraps.
///
/// # Errors
/// [`SheetError`].
pub fn histogram(
    title: &str,
    axis: &str,
    values: &[f64],
    interval: [f64; 2],
    out: &Path,
) -> Result<(), SheetError> {
    const CELLS: usize = 20;
    let most = values.iter().map(|v| v.abs()).fold(1.0, f64::max);
    let width = 2.0 * most / CELLS as f64;
    let mut counts = [0_u32; CELLS];
    for value in values {
        let cell = ((value + most) / width) as usize;
        counts[cell.min(CELLS - 1)] += 1;
    }
    let top_count = f64::from(counts.iter().copied().max().unwrap_or(0).max(1)) * 1.1;
    let height = |legend: i32| HEADING + legend + TIME as i32 + MARGIN;
    let keys = ["95 % of the mean".to_owned()];
    save(title, &keys, &|_| LINES[1], height, out, &|area, top| {
        let (_, area) = area.split_vertically(top);
        let mut chart = ChartBuilder::on(&area)
            .margin(MARGIN)
            .x_label_area_size(48)
            .y_label_area_size(74)
            .build_cartesian_2d(-most..most, 0.0..top_count)?;
        strokes(&mut chart).x_desc(axis).y_desc("pairs").draw()?;
        let bars = counts.iter().enumerate().map(|(i, count)| {
            let from = -most + i as f64 * width;
            let corners = [
                (from + 0.05 * width, 0.0),
                (from + 0.95 * width, f64::from(*count)),
            ];
            Rectangle::new(corners, LINES[0].filled())
        });
        chart.draw_series(bars)?;
        let [low, high] = interval;
        let band = [(low, 0.0), (high, top_count)];
        chart.draw_series([Rectangle::new(band, LINES[1].mix(0.35).filled())])?;
        Ok(())
    })
}

/// Content of a chart below its legend.
type Fill<'a> = &'a dyn Fn(&Area<'_>, i32) -> Result<(), SheetError>;

/// Draws a title, a legend and what `fill` draws below them into a PNG.
fn save(
    title: &str,
    names: &[String],
    hue: &dyn Fn(usize) -> RGBColor,
    height: impl Fn(i32) -> i32,
    out: &Path,
    fill: Fill<'_>,
) -> Result<(), SheetError> {
    if !register() {
        return Err(SheetError::Fonts);
    }
    let named = names.iter().enumerate();
    let keys: Vec<Key<'_>> = named
        .map(|(i, name)| Key::new(name, hue(i), Mark::Block))
        .collect();
    let rows = legend_rows(&keys);
    let size = (WIDTH, height(rows * LEGEND).max(120) as u32);
    let mut canvas = super::raster::Canvas::new(size.0 as usize, size.1 as usize, PAPER.rgb());
    {
        let root = BitMapBackend::with_buffer(&mut canvas.pixels, size).into_drawing_area();
        label::heading(&root, title, &keys)?;
        let line = HEADING + rows * LEGEND + 10;
        let edge = [(MARGIN, line), (WIDTH as i32 - MARGIN, line)];
        root.draw(&PathElement::new(edge, FAINT.stroke_width(1)))?;
        fill(&root, line + 14)?;
        root.present()?;
    }
    canvas.write(out).map_err(|source| SheetError::Write {
        path: out.display().to_string(),
        source,
    })
}

/// Approximate number of rows of a legend of the chart's width.
fn legend_rows(keys: &[Key<'_>]) -> i32 {
    let wide = |key: &Key<'_>| label::width(key.name, 20) + 47;
    let (mut rows, mut x) = (i32::from(!keys.is_empty()), 0);
    for key in keys {
        if x > 0 && x + wide(key) > WIDTH as i32 - 40 {
            (rows, x) = (rows + 1, 0);
        }
        x += wide(key);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of pixels of a PNG with a colour.
    fn count(path: &Path, wanted: RGBColor) -> usize {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let (r, g, b) = wanted.rgb();
        pixels.chunks_exact(3).filter(|p| *p == [r, g, b]).count()
    }

    #[test]
    fn as_many_squares_are_green_as_succeeded() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("squares.png");
        let kinds = ["success", "timeout"].map(str::to_owned);
        let rows = |good: u64| {
            let all = (0..60).map(|seed| (seed, usize::from(seed >= good)));
            vec![("pick".to_owned(), all.collect())]
        };
        let green = |good| {
            squares("Outcomes", &kinds, &rows(good), &out).unwrap();
            count(&out, GREEN)
        };
        let one = (SQUARE as usize).pow(2);
        let more = green(40) - green(10);
        assert!(more.abs_diff(30 * one) < 2 * 30 * SQUARE as usize, "{more}");
    }

    #[test]
    fn a_bar_is_as_wide_as_its_share() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("bars.png");
        let kinds = ["nothing", "all"].map(str::to_owned);
        let green = |share: f64| {
            let rows = [("pick".to_owned(), vec![1.0 - share, share])];
            bars("Progress", &kinds, &rows, &out).unwrap();
            count(&out, scale(1, 2)) as f64
        };
        let [none, quarter, half] = [0.0, 0.25, 0.5].map(green);
        let ratio = (half - none) / (quarter - none);
        assert!((ratio - 2.0).abs() < 0.1, "{none} {quarter} {half}");
    }

    #[test]
    fn stairs_and_histograms_of_empty_and_large_data_are_drawn() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("chart.png");
        shares_over_time("Success", &[], &out).unwrap();
        let line = ("all".to_owned(), vec![(3.0, 0.5), (9.0, 1.0)]);
        shares_over_time("Success", &[line], &out).unwrap();
        assert!(count(&out, LINES[0]) > 500);
        histogram("Difference", "points", &[], [0.0, 0.0], &out).unwrap();
        histogram(
            "Difference",
            "points",
            &[-20.0, 0.0, 60.0],
            [-5.0, 30.0],
            &out,
        )
        .unwrap();
        assert!(count(&out, LINES[0]) > 500);
    }
}
