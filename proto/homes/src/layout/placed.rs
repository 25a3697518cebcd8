//! Pieces of furniture at places, alone and relative to others.

use super::geometry::{Rect, Side};

/// A piece of furniture in a room.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// Its kind in `furniture.toml`.
    pub kind: String,
    /// Lengths from back to front, from side to side, and height, metres.
    pub size: [f64; 3],
    /// Middle on the floor, metres.
    pub at: [f64; 2],
    /// Degrees.
    pub yaw_deg: f64,
    /// Rectangle around it.
    pub rect: Rect,
    /// The wall at its back.
    pub side: Option<Side>,
}

/// Whether furniture of a kind takes floor.
#[must_use]
pub fn is_solid(kind: &str) -> bool {
    kind != "rug"
}

/// Seats at a table in its frame: middle, rotation, and the direction away from the table. The
/// front of the table stays free, and its back where it is at a wall.
pub fn seats(table: &Placed, chair: [f64; 3]) -> Vec<([f64; 2], f64, [f64; 2])> {
    let [depth, width, _] = table.size;
    let inset = chair[0] / 2.0 - 0.20;
    let (back, end) = (depth / 2.0 + inset, width / 2.0 + inset);
    let mut seats = vec![
        ([0.0, end], -90.0, [0.0, 1.0]),
        ([0.0, -end], 90.0, [0.0, -1.0]),
    ];
    if table.side.is_none() {
        let places: &[f64] = if width > 1.15 { &[-0.25, 0.25] } else { &[0.0] };
        let back = places
            .iter()
            .map(|share| ([-back, share * width], 0.0, [-1.0, 0.0]));
        seats.extend(back);
    }
    seats
}

/// Sine and cosine of the rotation of a piece whose rotation is a multiple of 90°.
fn quarter(yaw_deg: f64) -> [f64; 2] {
    match ((yaw_deg / 90.0).round() as i32).rem_euclid(4) {
        0 => [0.0, 1.0],
        1 => [1.0, 0.0],
        2 => [0.0, -1.0],
        _ => [-1.0, 0.0],
    }
}

/// A point in the frame of a piece.
pub fn local(piece: &Placed, at: [f64; 2]) -> [f64; 2] {
    let [sin, cos] = quarter(piece.yaw_deg);
    let [x, y] = [at[0] - piece.at[0], at[1] - piece.at[1]];
    [x * cos + y * sin, y * cos - x * sin]
}

/// A piece at a place of the leader's frame, rotated by `turn` degrees against it.
pub fn inside_of(leader: &Placed, kind: &str, size: [f64; 3], at: [f64; 2], turn: f64) -> Placed {
    let [sin, cos] = quarter(leader.yaw_deg);
    let at = [
        leader.at[0] + at[0] * cos - at[1] * sin,
        leader.at[1] + at[0] * sin + at[1] * cos,
    ];
    let yaw = leader.yaw_deg + turn;
    let yaw_deg = yaw - 360.0 * (yaw / 360.0).round();
    let [sin, cos] = quarter(yaw_deg);
    let (sin, cos) = (sin.abs(), cos.abs());
    // A piece that is turned by a few degrees needs a little more.
    let tilt = (yaw_deg - 90.0 * (yaw_deg / 90.0).round())
        .abs()
        .to_radians();
    let (depth, width) = (size[0] + tilt * size[1], size[1] + tilt * size[0]);
    Placed {
        kind: kind.to_owned(),
        size,
        at,
        yaw_deg,
        rect: Rect::about(at, [depth * cos + width * sin, depth * sin + width * cos]),
        side: None,
    }
}

/// A piece with its back at a wall.
pub fn at_wall(kind: &str, size: [f64; 3], rect: Rect, side: Side) -> Placed {
    Placed {
        kind: kind.to_owned(),
        size,
        at: rect.middle(),
        yaw_deg: side.yaw_deg(),
        rect,
        side: Some(side),
    }
}

/// Free floor before a piece; around it when it is away from walls.
pub fn zone_before(piece: &Placed, front: f64) -> Option<Rect> {
    if front <= 0.0 {
        return None;
    }
    let Some(side) = piece.side else {
        return Some(piece.rect.grown(front));
    };
    let depth = piece.size[0];
    // The piece is at the wall: a strip of a room that ends at its back.
    let range = side.range(&piece.rect);
    Some(side.strip(&piece.rect, range, [depth, depth + front]))
}
