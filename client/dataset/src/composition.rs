//! Content of a collection, per task: the paper's composition table, as text, as
//! CSV and as a plot.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use wheelarm_proto::StreamId;

use plotters::prelude::*;

use crate::label;
use crate::plot::canvas;
use crate::read::Episode;
use crate::sheet::axis::Axis;
use crate::sheet::label::{self as words, Key, Mark};
use crate::sheet::style::{self, BLUE, GREY, INK, ORANGE, strokes};

/// One episode's figures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures {
    /// Activity, area and task.
    pub key: [String; 3],
    /// Images of the reference camera: the paper's samples.
    pub samples: usize,
    /// Simulated seconds.
    pub seconds: f64,
    /// The task succeeded.
    pub success: bool,
    /// Everything was recorded.
    pub complete: bool,
    /// The simulation broke in it.
    pub broken: bool,
    /// Seconds of each label.
    pub phases: [f64; 4],
    /// Bytes of the file.
    pub bytes: u64,
}

/// Figures of all episodes of one task.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Episodes.
    pub trajectories: usize,
    /// Those that succeeded.
    pub successes: usize,
    /// Those that are complete.
    pub complete: usize,
    /// Those in which the simulation became unstable; none of them succeeded.
    pub broken: usize,
    /// Samples.
    pub samples: usize,
    /// Simulated seconds: sum, least and greatest.
    pub seconds: [f64; 3],
    /// Seconds of each label.
    pub phases: [f64; 4],
    /// Bytes.
    pub bytes: u64,
}

/// Reads one episode's figures.
///
/// # Errors
/// When the file cannot be read.
pub fn figures(path: &Path) -> anyhow::Result<Figures> {
    let episode = Episode::open(path)?;
    let summary = episode.summary()?;
    let [task, activity, area] = summary.task.clone();
    let samples = match episode.reference()? {
        Some(camera) => episode.stamps(&StreamId::camera(camera).to_string())?.len(),
        None => 0,
    };
    let (first, last) = summary.span_nanos;
    let segments = label::segments(&episode)?;
    let mut phases = [0.0; 4];
    for (i, s) in segments.iter().enumerate() {
        let to = segments.get(i + 1).map_or(last, |n| n.from);
        phases[usize::from(s.label).min(3)] += to.saturating_sub(s.from) as f64 * 1e-9;
    }
    Ok(Figures {
        key: [activity, area, task],
        samples,
        seconds: (last - first) as f64 * 1e-9,
        success: summary.success && !episode.is_broken(),
        complete: summary.complete,
        broken: episode.is_broken(),
        phases,
        bytes: std::fs::metadata(path)?.len(),
    })
}

/// Gathers episodes by activity, area and task.
#[must_use]
pub fn gather(all: &[Figures]) -> BTreeMap<[String; 3], Row> {
    let mut out: BTreeMap<[String; 3], Row> = BTreeMap::new();
    for f in all {
        let row = out.entry(f.key.clone()).or_default();
        let first = row.trajectories == 0;
        row.trajectories += 1;
        row.successes += usize::from(f.success);
        row.complete += usize::from(f.complete);
        row.broken += usize::from(f.broken);
        row.samples += f.samples;
        row.seconds = [
            row.seconds[0] + f.seconds,
            if first {
                f.seconds
            } else {
                row.seconds[1].min(f.seconds)
            },
            row.seconds[2].max(f.seconds),
        ];
        row.phases
            .iter_mut()
            .zip(f.phases)
            .for_each(|(a, b)| *a += b);
        row.bytes += f.bytes;
    }
    out
}

/// The table for people.
#[must_use]
pub fn table(rows: &BTreeMap<[String; 3], Row>) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{:<12} {:<16} {:<26} {:>12} {:>8} {:>9} {:>9} {:>17} {:>24} {:>9}",
        "activity",
        "area",
        "task",
        "trajectories",
        "success",
        "samples",
        "minutes",
        "seconds min..max",
        "nav/reach/grasp/retract",
        "MB"
    );
    let mut whole = Row::default();
    for ([activity, area, task], r) in rows {
        line(&mut out, [activity, area, task], r);
        let least = if whole.trajectories == 0 {
            r.seconds[1]
        } else {
            whole.seconds[1].min(r.seconds[1])
        };
        whole = Row {
            trajectories: whole.trajectories + r.trajectories,
            successes: whole.successes + r.successes,
            complete: whole.complete + r.complete,
            broken: whole.broken + r.broken,
            samples: whole.samples + r.samples,
            seconds: [
                whole.seconds[0] + r.seconds[0],
                least,
                whole.seconds[2].max(r.seconds[2]),
            ],
            phases: std::array::from_fn(|k| whole.phases[k] + r.phases[k]),
            bytes: whole.bytes + r.bytes,
        };
    }
    line(&mut out, ["all", "", ""], &whole);
    if whole.broken > 0 {
        let _ = writeln!(out, "in {} episodes the physics broke", whole.broken);
    }
    if whole.complete < whole.trajectories {
        let _ = writeln!(
            out,
            "{} episodes are partial",
            whole.trajectories - whole.complete
        );
    }
    out
}

