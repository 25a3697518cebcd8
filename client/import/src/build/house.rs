//! Walls, openings, rooms and baseboards of a pack.

use wheelarm_pack::{Family, KindFile, OpeningEntry, OpeningKind, PartEntry, RoomEntry, WallEntry};
use wheelarm_proto::exact;

use crate::archive::Archive;
use crate::build::kinds::Passage;
use crate::build::{rounded, rounded2, rounded3};
use crate::error::ImportError;
use crate::fit::METRES;
use crate::paint::Paints;
use crate::plan::{Opening, Plan, StraightWall};
use crate::polygon::{self, Point};
use crate::rooms::PlanRoom;
use crate::sh3d::{Baseboard, Cover, Piece, Rgb};

/// Colors of what has none.
const WALL: Rgb = [236, 230, 218];
const FLOOR: Rgb = [179, 135, 90];
const CEILING: Rgb = [244, 241, 234];
/// Doors begin at most this high, metres: thresholds.
const THRESHOLD: f64 = 0.20;
/// Distances from a wall at which its rooms are looked up, metres: outlines of rooms may leave
/// a gap beside the wall.
const BESIDE: [f64; 3] = [0.15, 0.3, 0.45];
/// Largest number of boxes of baseboards.
const MOST_BASEBOARDS: usize = 2_000;

/// The walls as entries.
///
/// # Errors
/// When the archive is damaged.
pub fn walls(
    plan: &Plan<'_>,
    walls: &[StraightWall],
    paints: &mut Paints,
    archive: &mut Archive,
) -> Result<Vec<WallEntry>, ImportError> {
    let mut entries = Vec::new();
    for wall in walls {
        let source = &plan.home.walls[wall.source];
        // A side without a color has that of the other.
        let pick = |own: &Cover, other: &Cover| -> Cover {
            let is_bare = own.colour.is_none() && own.texture.is_none();
            if is_bare { other.clone() } else { own.clone() }
        };
        // Left in the plan of the file, whose y points down, is left here too.
        let left = pick(&source.left, &source.right);
        let right = pick(&source.right, &source.left);
        let mut cover = |cover: &Cover| paints.cover(archive, cover, WALL, Family::Wall, 0.9);
        let (from, to) = (rounded2(wall.from), rounded2(wall.to));
        let height = rounded(wall.height.max(0.02));
        let end_height = rounded(wall.end_height.max(0.02));
        entries.push(WallEntry {
            from,
            to,
            thickness: rounded(wall.thickness),
            height,
            end_height: (end_height != height).then_some(end_height),
            base: 0.0,
            material_left: cover(&left)?,
            material_right: cover(&right)?,
        });
    }
    Ok(entries)
}

/// What becomes of a door or window with some openings. One between two ends of walls, in a gap,
/// has none.
#[must_use]
pub fn passage(
    plan: &Plan<'_>,
    piece: &Piece,
    openings: &[&Opening],
    walls: &[StraightWall],
    rooms: &[PlanRoom],
) -> Passage {
    // Middle, direction along the wall, and half its thickness.
    let leads = |at: Point, [x, y]: Point, half: f64| {
        [-1.0, 1.0].iter().all(|side| {
            BESIDE.iter().any(|beyond| {
                let off = side * (half + beyond);
                let beside = [at[0] - y * off, at[1] + x * off];
                let mut rooms = rooms.iter();
                rooms.any(|room| polygon::contains(&room.outline, beside))
            })
        })
    };
    let of_wall = |opening: &&Opening| {
        let wall = &walls[opening.wall];
        let [x, y] = wall.direction();
        let at = [wall.from[0] + x * opening.at, wall.from[1] + y * opening.at];
        opening.sill <= THRESHOLD && leads(at, [x, y], 0.5 * wall.thickness)
    };
    let is_open = if openings.is_empty() {
        let (sin, cos) = exact::sin_cos(-piece.angle);
        let half = 0.5 * piece.size[1] * METRES;
        piece.elevation * METRES <= THRESHOLD && leads(plan.place(piece.at), [cos, sin], half)
    } else {
        openings.iter().all(of_wall)
    };
    if is_open {
        Passage::Open
    } else {
        Passage::Closed
    }
}

/// An opening as an entry.
#[must_use]
pub fn opening(opening: &Opening, passage: Passage, leaf: Option<String>) -> OpeningEntry {
    let is_low = opening.sill <= THRESHOLD;
    OpeningEntry {
        wall: opening.wall,
        at: rounded(opening.at),
        width: rounded(opening.width),
        height: rounded(opening.height + if is_low { opening.sill } else { 0.0 }),
        sill: if is_low { 0.0 } else { rounded(opening.sill) },
        kind: match passage {
            Passage::Open => OpeningKind::Frame,
            _ if is_low => OpeningKind::Door,
            _ => OpeningKind::Window,
        },
        leaf: leaf.filter(|_| is_low && passage == Passage::Closed),
    }
}

