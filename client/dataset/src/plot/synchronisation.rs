//! When each stream was sampled, where the rows of the reference camera are
//! among the samples, and the motion that rows at that rate cannot show.

use std::path::Path;
use wheelarm_proto::StreamId;

use plotters::prelude::*;

use super::{PANEL, canvas};
use crate::align::{AlignOptions, Aligned, Coverage, align, usual_distance};
use crate::read::Episode;
use crate::sheet::axis::Axis;
use crate::sheet::error::DrawError;
use crate::sheet::label;
use crate::sheet::label::{Key, Mark};
use crate::sheet::plots::line;
use crate::sheet::style::{self, Area, BLUE, GREY, INK, ORANGE, strokes};

/// Length of the piece of the curves that is shown, seconds.
const PIECE: f64 = 1.0;
/// Length of the piece of the samples that is shown, in rows.
const ROWS: f64 = 3.6;
const WIDTH: u32 = 2 * PANEL.0;

/// One stream against the rows.
struct Beat {
    name: String,
    /// Times of its samples, seconds.
    times: Vec<f64>,
    /// Notes about it.
    words: String,
}

/// A quantity at its samples and at the rows.
struct Curve {
    title: String,
    recorded: Vec<(f64, f64)>,
    rows: Vec<(f64, f64)>,
}

/// Draws the samples of every stream beside the rows, and three quantities in a
/// second in which they move, as in the paper's figures.
///
/// # Errors
/// When the episode cannot be read or aligned or the image cannot be written.
pub fn synchronisation(
    episode: &Episode,
    options: &AlignOptions,
    out: &Path,
) -> anyhow::Result<()> {
    anyhow::ensure!(style::register(), "cannot use the built-in fonts");
    let aligned = align(episode, options, &|_| true)?;
    let start = episode.summary()?.span_nanos.0;
    let seconds = |t: &u64| (*t as f64 - start as f64) * 1e-9;
    let rows: Vec<f64> = aligned.stamps.iter().map(seconds).collect();
    let mut beats = Vec::new();
    for stream in episode.streams()? {
        // A hash describes its own tick: there is nothing between two.
        if stream == "state_hash" {
            continue;
        }
        let stamps = episode.stamps(&stream)?;
        if let Some(words) = summary_of(&aligned, &stream, &stamps) {
            let times = stamps.iter().map(seconds).collect();
            beats.push(Beat {
                name: stream,
                times,
                words,
            });
        }
    }
    let curves = curves(episode, &aligned, start)?;
    let height = 130 + 34 * beats.len() as u32;
    let size = (WIDTH, height + 2 * PANEL.1);
    canvas(out, size, |root| {
        let (above, below) = root.split_vertically(height);
        let middle = curves.first().map_or(0.0, |c| liveliest(&c.recorded));
        raster(&above, &aligned.reference, &rows, &beats, middle)?;
        for (area, curve) in below.split_evenly((2, 2)).iter().zip(&curves) {
            points(area, curve)?;
        }
        Ok(())
    })
}

/// Distances of a stream's samples from the rows; `None` for streams
/// that are not aligned.
fn summary_of(aligned: &Aligned, stream: &str, stamps: &[u64]) -> Option<String> {
    let rate = 1e9 / usual_distance(stamps)?.max(1) as f64;
    let place = match StreamId::parse(stream).camera_name() {
        Some(camera) => {
            let frames = aligned.frames.get(camera)?;
            let without = frames.iter().filter(|f| f.is_none()).count();
            match without {
                0 => "an image for every row".to_owned(),
                n => format!("{} without an image", count(n)),
            }
        }
        None => around(aligned.coverage.get(stream)?),
    };
    Some(format!("{rate:.0} Hz, {place}"))
}

fn count(rows: usize) -> String {
    format!("{rows} row{}", if rows == 1 { "" } else { "s" })
}

