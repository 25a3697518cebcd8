//! The four plots: top view, joints, gripper with phases, speed of the chair.

use plotters::prelude::*;
use wheelarm_proto::v1;

use super::axis::Axis;
use super::error::{DrawError, SheetError};
use super::label::{Key, Mark};
use super::mount::{Plane, arm_mount};
use super::style::{AMBER, Area, BLUE, COLUMNS, GREY, INK, LINES, ORANGE, phase_colour, strokes};
use super::{crowd, label};
use crate::pose::yaw;
use crate::read::{Episode, ReadError};

/// A line over time: its name and (seconds, value).
pub struct Line {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

/// Draws all plots side by side.
pub fn draw(episode: &Episode, area: &Area<'_>, start: u64) -> Result<(), SheetError> {
    let (left, rest) = area.split_horizontally(560);
    let rest = rest.split_evenly((1, 3));
    draw_top(&left, &top(episode)?)?;
    joints(episode, &rest[0], start)?;
    gripper(episode, &rest[1], start)?;
    speed(episode, &rest[2], start)?;
    Ok(())
}

fn seconds(episode: &Episode, stream: &str, start: u64) -> Result<Vec<f64>, ReadError> {
    let stamps = episode.u64s(stream, "stamp_nanos")?;
    Ok(stamps
        .iter()
        .map(|&s| (s as f64 - start as f64) * 1e-9)
        .collect())
}

/// One number per sample out of a column: element `at` of each sample.
fn series(episode: &Episode, stream: &str, column: &str, at: usize) -> Result<Vec<f64>, ReadError> {
    let all = episode.f64s(stream, column)?;
    let samples = all.shape().first().copied().unwrap_or(0).max(1);
    let width = (all.len() / samples).max(1);
    Ok(all.iter().skip(at).step_by(width).copied().collect())
}

pub fn line(
    episode: &Episode,
    (stream, column, at): (&str, &str, usize),
    name: &str,
    start: u64,
) -> Result<Line, ReadError> {
    let times = seconds(episode, stream, start)?;
    let values = series(episode, stream, column, at)?;
    let points = times.into_iter().zip(values);
    Ok(Line {
        name: name.to_owned(),
        points: points.filter(|p| p.1.is_finite()).collect(),
    })
}

fn joints(episode: &Episode, area: &Area<'_>, start: u64) -> Result<(), SheetError> {
    let (_, roles) = episode.roles()?;
    let mut lines = Vec::new();
    for (place, &joint) in roles.arm.iter().enumerate() {
        let column = ("joint_state", "position", joint);
        lines.push(line(episode, column, &(place + 1).to_string(), start)?);
    }
    over_time(area, "Arm joints 1 to 6, rad", &lines, &[]).map_err(Into::into)
}

fn gripper(episode: &Episode, area: &Area<'_>, start: u64) -> Result<(), SheetError> {
    let (_, roles) = episode.roles()?;
    let column = ("joint_state", "position", roles.knuckle);
    let mut lines = vec![line(episode, column, "knuckle, rad", start)?];
    for (i, side) in ["left", "right"].iter().enumerate() {
        let name = format!("{side} pad, 100 N");
        let mut force = line(episode, ("contact", "pad_force", i), &name, start)?;
        force.points.iter_mut().for_each(|p| p.1 *= 0.01);
        lines.push(force);
    }
    let phases = phases(episode, start)?;
    over_time(area, "Gripper and phase", &lines, &phases).map_err(Into::into)
}

fn speed(episode: &Episode, area: &Area<'_>, start: u64) -> Result<(), SheetError> {
    let lines = [
        line(episode, ("odometry", "twist", 0), "forward, m/s", start)?,
        line(episode, ("odometry", "twist", 5), "turn, rad/s", start)?,
    ];
    over_time(area, "Speed of the chair", &lines, &[]).map_err(Into::into)
}

/// Stretches of one phase: label, name, begin and end in seconds.
pub type Stretch = (u64, String, f64, f64);

pub fn phases(episode: &Episode, start: u64) -> Result<Vec<Stretch>, ReadError> {
    let times = seconds(episode, "phase", start)?;
    let labels = episode.u64s("phase", "label")?;
    let names = episode.texts("phase", "phase")?;
    let mut out: Vec<Stretch> = Vec::new();
    for ((t, label), name) in times.into_iter().zip(labels).zip(names) {
        match out.last_mut() {
            Some(last) if last.0 == label => last.3 = t,
            Some(last) => {
                last.3 = t;
                out.push((label, name, t, t));
            }
            None => out.push((label, name, t, t)),
        }
    }
    Ok(out)
}

/// The phase at each of some times, for the heads of the columns.
pub fn phases_at(episode: &Episode, start: u64, times: &[f64]) -> Vec<String> {
    let stretches = phases(episode, start).unwrap_or_default();
    let at = |t: f64| {
        let hit = stretches.iter().rev().find(|s| s.2 <= t + 1e-9);
        hit.map_or_else(String::new, |s| s.1.clone())
    };
    times.iter().take(COLUMNS).map(|&t| at(t)).collect()
}

fn range(values: impl Iterator<Item = f64>, pad: f64) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    if low > high {
        return (0.0, 1.0);
    }
    // Constant values are shown as a line in the middle, not as noise.
    let room = ((high - low) * pad).max(1e-3);
    (low - room, high + room)
}

