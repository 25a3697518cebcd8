//! The appearances of a home from a world pack without a file of its own: skies and families of
//! the built-in home, the largest room as the room of reflections, its windows, and lamps below
//! the ceilings.

use std::path::Path;

use wheelarm_pack::{HomeFile, OpeningEntry, OpeningKind, RoomEntry, area, contains};
use wheelarm_proto::defaults;

use super::file::{self, AppearanceFile, Kind, Spot, Window};
use super::irradiance::MOST_LAMPS;
use crate::scene::{Scene, SceneError, parse_packed};

/// Height of the centre of reflections, metres, below that of the ceiling.
const CENTRE: f64 = 1.1;
/// Distance of a window from the side of the room's box within which it belongs to the room,
/// metres.
const NEAR: f64 = 0.4;
/// Width and height of a lamp, metres.
const LAMP: [f64; 2] = [0.3, 0.4];

/// Name of the file in a pack.
const OWN: &str = "appearance.toml";

/// The appearances of a scene: those of its file, or derived from the rooms of its pack.
///
/// # Errors
/// When the file, or that of the built-in home, is invalid.
pub(super) fn for_scene(assets: &Path, scene: &Scene) -> Result<AppearanceFile, SceneError> {
    let Some(pack) = &scene.pack else {
        return file::load(assets, &scene.name);
    };
    match (pack.file(OWN), pack.home()) {
        (None, Some(home)) => appearances(assets, home),
        _ => file::check(assets, &pack.asset_path(OWN), parse_packed(pack, OWN)?),
    }
}

fn appearances(assets: &Path, home: &HomeFile) -> Result<AppearanceFile, SceneError> {
    let shared = file::load(assets, defaults::SCENE)?;
    let mut rooms: Vec<&RoomEntry> = home.room.iter().collect();
    rooms.sort_by(|a, b| area(&b.outline).abs().total_cmp(&area(&a.outline).abs()));
    let Some(largest) = rooms.first() else {
        return Ok(shared);
    };
    let [low, high] = bounds(largest);
    let middle = [0, 1].map(|i| (low[i] + high[i]) / 2.0);
    let room = [[low[0], low[1], 0.0], [high[0], high[1], largest.height]];
    let windows = home
        .opening
        .iter()
        .filter_map(|opening| window(home, opening));
    let of_room = |window: &Window| {
        let inside = |i: usize| (low[i] - NEAR..=high[i] + NEAR).contains(&window.at[i]);
        inside(0) && inside(1)
    };
    let lamps = rooms.iter().filter(|room| room.ceiling).filter_map(|room| {
        let [low, high] = bounds(room);
        let at = [0, 1].map(|i| (low[i] + high[i]) / 2.0);
        contains(&room.outline, at).then_some(Spot {
            kind: Kind::Lamp,
            at: [at[0], at[1], room.height],
            along_deg: 0.0,
            size: LAMP,
        })
    });
    Ok(AppearanceFile {
        centre: [middle[0], middle[1], CENTRE.min(largest.height / 2.0)],
        room,
        window: windows.filter(of_room).collect(),
        decoration: lamps.take(MOST_LAMPS).collect(),
        ..shared
    })
}

/// Lowest and highest corner of a room on the floor plan.
fn bounds(room: &RoomEntry) -> [[f64; 2]; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in &room.outline {
        for i in 0..2 {
            low[i] = low[i].min(point[i]);
            high[i] = high[i].max(point[i]);
        }
    }
    [low, high]
}

fn window(home: &HomeFile, opening: &OpeningEntry) -> Option<Window> {
    let wall = home.wall.get(opening.wall)?;
    if opening.kind != OpeningKind::Window {
        return None;
    }
    let [dx, dy] = [wall.to[0] - wall.from[0], wall.to[1] - wall.from[1]];
    let share = opening.at / (dx * dx + dy * dy).sqrt();
    Some(Window {
        at: [
            wall.from[0] + dx * share,
            wall.from[1] + dy * share,
            opening.sill + opening.height / 2.0,
        ],
        size: [opening.width, opening.height],
    })
}