fn around(coverage: &Coverage) -> String {
    let valid = || {
        coverage
            .valid
            .iter()
            .zip(&coverage.age)
            .filter(|(v, _)| **v)
    };
    let between = valid().filter(|(_, age)| **age > 0).count();
    let farthest = valid().map(|(_, age)| *age).max().unwrap_or(0) as f64 * 1e-6;
    let mut out = if between == 0 {
        "every row falls on a sample".to_owned()
    } else {
        format!(
            "{} between samples, at most {farthest:.1} ms from one",
            count(between)
        )
    };
    let without = coverage.valid.iter().filter(|v| !**v).count();
    if without > 0 {
        out += &format!("; {} without a value", count(without));
    }
    out
}

fn curves(episode: &Episode, aligned: &Aligned, start: u64) -> anyhow::Result<Vec<Curve>> {
    let (_, roles) = episode.roles()?;
    let wanted = [
        (
            "End effector in base_link, z, m",
            ("pose", "pose", 7 * roles.end_effector + 2),
        ),
        (
            "Arm joint 2, rad",
            ("joint_state", "position", roles.arm[1]),
        ),
        ("Chair's IMU, quaternion z", ("imu", "orientation", 2)),
        (
            "Chair's IMU, angular velocity z, rad/s",
            ("imu", "angular_velocity", 2),
        ),
    ];
    let mut out = Vec::new();
    for (title, (stream, column, at)) in wanted {
        out.push(Curve {
            title: title.to_owned(),
            recorded: line(episode, (stream, column, at), "recorded", start)?.points,
            rows: interpolated(aligned, stream, column, at, start),
        });
    }
    Ok(out)
}

fn interpolated(
    aligned: &Aligned,
    stream: &str,
    column: &str,
    at: usize,
    start: u64,
) -> Vec<(f64, f64)> {
    let Some(signal) = aligned.signal(stream, column) else {
        return Vec::new();
    };
    let rows = aligned.stamps.iter().enumerate();
    rows.filter_map(|(row, &t)| Some(((t as f64 - start as f64) * 1e-9, *signal.row(row).get(at)?)))
        .filter(|p| p.1.is_finite())
        .collect()
}

/// Every stream's samples as strokes, with the rows across.
fn raster(
    area: &Area<'_>,
    reference: &str,
    rows: &[f64],
    beats: &[Beat],
    middle: f64,
) -> Result<(), DrawError> {
    let step = match rows {
        [first, .., last] => (last - first) / (rows.len() - 1) as f64,
        _ => 0.1,
    };
    // The first row at or after the lively second; rows are inside.
    let at = rows
        .partition_point(|r| *r < middle)
        .min(rows.len().saturating_sub(1));
    let from = rows.get(at).copied().unwrap_or(0.0) - 0.3 * step;
    let to = from + ROWS * step;
    let title = format!("When every stream was sampled, from {from:.2} s");
    let across = format!("rows: stamps of the camera {reference}");
    let below = label::heading(
        area,
        &title,
        &[
            Key::new("samples", BLUE, Mark::Line),
            Key::new(&across, ORANGE, Mark::Line),
        ],
    )?;
    let axis = Axis::new(from, to, 8);
    let mut chart = ChartBuilder::on(&below)
        .margin(6)
        .margin_left(220)
        .margin_right(620)
        .x_label_area_size(44)
        .build_cartesian_2d(axis, 0.0..beats.len() as f64)?;
    strokes(&mut chart)
        .disable_y_mesh()
        .y_labels(0)
        .x_desc("seconds")
        .draw()?;
    let inside = |t: &&f64| (from..=to).contains(*t);
    for row in rows.iter().filter(inside) {
        let all = [(*row, 0.0), (*row, beats.len() as f64)];
        chart.draw_series([PathElement::new(all, ORANGE.stroke_width(3))])?;
    }
    let plot = chart.plotting_area();
    for (i, beat) in beats.iter().rev().enumerate() {
        let y = i as f64;
        for t in beat.times.iter().filter(inside) {
            let stroke = [(*t, y + 0.2), (*t, y + 0.8)];
            plot.draw(&PathElement::new(stroke, BLUE.stroke_width(2)))?;
        }
        let (left, middle) = plot.map_coordinate(&(from, y + 0.5));
        let (right, _) = plot.map_coordinate(&(to, y + 0.5));
        let (x0, y0) = below.get_base_pixel();
        label::right(&below, &beat.name, (left - x0 - 12, middle - y0), 19, INK)?;
        label::left(
            &below,
            &beat.words,
            (right - x0 + 14, middle - y0),
            18,
            GREY,
        )?;
    }
    Ok(())
}