/// Colours of lines, again from the first after the last.
fn colours() -> impl Iterator<Item = RGBColor> {
    LINES.iter().cycle().copied()
}

/// A legend of lines and of the phases behind them.
fn keys<'a>(lines: &'a [Line], phases: &'a [Stretch]) -> Vec<Key<'a>> {
    let lines = lines.iter().zip(colours());
    let mut out: Vec<Key<'_>> = lines
        .map(|(l, c)| Key::new(&l.name, c, Mark::Line))
        .collect();
    let mut labels_shown = Vec::new();
    for (label, name, ..) in phases {
        if *label > 0 && !labels_shown.contains(label) {
            labels_shown.push(*label);
            out.push(Key::new(name, phase_colour(*label), Mark::Block));
        }
    }
    out
}

/// Lines over time in one plot, with the phases behind them.
pub fn over_time(
    area: &Area<'_>,
    title: &str,
    lines: &[Line],
    phases: &[Stretch],
) -> Result<(), DrawError> {
    let below = label::heading(area, title, &keys(lines, phases))?;
    curves(
        &below,
        lines,
        phases,
        end(lines, phases),
        Some("seconds"),
        "",
    )
}

/// One strip of a plot: the label of its axis, and its lines.
pub type Strip<'a> = (&'a str, Vec<Line>);

