//! Plots of an episode: everything that moved, and how the interpolated points
//! lie among the recorded ones.

use std::path::Path;

use plotters::prelude::*;

use crate::align::{AlignOptions, Aligned, align};
use crate::read::{Episode, ReadError};
use crate::sheet::plots::{Line, Stretch, line, over_time, phases, yaw};
use crate::sheet::style::{self, BLUE, FAINT, GREY, INK, ORANGE, PAPER, text};
use crate::sheet::{Area, DrawError, label};

const PANEL: (u32, u32) = (880, 460);
/// Length of the piece that the synchronisation plots show, seconds.
const PIECE: f64 = 1.0;

fn drawn(problem: DrawError) -> anyhow::Error {
    anyhow::anyhow!("the plot cannot be drawn: {problem}")
}

/// Draws the movement of an episode: joints, end effector, chair, IMU, gripper,
/// forces, each over time with the phases behind it.
///
/// # Errors
/// When the episode cannot be read or the picture cannot be written.
pub fn movement(episode: &Episode, out: &Path) -> anyhow::Result<()> {
    anyhow::ensure!(style::register(), "the built-in fonts cannot be used");
    let start = episode.summary()?.span_nanos.0;
    let bands = if episode.has("phase") {
        phases(episode, start)?
    } else {
        Vec::new()
    };
    let mut panels: Vec<(&str, Vec<Line>)> = Vec::new();
    let named = |stream: &str, column: &str, wanted: &dyn Fn(&str) -> Option<String>| {
        let names = episode.names(stream, column)?;
        let mut lines = Vec::new();
        for (i, name) in names.iter().enumerate() {
            if let Some(shown) = wanted(name) {
                lines.push(line(episode, (stream, column, i), &shown, start)?);
            }
        }
        Ok::<_, ReadError>(lines)
    };
    let joint = |n: &str| n.strip_prefix("joint_").map(|n| format!("joint {n}"));
    panels.push(("Arm joints, rad", named("joint_state", "position", &joint)?));
    panels.push((
        "Arm joint velocities, rad/s",
        named("joint_state", "velocity", &joint)?,
    ));
    let frames = episode.names("pose", "pose")?;
    let frame = |name: &str| frames.iter().position(|f| f == name).unwrap_or(0);
    let xyz = |frame: usize| {
        (0..3)
            .map(|k| {
                line(
                    episode,
                    ("pose", "pose", 7 * frame + k),
                    ["x", "y", "z"][k],
                    start,
                )
            })
            .collect::<Result<Vec<_>, _>>()
    };
    panels.push(("End effector in base_link, m", xyz(frame("end_effector"))?));
    panels.push((
        "Chair in house, m and rad",
        chair(
            episode,
            frame("wheelchair"),
            xyz(frame("wheelchair"))?,
            start,
        )?,
    ));
    for (title, column) in [
        ("IMU: acceleration, m/s²", "linear_acceleration"),
        ("IMU: angular velocity, rad/s", "angular_velocity"),
    ] {
        let lines: Result<Vec<_>, _> = (0..3)
            .map(|k| line(episode, ("imu", column, k), ["x", "y", "z"][k], start))
            .collect();
        panels.push((title, lines?));
    }
    let knuckle = |n: &str| {
        n.ends_with("_knuckle_joint").then(|| {
            n.replace("robotiq_85_", "")
                .replace("_knuckle_joint", " knuckle")
        })
    };
    panels.push(("Gripper, rad", named("joint_state", "position", &knuckle)?));
    let pads: Result<Vec<_>, _> = (0..2)
        .map(|k| {
            line(
                episode,
                ("contact", "pad_force", k),
                ["left pad", "right pad"][k],
                start,
            )
        })
        .collect();
    panels.push(("Force at the finger tips, N", pads?));
    grid(out, &panels, &bands)
}

fn chair(
    episode: &Episode,
    frame: usize,
    xyz: Vec<Line>,
    start: u64,
) -> Result<Vec<Line>, ReadError> {
    let turn: Result<Vec<Line>, _> = (3..7)
        .map(|k| line(episode, ("pose", "pose", 7 * frame + k), "q", start))
        .collect();
    let turn = turn?;
    let mut angles: Vec<f64> = (0..turn[0].points.len())
        .map(|i| {
            yaw(std::array::from_fn(|k| {
                turn[k].points.get(i).map_or(f64::NAN, |p| p.1)
            }))
        })
        .collect();
    crate::align::interpolate::unwrap(&mut angles, 1);
    let points = turn[0]
        .points
        .iter()
        .zip(angles)
        .map(|(p, a)| (p.0, a))
        .collect();
    let mut lines: Vec<Line> = xyz.into_iter().take(2).collect();
    lines.push(Line {
        name: "yaw".into(),
        points,
    });
    Ok(lines)
}

