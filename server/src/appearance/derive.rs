//! The appearances of a home from a world pack without a file of its own: skies and families of
//! the built-in home, the largest room as the room of reflections, its windows, and decoration
//! by `furnish`.

use std::path::Path;

use wheelarm_pack::{HomeFile, OpeningEntry, OpeningKind, RoomEntry, area};
use wheelarm_proto::defaults;

use super::file::{self, AppearanceFile, Window};
use super::furnish::{bounds, spots};
use crate::scene::{Scene, SceneError, parse_packed};

/// Height of the centre of reflections, metres, below that of the ceiling.
const CENTRE: f64 = 1.1;
/// Distance of a window from the side of the room's box within which it belongs to the room,
/// metres.
const NEAR: f64 = 0.4;
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
        (None, Some(home)) => appearances(assets, home, scene),
        _ => file::check(assets, &pack.asset_path(OWN), parse_packed(pack, OWN)?),
    }
}

fn appearances(
    assets: &Path,
    home: &HomeFile,
    scene: &Scene,
) -> Result<AppearanceFile, SceneError> {
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
    Ok(AppearanceFile {
        centre: [middle[0], middle[1], CENTRE.min(largest.height / 2.0)],
        room,
        window: windows.filter(of_room).collect(),
        decoration: spots(home, &rooms, scene),
        ..shared
    })
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
