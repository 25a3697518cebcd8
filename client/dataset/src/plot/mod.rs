//! Plots of an episode: all moving parts, and how the rows of the
//! reference camera are located among the recorded samples.

mod synchronisation;

use std::path::Path;

use plotters::prelude::*;

use wheelarm_proto::v1;

use crate::pose::yaw;
use crate::read::{Episode, ReadError};
use crate::sheet::error::DrawError;
use crate::sheet::plots::{Line, Strip, Top, draw_top, line, over_time, phases, strips, top};
use crate::sheet::style::{self, Area, PAPER};

pub use synchronisation::synchronisation;

const PANEL: (u32, u32) = (880, 500);
/// A drawer that moves less is not drawn, m or rad.
const STILL: f64 = 1e-3;

fn drawn(problem: DrawError) -> anyhow::Error {
    anyhow::anyhow!("cannot draw the plot: {problem}")
}

/// Content of a panel.
enum Panel<'a> {
    /// Lines with one axis.
    Lines(&'a str, Vec<Line>),
    /// Strips with an axis each.
    Strips(&'a str, Vec<Strip<'a>>),
    /// The way seen from above.
    Way(Top),
}

/// Draws the movement of an episode: joints, the way from above, chair, end
/// effector, gripper, IMU, drawers that moved, over time with the phases behind.
///
/// # Errors
/// When the episode cannot be read or the image cannot be written.
pub fn movement(episode: &Episode, out: &Path) -> anyhow::Result<()> {
    anyhow::ensure!(style::register(), "cannot use the built-in fonts");
    let start = episode.summary()?.span_nanos.0;
    let bands = if episode.has("phase") {
        phases(episode, start)?
    } else {
        Vec::new()
    };
    let panels = panels(episode, start)?;
    let rows = panels.len().div_ceil(2);
    canvas(out, (2 * PANEL.0, rows as u32 * PANEL.1), |root| {
        for (area, panel) in root.split_evenly((rows, 2)).iter().zip(&panels) {
            match panel {
                Panel::Lines(title, lines) => over_time(area, title, lines, &bands)?,
                Panel::Strips(title, all) => strips(area, title, all, &bands)?,
                Panel::Way(top) => draw_top(area, top)?,
            }
        }
        Ok(())
    })
}

fn panels(episode: &Episode, start: u64) -> Result<Vec<Panel<'static>>, ReadError> {
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
    let one = |stream: &str, column: &str, at: usize, name: &str| {
        line(episode, (stream, column, at), name, start)
    };
    let (robot, roles) = episode.roles()?;
    let joint = |n: &str| {
        let place = roles.arm.iter().position(|&j| robot.joints[j].name == n)?;
        Some(format!("joint {}", place + 1))
    };
    let knuckle = |n: &str| {
        let joint = robot.joints.iter().find(|j| j.name == n)?;
        match joint.role() {
            v1::JointRole::Knuckle => Some("left knuckle".to_owned()),
            v1::JointRole::KnuckleRight => Some("right knuckle".to_owned()),
            _ => None,
        }
    };
    let hand = 7 * roles.end_effector;
    let (mut tip, mut acceleration, mut gyro) = (Vec::new(), Vec::new(), Vec::new());
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        tip.push((axis, vec![one("pose", "pose", hand + k, axis)?]));
        acceleration.push((axis, vec![one("imu", "linear_acceleration", k, axis)?]));
        gyro.push((axis, vec![one("imu", "angular_velocity", k, axis)?]));
    }
    let forces = vec![
        one("contact", "pad_force", 0, "left")?,
        one("contact", "pad_force", 1, "right")?,
    ];
    let mut out = vec![
        Panel::Lines("Arm joints, rad", named("joint_state", "position", &joint)?),
        Panel::Lines(
            "Arm joint velocities, rad/s",
            named("joint_state", "velocity", &joint)?,
        ),
        Panel::Way(top(episode)?),
        Panel::Strips(
            "Chair in house",
            vec![
                ("yaw, rad", vec![heading(episode, 7 * roles.chair, start)?]),
                (
                    "forward, m/s",
                    vec![one("odometry", "twist", 0, "forward")?],
                ),
                ("turn, rad/s", vec![one("odometry", "twist", 5, "turn")?]),
            ],
        ),
        Panel::Strips("End effector in base_link, m", tip),
        Panel::Strips(
            "Gripper",
            vec![
                ("knuckles, rad", named("joint_state", "position", &knuckle)?),
                ("finger tips, N", forces),
            ],
        ),
        Panel::Strips("IMU: acceleration, m/s²", acceleration),
        Panel::Strips("IMU: angular velocity, rad/s", gyro),
    ];
    if episode.has("furniture_joint") {
        let mut drawers = named("furniture_joint", "position", &|n| Some(n.to_owned()))?;
        drawers.retain(moves);
        if !drawers.is_empty() {
            out.push(Panel::Lines("Drawers that moved, m or rad", drawers));
        }
    }
    Ok(out)
}

fn moves(line: &Line) -> bool {
    let values = line.points.iter().map(|p| p.1);
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    high - low > STILL
}

/// The yaw of a frame over time, without jumps.
fn heading(episode: &Episode, frame: usize, start: u64) -> Result<Line, ReadError> {
    let turn: Result<Vec<Line>, _> = (3..7)
        .map(|k| line(episode, ("pose", "pose", frame + k), "q", start))
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
    let points = turn[0].points.iter().zip(angles);
    Ok(Line {
        name: "yaw".into(),
        points: points.map(|(p, a)| (p.0, a)).collect(),
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
