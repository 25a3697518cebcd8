//! The map of a home as a message.

use wheelarm_proto::{exact, v1};

use crate::tasks::{Door, HomeMap, Room};

/// A cell that is free, one that is not, and one outside, as in `nav_msgs/OccupancyGrid`.
const VALUES: [u8; 3] = [0, 100, u8::MAX];

/// The map without its stamp.
#[must_use]
pub fn home_map(map: &HomeMap) -> v1::MapReply {
    let grid = map.free.grid();
    let ([x, y], [width, height]) = (grid.corner().map(f64::from), grid.count());
    let [free, not, outside] = VALUES;
    let values = |is_free: &dyn Fn(usize) -> bool| -> Vec<u8> {
        let cells = map.inside.iter().enumerate();
        let value = |(cell, inside): (usize, &bool)| match (*inside, is_free(cell)) {
            (false, _) => outside,
            (true, true) => free,
            (true, false) => not,
        };
        cells.map(value).collect()
    };
    v1::MapReply {
        header: None,
        resolution: grid.side(),
        x,
        y,
        width: width as u32,
        height: height as u32,
        occupied: values(&|cell| !map.occupied.marked()[cell]),
        free: values(&|cell| map.free.marked()[cell]),
        rooms: map.rooms.iter().map(room).collect(),
        doors: map.doors.iter().map(door).collect(),
    }
}

fn room(room: &Room) -> v1::MapRoom {
    let corners = room.outline.iter();
    v1::MapRoom {
        name: room.name.clone(),
        kind: room.kind.clone(),
        corners: corners.map(|&[x, y]| v1::MapPoint { x, y }).collect(),
    }
}

fn door(door: &Door) -> v1::MapDoor {
    v1::MapDoor {
        x: door.centre[0],
        y: door.centre[1],
        along: exact::atan2(door.along[1], door.along[0]),
        width: door.width,
        clear_width: door.clear_width,
        has_leaf: door.has_leaf,
        rooms: door.rooms.to_vec(),
    }
}