/// The rooms as entries.
///
/// # Errors
/// When the archive is damaged.
pub fn rooms(
    plan: &Plan<'_>,
    rooms: &[PlanRoom],
    paints: &mut Paints,
    archive: &mut Archive,
) -> Result<Vec<RoomEntry>, ImportError> {
    let mut entries = Vec::new();
    for room in rooms {
        let floor = floor(room, paints, archive)?;
        let ceiling = paints.cover(archive, &room.ceiling, CEILING, Family::Ceiling, 0.95)?;
        entries.push(RoomEntry {
            name: room.name.clone(),
            kind: room.kind.clone(),
            outline: room.outline.iter().map(|&p| rounded2(p)).collect(),
            floor_material: floor,
            height: rounded(plan.height.clamp(0.5, 20.0)),
            ceiling: room.has_ceiling,
            ceiling_material: room.has_ceiling.then_some(ceiling),
        });
    }
    Ok(entries)
}

/// The material of a floor. Wooden colors have planks, wet rooms tiles.
fn floor(
    room: &PlanRoom,
    paints: &mut Paints,
    archive: &mut Archive,
) -> Result<String, ImportError> {
    if room.floor.texture.is_some() {
        return paints.cover(archive, &room.floor, FLOOR, Family::Floor, 0.5);
    }
    let colour = room.floor.colour.unwrap_or(FLOOR);
    let [red, green, blue] = colour.map(i32::from);
    let is_wood = red > green + 8 && green > blue + 8;
    let is_wet = ["bathroom", "kitchen", "toilet", "laundry"].contains(&room.kind.as_str());
    Ok(if is_wood && !room.is_outside {
        paints.patterned(colour, Family::Floor, 0.5, "planks", 1.15)
    } else if is_wet {
        paints.patterned(colour, Family::Floor, 0.35, "tiles", 0.6)
    } else {
        paints.colour(colour, Some(Family::Floor), 0.6)
    })
}

/// All baseboards as one kind, in coordinates of the pack; `None` when there are none.
#[must_use]
pub fn baseboards(
    plan: &Plan<'_>,
    walls: &[StraightWall],
    openings: &[OpeningEntry],
    paints: &mut Paints,
) -> Option<KindFile> {
    let mut parts = Vec::new();
    for (index, wall) in walls.iter().enumerate() {
        let source = &plan.home.walls[wall.source];
        let sides = [
            (1.0, &source.left_baseboard, &source.left),
            (-1.0, &source.right_baseboard, &source.right),
        ];
        for (sign, baseboard, cover) in sides {
            let Some(baseboard) = baseboard.as_ref().filter(|b| b.height > 0.5) else {
                continue;
            };
            if baseboard.height * METRES > wall.height.min(wall.end_height) {
                continue;
            }
            let colour = baseboard.colour.or(cover.colour).unwrap_or(WALL);
            let material = paints.colour(colour, None, 0.5);
            for along in gaps(index, wall, openings, baseboard) {
                parts.push(board(wall, sign, baseboard, along, &material));
            }
        }
    }
    parts.truncate(MOST_BASEBOARDS);
    (!parts.is_empty()).then(|| KindFile {
        category: "baseboard".into(),
        parts,
        collision: Some(Vec::new()),
        ..KindFile::default()
    })
}

/// The stretches of a wall without openings at the height of a baseboard.
fn gaps(
    index: usize,
    wall: &StraightWall,
    openings: &[OpeningEntry],
    baseboard: &Baseboard,
) -> Vec<Point> {
    let mut cuts: Vec<Point> = openings
        .iter()
        .filter(|o| o.wall == index && o.sill < baseboard.height * METRES)
        .map(|o| [o.at - 0.5 * o.width, o.at + 0.5 * o.width])
        .collect();
    cuts.sort_by(|a, b| a[0].total_cmp(&b[0]));
    cuts.push([wall.length(); 2]);
    let mut at = 0.0;
    let mut gaps = Vec::new();
    for [from, to] in cuts {
        if from > at + 0.02 {
            gaps.push([at, from]);
        }
        at = to.max(at);
    }
    gaps
}

fn board(
    wall: &StraightWall,
    sign: f64,
    baseboard: &Baseboard,
    along: Point,
    material: &str,
) -> PartEntry {
    let [x, y] = wall.direction();
    let thickness = (baseboard.thickness * METRES).clamp(0.004, 0.05);
    let height = baseboard.height * METRES;
    let off = sign * 0.5 * (wall.thickness + thickness);
    let middle = 0.5 * (along[0] + along[1]);
    let at = [
        wall.from[0] + x * middle - y * off,
        wall.from[1] + y * middle + x * off,
        0.5 * height,
    ];
    PartEntry {
        cuboid: Some(rounded3([along[1] - along[0], thickness, height])),
        at: Some(rounded3(at)),
        rpy_deg: Some([0.0, 0.0, rounded(exact::atan2(y, x).to_degrees())]),
        material: Some(material.to_owned()),
        collide: Some(false),
        ..PartEntry::default()
    }
}
