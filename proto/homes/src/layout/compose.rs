//! Turns a layout into the tables of a pack: kinds, pieces, walls, materials.

use std::collections::BTreeMap;

use wheelarm_pack::{
    FORMAT, Family, HomeFile, KindFile, LightEntry, Manifest, MaterialEntry, MaterialFile, Pack,
    PackError, PieceEntry, RoomCameraEntry, RoomEntry, SourceEntry, StartEntry,
};
use wheelarm_proto::exact;

use super::draft::{Layout, space};
use super::dress;
use super::files::{Catalog, PlanFile, StyleFile};
use super::geometry::Side;
use super::kinds;
use super::placed::Placed;
use super::random::Random;
use super::rooms::{WALL, largest};
use super::shape::{Design, Model, rounded, rounded3};
use super::walls::{self, DOOR, WallMaterials};

/// Height of rooms, metres.
const HEIGHT: f64 = 2.5;
/// Height of the room camera, and of what hides its view, metres.
const CAMERA: [f64; 2] = [2.05, 1.3];
/// Kinds of rooms with tiles.
const WET: [&str; 4] = ["bathroom", "toilet", "laundry", "kitchen"];
/// Author in the list of sources.
const AUTHOR: &str = "WheelArm";

/// What is made into a pack.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// Plans, styles and sizes.
    pub catalog: &'a Catalog,
    /// Name and table of the plan.
    pub plan: (&'a str, &'a PlanFile),
    /// Name and table of the style.
    pub style: (&'a str, &'a StyleFile),
    /// Seed of the layout.
    pub seed: u64,
    /// Name of the pack.
    pub name: &'a str,
}

/// The tables of a pack.
#[derive(Clone, Debug)]
pub struct Tables {
    /// `pack.toml`.
    pub manifest: Manifest,
    /// `home.toml`.
    pub home: HomeFile,
    /// Kinds by name.
    pub kinds: BTreeMap<String, KindFile>,
    /// Materials.
    pub files: BTreeMap<String, Vec<u8>>,
}

impl Tables {
    /// The pack.
    ///
    /// # Errors
    /// [`PackError`] when a value exceeds a limit of packs.
    pub fn pack(&self) -> Result<Pack, PackError> {
        Pack::from_tables(
            &self.manifest,
            Some(&self.home),
            &self.kinds,
            self.files.clone(),
        )
    }
}

/// Kinds and pieces so far.
#[derive(Default)]
struct Pieces {
    kinds: BTreeMap<String, KindFile>,
    pieces: Vec<PieceEntry>,
    numbers: BTreeMap<String, usize>,
}

impl Pieces {
    /// The name of a kind; equal shapes have one name.
    fn kind(&mut self, base: &str, model: Model) -> String {
        let mut number = 1;
        loop {
            let name = match number {
                1 => base.to_owned(),
                number => format!("{base}_{number}"),
            };
            match self.kinds.get(&name) {
                None => {
                    self.kinds.insert(name.clone(), model.kind);
                    return name;
                }
                Some(known) if *known == model.kind => return name,
                Some(_) => number += 1,
            }
        }
    }

    /// Adds a piece. Returns its name.
    fn add(
        &mut self,
        base: &str,
        model: Model,
        at: [f64; 3],
        yaw_deg: f64,
        room: Option<&str>,
    ) -> String {
        let kind = self.kind(base, model);
        let number = self.numbers.entry(base.to_owned()).or_default();
        *number += 1;
        let name = format!("{base}_{number}");
        self.pieces.push(PieceEntry {
            name: name.clone(),
            kind,
            at: rounded3(at),
            yaw_deg: rounded(yaw_deg),
            room: room.map(str::to_owned),
            area: String::new(),
            scale: None,
            mirror: false,
            on: None,
            materials: BTreeMap::new(),
            optional: false,
        });
        name
    }
}