/// The second in which the values change most.
fn liveliest(all: &[(f64, f64)]) -> f64 {
    let mut best = (0.0, all.first().map_or(0.0, |p| p.0));
    let mut end = 0;
    for (i, from) in all.iter().enumerate() {
        while end + 1 < all.len() && all[end].0 < from.0 + PIECE {
            end += 1;
        }
        let piece = &all[i..=end];
        let span = piece
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.1), h.max(p.1)));
        if span.1 - span.0 > best.0 {
            best = (span.1 - span.0, from.0);
        }
    }
    best.1
}

/// Greatest distance of recorded samples from the straight lines between rows:
/// the time and the distance.
fn missed(recorded: &[(f64, f64)], rows: &[(f64, f64)]) -> (f64, f64) {
    let off = |p: &(f64, f64)| {
        let next = rows.partition_point(|r| r.0 < p.0);
        let (a, b) = (rows.get(next.checked_sub(1)?)?, rows.get(next)?);
        let on_line = a.1 + (b.1 - a.1) * (p.0 - a.0) / (b.0 - a.0);
        Some((p.0, (p.1 - on_line).abs()))
    };
    let all = recorded.iter().filter_map(off);
    all.fold((0.0, 0.0), |w, p| if p.1 > w.1 { p } else { w })
}

fn points(area: &Area<'_>, curve: &Curve) -> Result<(), DrawError> {
    let from = liveliest(&curve.recorded);
    let inside = |p: &&(f64, f64)| p.0 >= from && p.0 <= from + PIECE;
    let shown: Vec<(f64, f64)> = curve.recorded.iter().filter(inside).copied().collect();
    let rows: Vec<(f64, f64)> = curve.rows.iter().filter(inside).copied().collect();
    let span = shown.iter().chain(&rows);
    let (low, high) = span.fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.1), h.max(p.1)));
    let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
    let room = ((high - low) * 0.1).max(1e-6);
    let (when, most) = missed(&curve.recorded, &curve.rows);
    let words = format!("straight between rows: up to {most:.1e} off the samples, at {when:.2} s");
    let below = label::heading(
        area,
        &curve.title,
        &[
            Key::new("recorded", BLUE, Mark::Dot),
            Key::new("row", ORANGE, Mark::Ring),
            Key::new(&words, ORANGE, Mark::Line),
        ],
    )?;
    let (x, y) = (
        Axis::new(from, from + PIECE, 6),
        Axis::new(low - room, high + room, 6),
    );
    let mut chart = ChartBuilder::on(&below)
        .margin(6)
        .margin_right(24)
        .x_label_area_size(50)
        .y_label_area_size(90)
        .build_cartesian_2d(x, y)?;
    strokes(&mut chart).x_desc("seconds").draw()?;
    let straight = LineSeries::new(rows.iter().copied(), ORANGE.stroke_width(2));
    chart.draw_series(straight)?;
    chart.draw_series(shown.iter().map(|&p| Circle::new(p, 4, BLUE.filled())))?;
    chart.draw_series(
        rows.iter()
            .map(|&p| Circle::new(p, 9, ORANGE.stroke_width(3))),
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interpolation_error_is_the_arc_above_the_chord() {
        let recorded: Vec<(f64, f64)> = (0..=60)
            .map(|i| f64::from(i) / 60.0)
            .map(|t| (t, t * t))
            .collect();
        let rows = [(0.0, 0.0), (0.5, 0.25), (1.0, 1.0)];
        let (when, most) = missed(&recorded, &rows);
        // Half way between two rows a parabola is h²/4 off its chord.
        assert!((most - 0.0625).abs() < 1e-9, "{most}");
        assert!((when - 0.25).abs() < 1e-9 || (when - 0.75).abs() < 1e-9);
        assert_eq!(missed(&recorded, &[]), (0.0, 0.0));
    }
}
