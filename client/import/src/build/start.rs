//! Start of the chair and camera of the room.

use wheelarm_pack::{OpeningEntry, RoomCameraEntry, StartEntry};

use crate::build::clear::Shape;
use crate::build::{Options, Summary, rounded, rounded2, rounded3};
use crate::error::ImportError;
use crate::place::{FreeFloor, Obstacle, Start};
use crate::plan::{Plan, StraightWall};
use crate::polygon::{self, Point};
use crate::rooms::PlanRoom;

/// Free circle that a wheelchair needs to start, metres.
const CHAIR: f64 = 0.45;
/// What is this close to the height of the camera is in its view, metres.
const VIEW: f64 = 0.5;

/// Walls without their passages, as obstacles.
pub(super) fn wall_obstacles(walls: &[StraightWall], openings: &[OpeningEntry]) -> Vec<Obstacle> {
    let mut all = Vec::new();
    for (index, wall) in walls.iter().enumerate() {
        let mut cuts: Vec<Point> = openings
            .iter()
            .filter(|o| o.wall == index && o.sill <= 0.0 && o.leaf.is_none())
            .map(|o| [o.at - 0.5 * o.width, o.at + 0.5 * o.width])
            .collect();
        cuts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        cuts.push([wall.length(); 2]);
        let [x, y] = wall.direction();
        let mut at = 0.0;
        for [from, to] in cuts {
            if from > at + 1.0e-6 {
                let end = |along: f64| [wall.from[0] + x * along, wall.from[1] + y * along];
                let part = StraightWall {
                    from: end(at),
                    to: end(from),
                    ..wall.clone()
                };
                let outline = part.outline().to_vec();
                all.push(Obstacle { outline });
            }
            at = to.max(at);
        }
    }
    all
}

/// Start in the largest room with free floor, and a camera in a corner of it.
pub(super) fn start_and_camera(
    options: &Options,
    plan: &Plan<'_>,
    rooms: &[PlanRoom],
    obstacles: &[Obstacle],
    shapes: &[Shape],
    summary: &mut Summary,
) -> Result<(StartEntry, RoomCameraEntry), ImportError> {
    let outlines: Vec<&[Point]> = rooms.iter().map(|room| room.outline.as_slice()).collect();
    let openings = plan.floor_openings();
    let no_start = || ImportError::NoStart {
        name: options.name.clone(),
        radius: CHAIR,
    };
    let floor = FreeFloor::new(&outlines, obstacles, &openings).ok_or_else(no_start)?;
    let mut order: Vec<&PlanRoom> = rooms.iter().collect();
    order.sort_by(|a, b| {
        a.is_outside
            .cmp(&b.is_outside)
            .then(b.area().total_cmp(&a.area()))
            .then(a.name.cmp(&b.name))
    });
    let mut best: Option<(&PlanRoom, Start)> = None;
    for &room in &order {
        let Some(start) = floor.start(&room.outline) else {
            continue;
        };
        let is_better = best
            .as_ref()
            .is_none_or(|(_, known)| start.free > known.free + 0.1);
        let needed = best
            .as_ref()
            .is_none_or(|(_, known)| known.free < 2.0 * CHAIR);
        if needed && is_better {
            best = Some((room, start));
        }
    }
    let (room, start) = best.ok_or_else(no_start)?;
    if start.free < CHAIR {
        summary.notes.push(format!(
            "no room has a free circle of {CHAIR} m for the chair to start; it starts in {} with {:.2} m. Move or leave out furniture, for example with --without chairs,rugs",
            room.name, start.free
        ));
    }
    let (low, high) = polygon::bounds(&room.outline);
    let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    let target = if polygon::contains(&room.outline, middle) {
        middle
    } else {
        start.at
    };
    let look = [target[0], target[1], 0.7];
    let height = (plan.height - 0.35).clamp(1.2, 2.1);
    let in_view = shapes.iter().filter(|shape| shape.high > height - VIEW);
    let in_view = in_view.filter(|shape| shape.piece.is_some() && shape.low < height + VIEW);
    let tall: Vec<&[Point]> = in_view.map(|shape| shape.outline.as_slice()).collect();
    let walls = shapes.iter().filter(|shape| shape.piece.is_none());
    let walls: Vec<&[Point]> = walls.map(|shape| shape.outline.as_slice()).collect();
    let [x, y] = rounded2(floor.camera(&room.outline, target, &tall, &walls));
    Ok((
        StartEntry {
            at: rounded2(start.at),
            yaw_deg: rounded(start.yaw_deg),
        },
        RoomCameraEntry {
            at: rounded3([x, y, height]),
            look_at: rounded3(look),
            horizontal_fov_deg: 75.0,
        },
    ))
}