/// The tables of a layout. The chair starts at the origin until a start is found.
#[must_use]
pub fn compose(order: &Order<'_>, layout: &Layout) -> Tables {
    let (plan, style) = (order.plan.1, order.style.1);
    let design = Design {
        front: style.front,
        handle: style.handle,
        legs: style.legs,
    };
    let mut random = Random::for_purpose(order.plan.0, order.seed, "dress");
    let mut pieces = Pieces::default();
    for (index, room) in plan.room.iter().enumerate() {
        let space = space(&layout.rooms, index);
        let placed = &layout.furnished[index].placed;
        for piece in placed {
            furniture(order, &mut pieces, piece, &room.name, design, &mut random);
        }
        for hung in dress::walls(
            &layout.rooms,
            index,
            room.kind(),
            &space,
            placed,
            &mut random,
        ) {
            let model = kinds::wall_pieces(hung.piece, HEIGHT, design, &mut random);
            let yaw_deg = hung.side.map_or(0.0, Side::yaw_deg);
            let [x, y] = hung.at;
            let base = hung.piece.category();
            pieces.add(base, model, [x, y, 0.0], yaw_deg, Some(&room.name));
        }
    }
    let leaf = openings(plan, layout, &mut pieces, &mut random);
    let mut materials = style.material.clone();
    let (walls_of, floors) = finishes(plan, style, &mut materials, &mut random);
    let wall_materials = WallMaterials {
        rooms: &walls_of,
        outside: "wall_outside",
    };
    let (wall, opening) = walls::build(&layout.rooms, HEIGHT, &wall_materials, &leaf);
    let room = plan.room.iter().enumerate().map(|(index, room)| {
        let outline = layout.rooms.shapes[index].outline();
        let ([x0, x1], [y0, y1]) = (outline.x, outline.y);
        RoomEntry {
            name: room.name.clone(),
            kind: room.kind().to_owned(),
            outline: vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]],
            floor_material: floors[index].clone(),
            height: HEIGHT,
            ceiling: true,
            ceiling_material: Some("ceiling".to_owned()),
        }
    });
    let origin = format!(
        "plan {}, style {}, layout seed {}",
        order.plan.0, order.style.0, order.seed
    );
    let license = plan.license.clone();
    let home = HomeFile {
        origin: origin.clone(),
        license: license.clone(),
        light: light(),
        room_camera: camera(layout),
        start: StartEntry {
            at: [0.0; 2],
            yaw_deg: 0.0,
        },
        room: room.collect(),
        wall,
        opening,
        piece: pieces.pieces,
        object: Vec::new(),
        place: Vec::new(),
        handle: Vec::new(),
    };
    let table = MaterialFile {
        origin: style.origin.clone(),
        license: style.license.clone(),
        material: materials,
    };
    // A table of finite numbers and text is TOML.
    let text = toml::to_string(&table).unwrap_or_default();
    Tables {
        manifest: Manifest {
            format: FORMAT,
            name: order.name.to_owned(),
            version: "1".to_owned(),
            held_out: plan.held_out || style.held_out,
            hidden: false,
            source: vec![SourceEntry {
                of: "home".to_owned(),
                author: AUTHOR.to_owned(),
                license,
                origin,
            }],
        },
        home,
        kinds: pieces.kinds,
        files: BTreeMap::from([("materials/home.toml".to_owned(), text.into_bytes())]),
    }
}

/// Adds a piece of furniture and the small objects on it.
fn furniture(
    order: &Order<'_>,
    pieces: &mut Pieces,
    piece: &Placed,
    room: &str,
    design: Design,
    random: &mut Random,
) {
    let sizes = &order.catalog.furniture.kind;
    let category = sizes
        .get(&piece.kind)
        .map_or("", |kind| kind.category.as_str());
    let Some(model) = kinds::model(&piece.kind, category, piece.size, design, random) else {
        return;
    };
    let surface = model.kind.surfaces.first().map(|surface| {
        let x = [surface.edge[0] - surface.depth, surface.edge[0]];
        let half = surface.width / 2.0;
        let y = [surface.edge[1] - half, surface.edge[1] + half];
        (x, y, surface.edge[2])
    });
    // Pots are on a cooker, lamps on a side table, although tasks do not use these.
    let [depth, width, height] = piece.size;
    let (half, wide) = (depth / 2.0, width / 2.0);
    let surface = surface.or(match piece.kind.as_str() {
        "cooker" => Some(([-half, half], [-wide, wide], height + 0.006)),
        "side_table" => Some(([-0.1, 0.1], [-0.1, 0.1], height)),
        _ => None,
    });
    let [x, y] = piece.at;
    pieces.add(&piece.kind, model, [x, y, 0.0], piece.yaw_deg, Some(room));
    let Some((sx, sy, height)) = surface.filter(|_| piece.kind != "shelf") else {
        return;
    };
    let (sin, cos) = exact::sin_cos(piece.yaw_deg.to_radians());
    for object in dress::small_objects(piece, sx, sy, height, random) {
        let model = kinds::small_objects(object.name, random);
        let [u, v, z] = object.at;
        let at = [x + u * cos - v * sin, y + u * sin + v * cos, z];
        let yaw = piece.yaw_deg + object.yaw_deg;
        let yaw = yaw - 360.0 * (yaw / 360.0).round();
        pieces.add(object.name, model, at, yaw, Some(room));
    }
}