fn line(out: &mut String, [activity, area, task]: [&str; 3], r: &Row) {
    let whole = r.phases.iter().sum::<f64>().max(1e-9);
    let share = r
        .phases
        .map(|p| format!("{:.0}", 100.0 * p / whole))
        .join("/");
    let success = format!(
        "{:.0} %",
        100.0 * r.successes as f64 / r.trajectories.max(1) as f64
    );
    let span = format!("{:.1}..{:.1}", r.seconds[1], r.seconds[2]);
    let _ = writeln!(
        out,
        "{activity:<12} {area:<16} {task:<26} {:>12} {success:>8} {:>9} {:>9.1} {span:>17} {:>24} {:>9.1}",
        r.trajectories,
        r.samples,
        r.seconds[0] / 60.0,
        format!("{share} %"),
        r.bytes as f64 / 1e6,
    );
}

/// Writes the table as CSV.
///
/// # Errors
/// Those of the writer.
pub fn csv(rows: &BTreeMap<[String; 3], Row>, to: impl std::io::Write) -> anyhow::Result<()> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record([
        "activity",
        "area",
        "task",
        "trajectories",
        "successes",
        "complete",
        "samples",
        "seconds",
        "navigating_seconds",
        "reaching_seconds",
        "grasping_seconds",
        "retracting_seconds",
        "bytes",
    ])?;
    for (key, r) in rows {
        let numbers = [r.trajectories, r.successes, r.complete, r.samples].map(|n| n.to_string());
        let seconds = std::iter::once(r.seconds[0])
            .chain(r.phases)
            .map(|s| format!("{s:.3}"));
        let cells = key.iter().cloned().chain(numbers).chain(seconds);
        table.write_record(cells.chain([r.bytes.to_string()]))?;
    }
    table.flush()?;
    Ok(())
}

/// Draws trajectories (successes filled) per task as bars.
///
/// # Errors
/// When the image cannot be written.
pub fn plot(rows: &BTreeMap<[String; 3], Row>, out: &Path) -> anyhow::Result<()> {
    anyhow::ensure!(style::register(), "cannot use the built-in fonts");
    let n = rows.len().max(1);
    let most = rows.values().map(|r| r.trajectories).max().unwrap_or(1) as f64;
    let height = 170 + 46 * n as u32;
    canvas(out, (1280, height), |root| {
        let keys = [
            Key::new("succeeded", BLUE, Mark::Line),
            Key::new("all", ORANGE, Mark::Line),
        ];
        let below = words::heading(root, "Episodes per task", &keys)?;
        let axis = Axis::counts(most, 8);
        let mut chart = ChartBuilder::on(&below)
            .margin(10)
            .margin_right(250)
            .x_label_area_size(44)
            .y_label_area_size(330)
            .build_cartesian_2d(axis, 0.0..n as f64)?;
        strokes(&mut chart).disable_y_mesh().y_labels(0).draw()?;
        for (i, ([activity, _, task], r)) in rows.iter().rev().enumerate() {
            let (low, high) = (i as f64 + 0.2, i as f64 + 0.8);
            let bar = |to: f64, filled: bool| {
                let style: ShapeStyle = if filled {
                    BLUE.filled()
                } else {
                    ORANGE.stroke_width(2)
                };
                Rectangle::new([(0.0, low), (to, high)], style)
            };
            chart.draw_series([
                bar(r.successes as f64, true),
                bar(r.trajectories as f64, false),
            ])?;
            let plot = chart.plotting_area();
            let (x0, y0) = below.get_base_pixel();
            let (x, y) = plot.map_coordinate(&(0.0, i as f64 + 0.5));
            let name = format!("{task} ({activity})");
            words::left(&below, &name, (x - x0 - 320, y - y0), 20, INK)?;
            let (x, y) = plot.map_coordinate(&(r.trajectories as f64, i as f64 + 0.5));
            words::left(&below, &caption(r), (x - x0 + 10, y - y0), 18, GREY)?;
        }
        Ok(())
    })
}

/// The text beside a bar.
fn caption(r: &Row) -> String {
    let plural = |n: usize, word: &str| format!("{n} {word}{}", if n == 1 { "" } else { "s" });
    format!(
        "{} of {}",
        plural(r.samples, "image"),
        plural(r.trajectories, "episode")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_of_a_bar_has_separate_numbers() {
        let row = Row {
            trajectories: 3,
            samples: 601,
            ..Row::default()
        };
        assert_eq!(caption(&row), "601 images of 3 episodes");
    }
}