fn grid(out: &Path, panels: &[(&str, Vec<Line>)], bands: &[Stretch]) -> anyhow::Result<()> {
    let rows = panels.len().div_ceil(2);
    let size = (2 * PANEL.0, rows as u32 * PANEL.1);
    canvas(out, size, |root| {
        for (area, (title, lines)) in root.split_evenly((rows, 2)).iter().zip(panels) {
            over_time(area, title, lines, bands)?;
        }
        Ok(())
    })
}

/// Draws with plotters into a PNG that has its name only when it is whole.
pub(crate) fn canvas(
    out: &Path,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), DrawError>,
) -> anyhow::Result<()> {
    let mut pixels = vec![0; 3 * (width * height) as usize];
    {
        let root = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
        root.fill(&PAPER).map_err(drawn)?;
        draw(&root).map_err(drawn)?;
        root.present().map_err(drawn)?;
    }
    let size = crate::convert::Size {
        width: width as usize,
        height: height as usize,
    };
    let _ = std::fs::remove_file(out);
    let pending = crate::convert::PendingFile::new(out)?;
    std::fs::write(pending.path(), crate::convert::png_rgb(&pixels, size)?)?;
    pending.commit()?;
    Ok(())
}

/// Draws recorded samples and interpolated rows of a second in which much
/// moved: the end effector's position, the chair's orientation, an arm joint,
/// as in the paper's three figures.
///
/// # Errors
/// When the episode cannot be read or aligned or the picture cannot be written.
pub fn synchronisation(
    episode: &Episode,
    options: &AlignOptions,
    out: &Path,
) -> anyhow::Result<()> {
    anyhow::ensure!(style::register(), "the built-in fonts cannot be used");
    let aligned = align(episode, options, &|s| {
        matches!(s, "pose" | "imu" | "joint_state")
    })?;
    let start = episode.summary()?.span_nanos.0;
    let frames = episode.names("pose", "pose")?;
    let frame = frames.iter().position(|f| f == "end_effector").unwrap_or(0);
    let joints = episode.names("joint_state", "position")?;
    let joint = joints.iter().position(|n| n == "joint_2").unwrap_or(0);
    let panels = [
        (
            "End effector in base_link, z, m",
            ("pose", "pose", 7 * frame + 2),
        ),
        ("Chair's IMU, quaternion z", ("imu", "orientation", 2)),
        ("joint_2, rad", ("joint_state", "position", joint)),
    ];
    let mut drawn_panels = Vec::new();
    for (title, (stream, column, at)) in panels {
        let recorded = line(episode, (stream, column, at), "recorded", start)?;
        drawn_panels.push((
            title,
            recorded.points,
            interpolated(&aligned, stream, column, at, start),
        ));
    }
    canvas(out, (PANEL.0, 3 * PANEL.1), |root| {
        for (area, (title, recorded, rows)) in root.split_evenly((3, 1)).iter().zip(&drawn_panels) {
            points(area, title, recorded, rows)?;
        }
        Ok(())
    })
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
    aligned
        .stamps
        .iter()
        .enumerate()
        .filter_map(|(row, &t)| Some(((t as f64 - start as f64) * 1e-9, *signal.row(row).get(at)?)))
        .filter(|p| p.1.is_finite())
        .collect()
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

fn points(
    area: &Area<'_>,
    title: &str,
    recorded: &[(f64, f64)],
    rows: &[(f64, f64)],
) -> Result<(), DrawError> {
    let from = liveliest(recorded);
    let inside = |p: &&(f64, f64)| p.0 >= from && p.0 <= from + PIECE;
    let shown: Vec<(f64, f64)> = recorded.iter().filter(inside).copied().collect();
    let (low, high) = shown
        .iter()
        .fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.1), h.max(p.1)));
    let room = ((high - low) * 0.15).max(1e-6);
    let mut chart = ChartBuilder::on(area)
        .caption(title, text(26, INK))
        .margin(12)
        .margin_right(24)
        .x_label_area_size(50)
        .y_label_area_size(90)
        .build_cartesian_2d(from..from + PIECE, low - room..high + 1.6 * room)?;
    chart
        .configure_mesh()
        .bold_line_style(FAINT)
        .light_line_style(TRANSPARENT)
        .axis_style(GREY)
        .label_style(text(19, GREY))
        .x_label_formatter(&|v| format!("{v:.1}"))
        .y_label_formatter(&|v| format!("{v:.4}"))
        .x_desc("seconds")
        .axis_desc_style(text(20, GREY))
        .draw()?;
    chart.draw_series(shown.iter().map(|&p| Circle::new(p, 4, BLUE.filled())))?;
    let rows = rows.iter().filter(inside);
    chart.draw_series(rows.map(|&p| Circle::new(p, 9, ORANGE.stroke_width(3))))?;
    let flat = chart.plotting_area().strip_coord_spec();
    label::legend(
        &flat,
        (12, 20),
        &[
            ("recorded", BLUE),
            ("interpolated at the camera's stamps", ORANGE),
        ],
    )
}
