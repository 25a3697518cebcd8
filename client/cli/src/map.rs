//! `wheelarm map`: the floor of the home for its robot, as files of Nav2.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use wheelarm_proto::v1;
use wheelarm_sdk::Client;

/// Options of `wheelarm map`.
#[derive(Args)]
pub struct MapArgs {
    /// Writes DIR/NAME.yaml and DIR/NAME.pgm, which map_server of Nav2 reads, and
    /// DIR/NAME.json with rooms and doors.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Name of the files.
    #[arg(long, default_value = "map", requires = "out")]
    name: String,
    /// Layer of the image: `occupied` floor, or `free`, where this chair can be.
    #[arg(long, value_enum, default_value = "occupied", requires = "out")]
    layer: Layer,
    /// Leaves out the movable objects.
    #[arg(long)]
    without_objects: bool,
}

/// A layer of a map.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Layer {
    /// Occupied floor.
    Occupied,
    /// Where the chair can be.
    Free,
}

/// Requests the map, writes its files and returns its rooms and doors as text.
///
/// # Errors
/// When no server replies or a file cannot be written.
pub fn run(client: &Client, args: &MapArgs) -> anyhow::Result<String> {
    let map = client.request(&v1::MapRequest {
        without_objects: args.without_objects,
    })?;
    let cells = map.width as usize * map.height as usize;
    ensure!(
        map.occupied.len() == cells && map.free.len() == cells,
        "the server sent {} and {} of {cells} cells; use programs of one version",
        map.occupied.len(),
        map.free.len()
    );
    let mut text = summary(&map);
    if let Some(folder) = &args.out {
        fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        let layer = match args.layer {
            Layer::Occupied => &map.occupied,
            Layer::Free => &map.free,
        };
        let image = format!("{}.pgm", args.name);
        for (name, bytes) in [
            (image.clone(), pgm(&map, layer)),
            (
                format!("{}.yaml", args.name),
                yaml(&map, &image).into_bytes(),
            ),
            (format!("{}.json", args.name), json(&map).into_bytes()),
        ] {
            let path = folder.join(name);
            fs::write(&path, bytes).with_context(|| format!("writing {}", path.display()))?;
            let _ = writeln!(text, "wrote {}", path.display());
        }
    }
    Ok(text)
}

/// Size, free floor, rooms and doors.
fn summary(map: &v1::MapReply) -> String {
    let mut text = String::new();
    let area = map.resolution * map.resolution;
    let free = map.free.iter().filter(|cell| **cell == 0).count() as f64 * area;
    let _ = writeln!(
        text,
        "{} x {} cells of {} m from ({}, {}); the chair gets to {free:.1} m²",
        map.width, map.height, map.resolution, map.x, map.y
    );
    for room in &map.rooms {
        let kind = if room.kind.is_empty() {
            "-"
        } else {
            &room.kind
        };
        let _ = writeln!(text, "room {:<24} {kind}", room.name);
    }
    for door in &map.doors {
        let rooms = door.rooms.iter().map(|room| match room.as_str() {
            "" => "outside",
            name => name,
        });
        let rooms = rooms.collect::<Vec<_>>().join(" - ");
        let _ = writeln!(
            text,
            "door {rooms:<24} {:.2} m wide, {:.2} m clear",
            door.width, door.clear_width
        );
    }
    text
}

/// The image of a layer, top row first, in the grey levels of map_server.
fn pgm(map: &v1::MapReply, cells: &[u8]) -> Vec<u8> {
    let width = map.width as usize;
    let mut out = format!("P5\n{} {}\n255\n", map.width, map.height).into_bytes();
    for row in cells.chunks_exact(width.max(1)).rev() {
        out.extend(row.iter().map(|cell| match cell {
            0 => 254,
            100 => 0,
            _ => 205,
        }));
    }
    out
}

/// The description of the image.
fn yaml(map: &v1::MapReply, image: &str) -> String {
    format!(
        "image: {image}\nmode: trinary\nresolution: {}\norigin: [{}, {}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        map.resolution, map.x, map.y
    )
}

/// Rooms and doors, metres and radians.
fn json(map: &v1::MapReply) -> String {
    let rooms = map.rooms.iter().map(|room| {
        let outline: Vec<_> = room.corners.iter().map(|at| [at.x, at.y]).collect();
        serde_json::json!({"name": room.name, "kind": room.kind, "outline": outline})
    });
    let doors = map.doors.iter().map(|door| {
        serde_json::json!({"x": door.x, "y": door.y, "along": door.along, "width": door.width,
            "clear_width": door.clear_width, "has_leaf": door.has_leaf, "rooms": door.rooms})
    });
    let all =
        serde_json::json!({"rooms": rooms.collect::<Vec<_>>(), "doors": doors.collect::<Vec<_>>()});
    format!("{all:#}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_has_the_top_row_first_and_the_levels_of_map_server() {
        let map = v1::MapReply {
            resolution: 0.05,
            x: -1.0,
            y: 2.0,
            width: 3,
            height: 2,
            ..v1::MapReply::default()
        };
        let image = pgm(&map, &[0, 0, 100, 255, 100, 0]);
        assert_eq!(image, b"P5\n3 2\n255\n\xcd\x00\xfe\xfe\xfe\x00");
        assert!(yaml(&map, "map.pgm").contains("origin: [-1, 2, 0.0]"));
    }
}