/// Quantities of different sizes over one time, each with an axis of its own.
pub fn strips(
    area: &Area<'_>,
    title: &str,
    strips: &[Strip<'_>],
    phases: &[Stretch],
) -> Result<(), DrawError> {
    // A single line is named by its axis.
    let named = strips.iter().map(|s| s.1.as_slice()).find(|l| l.len() > 1);
    let below = label::heading(area, title, &keys(named.unwrap_or(&[]), phases))?;
    let last = strips.iter().map(|s| end(&s.1, phases)).fold(0.1, f64::max);
    let (_, height) = below.dim_in_pixel();
    let each = (height.saturating_sub(TIME_AXIS) / strips.len().max(1) as u32) as i32;
    let mut rest = below;
    for (i, (what, lines)) in strips.iter().enumerate() {
        if i + 1 == strips.len() {
            curves(&rest, lines, phases, last, Some("seconds"), what)?;
        } else {
            let (strip, below) = rest.split_vertically(each);
            curves(&strip, lines, phases, last, None, what)?;
            rest = below;
        }
    }
    Ok(())
}

/// A line of more points is drawn thin.
const DENSE: usize = 2000;
/// Height of the text below a time axis, pixels.
const TIME_AXIS: u32 = 50;

fn end(lines: &[Line], phases: &[Stretch]) -> f64 {
    let times = lines.iter().flat_map(|l| l.points.iter().map(|p| p.0));
    times.chain(phases.iter().map(|p| p.3)).fold(0.1, f64::max)
}

/// Lines over time without a title; words below the time axis where there are
/// some.
fn curves(
    area: &Area<'_>,
    lines: &[Line],
    phases: &[Stretch],
    end: f64,
    below: Option<&str>,
    what: &str,
) -> Result<(), DrawError> {
    let values = lines.iter().flat_map(|l| l.points.iter().map(|p| p.1));
    let (low, high) = range(values, 0.08);
    let (_, height) = area.dim_in_pixel();
    let (x, y) = (
        Axis::new(0.0, end, 6),
        Axis::new(low, high, (height as usize / 60).clamp(2, 7)),
    );
    let mut chart = ChartBuilder::on(area)
        .margin(6)
        .margin_right(22)
        .x_label_area_size(if below.is_some() { TIME_AXIS } else { 0 })
        .y_label_area_size(if what.is_empty() { 66 } else { 92 })
        .build_cartesian_2d(x, y)?;
    for (label, _, from, to) in phases {
        let band = Rectangle::new([(*from, low), (*to, high)], phase_colour(*label).filled());
        chart.draw_series(std::iter::once(band))?;
    }
    strokes(&mut chart)
        .x_desc(below.unwrap_or_default())
        .y_desc(what)
        .draw()?;
    for (l, colour) in lines.iter().zip(colours()) {
        if l.points.len() > DENSE {
            chart.draw_series(LineSeries::new(l.points.iter().copied(), colour))?;
            continue;
        }
        // Piece by piece: the corner of a wide line would extend far beyond a peak,
        // and beyond the plot.
        let pieces = l.points.windows(2);
        let wide = colour.stroke_width(3);
        chart.draw_series(pieces.map(|ends| PathElement::new(ends.to_vec(), wide)))?;
    }
    Ok(())
}

/// The way of chair and hand seen from above, with the objects at the start,
/// metres in `house`.
pub struct Top {
    chairs: Vec<Plane>,
    tips: Vec<(f64, f64)>,
    objects: Vec<(String, (f64, f64))>,
    outline: [(f64, f64); 6],
}

/// Reads it.
pub fn top(episode: &Episode) -> Result<Top, ReadError> {
    let pose = |frame: usize| -> Result<Vec<Vec<f64>>, ReadError> {
        (0..7)
            .map(|k| series(episode, "pose", "pose", 7 * frame + k))
            .collect()
    };
    let (robot, roles) = episode.roles()?;
    let (chair, tip) = (pose(roles.chair)?, pose(roles.end_effector)?);
    let mount = arm_mount(&robot);
    let chairs: Vec<Plane> = (0..chair[0].len())
        .map(|i| Plane {
            x: chair[0][i],
            y: chair[1][i],
            yaw: yaw([chair[3][i], chair[4][i], chair[5][i], chair[6][i]]),
        })
        .filter(|p| p.x.is_finite() && p.y.is_finite() && p.yaw.is_finite())
        .collect();
    let mut tips = Vec::new();
    if let Some(mount) = mount
        && chairs.len() == tip[0].len()
    {
        for (i, chair) in chairs.iter().enumerate() {
            let (x, y) = mount.point(tip[0][i], tip[1][i]);
            tips.push(chair.point(x, y));
        }
    }
    let objects = episode.names("object_pose", "pose")?;
    let mut places = Vec::new();
    for (k, name) in objects.iter().enumerate() {
        let x = series(episode, "object_pose", "pose", 7 * k)?;
        let y = series(episode, "object_pose", "pose", 7 * k + 1)?;
        if let (Some(&x), Some(&y)) = (x.first(), y.first()) {
            places.push((name.clone(), (x, y)));
        }
    }
    Ok(Top {
        chairs,
        tips,
        objects: places,
        outline: outline(&robot.footprint.unwrap_or_default()),
    })
}

/// Outline of the chair from above in its own frame, metres: its footprint with a
/// point in front.
fn outline(footprint: &v1::Footprint) -> [(f64, f64); 6] {
    let &v1::Footprint {
        x_min,
        x_max,
        y_min,
        y_max,
    } = footprint;
    let shoulder = x_max - 0.25 * (y_max - y_min);
    [
        (x_min, y_min),
        (shoulder, y_min),
        (x_max, f64::midpoint(y_min, y_max)),
        (shoulder, y_max),
        (x_min, y_max),
        (x_min, y_min),
    ]
}

/// Draws it, one metre as long to the right as upwards.
pub fn draw_top(area: &Area<'_>, top: &Top) -> Result<(), DrawError> {
    let Top {
        chairs,
        tips,
        objects,
        outline,
    } = top;
    let around = |p: &Plane| outline.map(|(x, y)| p.point(x, y));
    let ends: Vec<(f64, f64)> = [chairs.first(), chairs.last()]
        .into_iter()
        .flatten()
        .flat_map(around)
        .collect();
    let finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let all: Vec<(f64, f64)> = chairs
        .iter()
        .map(|c| (c.x, c.y))
        .chain(ends)
        .chain(tips.iter().filter(finite).copied())
        .chain(objects.iter().map(|o| &o.1).filter(finite).copied())
        .collect();
    let (x0, x1) = range(all.iter().map(|p| p.0), 0.08);
    let (y0, y1) = range(all.iter().map(|p| p.1), 0.08);
    let below = label::heading(
        area,
        "Seen from above",
        &[
            Key::new("chair", BLUE, Mark::Line),
            Key::new("end effector", ORANGE, Mark::Line),
            Key::new("object at the start", AMBER, Mark::Dot),
        ],
    )?;
    let (w, h) = below.dim_in_pixel();
    let (w, h) = (f64::from(w) - 98.0, f64::from(h) - 62.0);
    let scale = ((x1 - x0) / w).max((y1 - y0) / h);
    let (cx, cy) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
    let (rx, ry) = (0.5 * scale * w, 0.5 * scale * h);
    let (x, y) = (
        Axis::new(cx - rx, cx + rx, 6),
        Axis::new(cy - ry, cy + ry, 6),
    );
    let mut chart = ChartBuilder::on(&below)
        .margin(6)
        .margin_right(22)
        .x_label_area_size(50)
        .y_label_area_size(70)
        .build_cartesian_2d(x, y)?;
    strokes(&mut chart)
        .x_desc("house x, m")
        .y_desc("house y, m")
        .draw()?;
    for (place, colour) in [(chairs.first(), GREY), (chairs.last(), BLUE)] {
        if let Some(place) = place {
            let outline = PathElement::new(around(place), colour.stroke_width(2));
            chart.draw_series(std::iter::once(outline))?;
        }
    }
    let path = chairs.iter().map(|c| (c.x, c.y));
    chart.draw_series(LineSeries::new(path, BLUE.stroke_width(4)))?;
    let path = tips.iter().filter(finite).copied();
    chart.draw_series(LineSeries::new(path, ORANGE.stroke_width(3)))?;
    let plot = chart.plotting_area();
    let (left, top) = plot.get_base_pixel();
    let objects: Vec<_> = objects.iter().filter(|o| finite(&&o.1)).collect();
    let dots: Vec<(i32, i32)> = objects
        .iter()
        .map(|o| plot.map_coordinate(&o.1))
        .map(|(x, y)| (x - left, y - top))
        .collect();
    let (width, height) = plot.dim_in_pixel();
    names(
        &plot.strip_coord_spec(),
        &objects.iter().map(|o| o.0.as_str()).collect::<Vec<_>>(),
        &dots,
        (width as i32, height as i32),
    )
}

/// Size of an object's name.
const NAME: u32 = 18;

/// Dots with names that do not overlap.
fn names(
    area: &Area<'_>,
    names: &[&str],
    dots: &[(i32, i32)],
    room: (i32, i32),
) -> Result<(), DrawError> {
    let sizes = names.iter().map(|n| (label::width(n, NAME), NAME as i32));
    let places = crowd::places(dots, &sizes.collect::<Vec<_>>(), room);
    for ((name, &(x, y)), place) in names.iter().zip(dots).zip(places) {
        area.draw(&Circle::new((x, y), 6, AMBER.filled()))?;
        let Some((left, top, wide, high)) = place else {
            continue;
        };
        // The nearest point of the name: a name at a distance gets a line.
        let near = (x.clamp(left, left + wide), y.clamp(top, top + high));
        if (near.0 - x).abs().max((near.1 - y).abs()) > 20 {
            area.draw(&PathElement::new([(x, y), near], GREY.stroke_width(1)))?;
        }
        label::left(area, name, (left, top + high / 2), NAME, INK)?;
    }
    Ok(())
}
