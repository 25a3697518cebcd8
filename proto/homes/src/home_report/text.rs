//! The report as text for a terminal.

use std::fmt::{self, Write};

use super::rooms::DIN_TURNING;
use super::{DoorReport, HomeReport, MoveReport, Reason, RoomReport, SurfaceReport};

/// The report as text.
///
/// # Errors
/// None: writing to a string succeeds.
pub fn text(report: &HomeReport) -> Result<String, fmt::Error> {
    let mut out = String::new();
    let (robot, sum) = (&report.robot, &report.summary);
    writeln!(
        out,
        "{}: the chair gets into {} of {} rooms and through {} of {} doors; the arm reaches {} of {} surfaces, and {} more from a start in their room",
        report.home,
        sum.rooms_entered,
        sum.rooms,
        sum.doors_passed,
        sum.doors,
        sum.surfaces_reached,
        sum.surfaces,
        sum.surfaces_within
    )?;
    writeln!(
        out,
        "robot {} with the arm in posture {}: {:.2} m x {:.2} m, turns on the spot within {:.2} m",
        robot.name, robot.posture, robot.size[0], robot.size[1], robot.turning_circle
    )?;
    if let Some(advice) = advice(report) {
        writeln!(out, "{advice}")?;
    }
    writeln!(out, "\nrooms")?;
    for room in &report.rooms {
        writeln!(out, "  {:24} {}", room.name, room_words(room))?;
    }
    writeln!(
        out,
        "\ndoors (DIN 18040-2: 0.80 m, for wheelchairs 0.90 m; this robot: {:.2} m)",
        robot.door
    )?;
    for door in &report.doors {
        let between = door.between.join(" - ");
        writeln!(out, "  {between:36} {}", door_words(door))?;
    }
    writeln!(out, "\nsurfaces, with their numbers in the plan")?;
    for (index, surface) in report.surfaces.iter().enumerate() {
        let name = surface_name(surface);
        writeln!(
            out,
            "  {:3} {name:40} {}",
            index + 1,
            surface_words(surface)
        )?;
    }
    for (slides, what, opened, all) in [
        (false, "doors, opened by 45°", sum.leaves_opened, sum.leaves),
        (
            true,
            "drawers, opened by 0.20 m",
            sum.drawers_opened,
            sum.drawers,
        ),
    ] {
        if all > 0 {
            writeln!(out, "\nfurniture {what}: {opened} of {all}")?;
        }
        for leaf in report.leaves.iter().filter(|leaf| leaf.slides == slides) {
            writeln!(out, "  {:36} {}", leaf.piece, leaf.words())?;
        }
    }
    if !report.to_move.is_empty() {
        writeln!(out, "\nto move")?;
    }
    for piece in &report.to_move {
        writeln!(out, "  {:24} {}", piece.piece, move_words(piece))?;
    }
    Ok(out)
}

/// The first problem of a home, with its fix.
#[must_use]
pub fn advice(report: &HomeReport) -> Option<String> {
    let (name, sum) = (&report.home, &report.summary);
    if report.start.is_none() {
        return Some(format!(
            "{name}: the chair fits nowhere in the home; see the plan, and draw rooms with free floor"
        ));
    }
    let is_entered = |name: &str| {
        let mut rooms = report.rooms.iter();
        rooms.any(|room| room.name == name && room.entered)
    };
    let leads_on = |door: &&DoorReport| {
        let mut unentered = report.rooms.iter().filter(|r| !r.entered && !r.outdoors);
        unentered.any(|room| door.between.contains(&room.name))
            && door.between.iter().any(|name| is_entered(name))
    };
    let blocked = report.doors.iter().filter(|door| !door.passed);
    let blocked = blocked.filter(leads_on);
    let narrowest = blocked.min_by(|a, b| a.clear_width.total_cmp(&b.clear_width));
    match narrowest {
        Some(door) if sum.rooms_entered < sum.rooms => Some(format!(
            "the chair ({:.2} m) gets into {} of {} rooms: {} between {} and {} is {:.2} m clear; see the plan",
            report.robot.size[0],
            sum.rooms_entered,
            sum.rooms,
            door.kind,
            door.between[0],
            door.between[1],
            door.clear_width
        )),
        _ => None,
    }
}

/// What the chair does in a room.
#[must_use]
pub fn room_words(room: &RoomReport) -> String {
    let mut words = format!("{:5.1} m², ", room.area);
    words += match (room.outdoors, room.entered) {
        (true, _) => "outside, not counted",
        (false, true) => "entered",
        (false, false) => "not entered",
    };
    if room.entered && !room.outdoors {
        let turn = match room.turns {
            true => "turns on the spot",
            false => "does not turn on the spot",
        };
        let squares = match room.turning_squares.is_empty() {
            true => "no place",
            false => "place",
        };
        words += &format!(
            ", drives on {:.0} %, {turn}, {squares} of {DIN_TURNING} m x {DIN_TURNING} m",
            room.driven * 100.0
        );
    }
    words
}

/// Clear width of a door, whether the chair passes, and its class of DIN 18040-2.
#[must_use]
pub fn door_words(door: &DoorReport) -> String {
    if door.closed {
        return "closed: it leads outside".to_owned();
    }
    let passed = match door.passed {
        true => "passed",
        false => "not passed",
    };
    let din = match (door.din_barrier_free, door.din_wheelchair) {
        (_, true) => "DIN wheelchair",
        (true, false) => "DIN barrier-free",
        (false, false) => "below DIN",
    };
    let mut words = format!("{:.2} m  {passed}, {din}", door.clear_width);
    if !door.blocked_by.is_empty() {
        words += &format!("; before it: {}", door.blocked_by.join(", "));
    }
    words
}

/// Name of a surface, with its room.
#[must_use]
pub fn surface_name(surface: &SurfaceReport) -> String {
    let room = surface.room.as_deref().unwrap_or("no room");
    format!("{room}: {}/{}", surface.piece, surface.surface)
}

/// Size of a surface, and how much of it is reached or why not.
#[must_use]
pub fn surface_words(surface: &SurfaceReport) -> String {
    let [a, b] = surface.size;
    let size = format!("{:.2} m high, {a:.2} m x {b:.2} m: ", surface.height);
    let Some(strip) = &surface.strip else {
        let mut words = format!("{size}not reached, {}", reason_words(surface.reason));
        if !surface.blocked_by.is_empty() {
            words += &format!(" ({})", surface.blocked_by.join(", "));
        }
        return words;
    };
    format!(
        "{size}reached over {:.2} m, {:.0} % of its edge",
        strip.width,
        surface.share * 100.0
    )
}

fn reason_words(reason: Option<Reason>) -> &'static str {
    match reason {
        None => "",
        Some(Reason::TooSmall) => "it is too small",
        Some(Reason::OutOfReach) => "its height is out of the arm's reach",
        Some(Reason::NoFloor) => "no free floor before it",
        Some(Reason::Covered) => "something stands between the arm and it",
        Some(Reason::NotConnected) => "the chair does not get to the floor before it",
    }
}

/// What the removal of a piece gains.
#[must_use]
pub fn move_words(piece: &MoveReport) -> String {
    let mut gains = Vec::new();
    if !piece.rooms.is_empty() {
        gains.push(format!("opens {}", piece.rooms.join(", ")));
    }
    if piece.doors > 0 {
        gains.push(format!("frees doors: {}", piece.doors));
    }
    if !piece.surfaces.is_empty() {
        gains.push(format!("surfaces: {}", piece.surfaces.join(", ")));
    }
    gains.join("; ")
}
