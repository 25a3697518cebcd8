//! A small flat: two rooms, a door, a window, a table with a drawer, a cabinet with a hinge.

use std::collections::BTreeMap;

use wheelarm_pack::Pack;

pub const MANIFEST: &str = r#"
format = 1
name = "flat"
version = "1"
[[source]]
of = "home"
author = "Anna"
license = "CC0-1.0"
"#;

pub const HOME: &str = r##"
origin = "drawn for a test"
license = "CC0-1.0"
light = { sun_direction = [0.4, -0.6, 0.8], sun = [1.7, 1.6, 1.3], sky = [0.6, 0.6, 0.7], ground = [0.5, 0.5, 0.4] }
room_camera = { at = [0.3, 0.3, 2.0], look_at = [2.5, 2.0, 0.5], horizontal_fov_deg = 72 }
start = { at = [2.0, 1.5], yaw_deg = 90 }

[[room]]
name = "kitchen"
kind = "kitchen"
outline = [[0, 0], [4, 0], [4, 3], [0, 3]]
floor_material = "parquet"
height = 2.5

[[room]]
name = "hall"
outline = [[4.1, 0], [6, 0], [6, 3], [4.1, 3]]
floor_material = "tiles"
height = 2.5
ceiling = false

[[wall]] # 0: south
from = [-0.05, -0.05]
to = [6.05, -0.05]
thickness = 0.1
height = 2.5
material_left = "wall_white"
material_right = "wall_sage"

[[wall]] # 1: between the rooms, with the door
from = [4.05, 0]
to = [4.05, 3]
thickness = 0.1
height = 2.5
material_left = "wall_white"
material_right = "wall_white"

[[wall]] # 2: sloping
from = [6.05, -0.05]
to = [6.05, 3.05]
thickness = 0.1
height = 2.5
end_height = 1.5
material_left = "wall_white"
material_right = "wall_white"

[[opening]]
wall = 1
at = 1.5
width = 0.9
height = 2.0
kind = "door"

[[opening]]
wall = 0
at = 2.0
width = 1.2
height = 1.0
sill = 0.9
kind = "window"

[[piece]]
name = "table_1"
kind = "table"
at = [1, 2.4, 0]
yaw_deg = -90
room = "kitchen"
materials = { oak = "walnut" }

[[piece]]
name = "drawer_1"
kind = "drawer"
at = [1, 2.4, 0.5]
yaw_deg = -90
on = "table_1"

[[piece]]
name = "door_1"
kind = "door_leaf"
at = [3.2, 2.8, 0.5]
on = "table_1"
mirror = true
scale = [1, 2, 1]
"##;

pub const TABLE: &str = r#"
category = "table"
material = "oak"
parts = [
  { box = [0.6, 1.0, 0.04], at = [0, 0, 0.72] },
  { mesh = { path = "meshes/leg.obj", scale = 0.5 }, material = "oak" },
]
collision = [
  { box = [0.6, 1.0, 0.04], at = [0, 0, 0.72] },
  { hull = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.7]] },
]
surfaces = [{ name = "top", edge = [0.3, 0, 0.74], inwards_deg = 180, depth = 0.5, width = 0.9 }]
"#;

pub const DRAWER: &str = r#"
category = "drawer"
material = "oak"
parts = [{ box = [0.4, 0.4, 0.1] }]
joint = { axis = [1, 0, 0], travel = 0.3, mass = 2.0, com = [0, 0, 0], inertia = [0.03, 0.03, 0.05], friction = 4, damping = 8 }
grasps = [{ name = "handle", point = [0.25, 0.1, 0], approach = [-1, 0, 0], closing = [0, 0, 1], width = 0.02 }]
"#;

pub const DOOR_LEAF: &str = r#"
category = "door"
material = "oak"
parts = [{ box = [0.02, 0.4, 0.6], at = [0, 0.2, 0.3] }]
joint = { turns = true, axis = [0, 0, 1], travel_deg = 90, mass = 2.0, com = [0, 0.2, 0.3], inertia = [0.12, 0.1, 0.03], friction = 1, damping = 0.5 }
"#;

pub const LEG: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0 1\nf 1 2 3\n";

/// Its files, by path.
pub fn files() -> BTreeMap<String, Vec<u8>> {
    [
        ("pack.toml", MANIFEST),
        ("home.toml", HOME),
        ("kinds/table.toml", TABLE),
        ("kinds/drawer.toml", DRAWER),
        ("kinds/door_leaf.toml", DOOR_LEAF),
        ("meshes/leg.obj", LEG),
    ]
    .map(|(path, text)| (path.to_owned(), text.as_bytes().to_vec()))
    .into()
}

/// The pack with one text replaced in one file.
#[allow(dead_code, reason = "not every test replaces a text")]
pub fn changed(path: &str, from: &str, to: &str) -> Result<Pack, wheelarm_pack::PackError> {
    let mut files = files();
    let text = String::from_utf8(files[path].clone()).expect("text");
    assert!(text.contains(from), "{path} has no {from:?}");
    files.insert(path.to_owned(), text.replacen(from, to, 1).into_bytes());
    Pack::from_files(files)
}

#[allow(dead_code, reason = "not every test needs the pack")]
pub fn flat() -> Pack {
    Pack::from_files(files()).unwrap_or_else(|error| panic!("{error}"))
}