/// Adds the frames of doors, the front door and the windows. Returns the name of the front door.
fn openings(plan: &PlanFile, layout: &Layout, pieces: &mut Pieces, random: &mut Random) -> String {
    let mut leaf = String::new();
    let place = |room: usize, side: Side, at: f64| {
        let line = side.line(&layout.rooms.shapes[room].outline());
        if side.is_along_x() {
            [at, line, 0.0]
        } else {
            [line, at, 0.0]
        }
    };
    for door in &layout.rooms.doors {
        let at = place(door.room, door.side, door.at);
        let yaw = door.side.yaw_deg();
        if door.other.is_some() {
            let model = kinds::door_frame(door.width, DOOR, WALL);
            pieces.add("door_frame", model, at, yaw, None);
        } else {
            let model = kinds::front_door(door.width, DOOR, WALL);
            leaf = pieces.add("front_door", model, at, yaw, None);
        }
    }
    for window in &layout.rooms.windows {
        let at = place(window.room, window.side, window.at);
        let kind = plan.room[window.room].kind();
        let inside = layout.rooms.shapes[window.room].inside();
        let half = window.width / 2.0 + 0.36;
        let range = [window.at - half, window.at + half];
        let below = window.side.strip(&inside, range, [0.0, 0.25]);
        let placed = layout.furnished[window.room].placed.iter();
        let highest = placed
            .filter(|piece| piece.rect.overlaps(&below))
            .map(|piece| piece.size[2] + 0.04)
            .fold(0.03, f64::max);
        let has_room = inside.contains(&below) && highest < window.heights[0] + 0.05;
        let curtains = (has_room && !WET.contains(&kind)).then_some(highest);
        let model = kinds::window(window.width, window.heights, WALL, curtains, random);
        pieces.add("window", model, at, window.side.yaw_deg(), None);
    }
    leaf
}

/// Materials of the walls and the floor of each room.
fn finishes(
    plan: &PlanFile,
    style: &StyleFile,
    materials: &mut BTreeMap<String, MaterialEntry>,
    random: &mut Random,
) -> (Vec<String>, Vec<String>) {
    for (index, color) in style.walls.iter().enumerate() {
        materials.insert(format!("wall_{}", index + 1), wall(color));
    }
    let of_room = |kind: &str, random: &mut Random| match kind {
        "bathroom" | "toilet" => "wall_wet".to_owned(),
        _ => format!("wall_{}", random.index(style.walls.len().max(1)) + 1),
    };
    let rooms = plan.room.iter();
    let walls = rooms.map(|room| of_room(room.kind(), random)).collect();
    let floor = |kind: &str| {
        if WET.contains(&kind) {
            "floor_wet"
        } else {
            "floor"
        }
    };
    let floors = plan.room.iter().map(|room| floor(room.kind()).to_owned());
    (walls, floors.collect())
}

fn wall(color: &str) -> MaterialEntry {
    MaterialEntry {
        color: color.to_owned(),
        roughness: 0.92,
        metallic: 0.0,
        emission: 0.0,
        texture: None,
        family: Some(Family::Wall),
        transmission: 0.0,
    }
}

/// Light of imported homes.
fn light() -> LightEntry {
    LightEntry {
        sun_direction: [0.45, -0.65, 0.80],
        sun: [1.10, 1.01, 0.85],
        sky: [0.62, 0.65, 0.70],
        ground: [0.56, 0.52, 0.47],
    }
}

/// A camera in a corner of the largest room, away from tall furniture.
fn camera(layout: &Layout) -> RoomCameraEntry {
    let room = largest(&layout.rooms.shapes);
    let inside = layout.rooms.shapes[room].inside();
    let middle = inside.middle();
    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
        let (x, y) = (inside.x[i], inside.y[j]);
        [
            x + 0.30 * (middle[0] - x).signum(),
            y + 0.30 * (middle[1] - y).signum(),
        ]
    });
    let cost = |corner: &[f64; 2]| {
        let placed = layout.furnished[room].placed.iter();
        let tall = placed.filter(|piece| piece.size[2] > CAMERA[1]);
        // What is near the corner hides most.
        let near = tall.map(|piece| {
            let [x, y] = [0, 1].map(|i| piece.at[i] - corner[i]);
            1.0 / (0.2 + x * x + y * y)
        });
        near.sum::<f64>()
    };
    let best = corners.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
    let [x, y] = best.copied().unwrap_or(middle);
    RoomCameraEntry {
        at: rounded3([x, y, CAMERA[0]]),
        look_at: rounded3([middle[0], middle[1], 0.70]),
        horizontal_fov_deg: 75.0,
    }
}
