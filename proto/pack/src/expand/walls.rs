//! Walls: joined at corners, split at openings.

use wheelarm_proto::exact;

use super::FILE;
use crate::error::{PackError, Place};
use crate::{FurnitureEntry, HomeFile, PartEntry, PrismEntry, WallEntry};

/// Ends of walls that are nearer than this are joined, metres.
const JOINED: f64 = 0.002;
/// Shorter pieces of walls are left out, metres.
const LEAST: f64 = 0.001;
/// Category of walls.
const CATEGORY: &str = "wall";

/// A wall with its direction and length.
struct Straight<'a> {
    entry: &'a WallEntry,
    /// Unit vector from `from` to `to`.
    along: [f64; 2],
    length: f64,
}

/// A part of a wall: from `x[0]` to `x[1]` along it, from `base` to the tops at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Slab {
    x: [f64; 2],
    base: f64,
    tops: [f64; 2],
}

/// Every wall as furniture `wall_0`, `wall_1`, …
pub(super) fn walls(home: &HomeFile) -> Result<Vec<FurnitureEntry>, PackError> {
    let mut straight = Vec::new();
    for (i, entry) in home.wall.iter().enumerate() {
        straight.push(check(&Place::file(FILE).entry("wall", i), entry)?);
    }
    let mut holes = vec![Vec::new(); straight.len()];
    for (i, opening) in home.opening.iter().enumerate() {
        let place = Place::file(FILE).entry("opening", i);
        let Some(wall) = straight.get(opening.wall) else {
            return Err(place.key("wall").wrong(
                opening.wall,
                format!("the index of a wall, below {}", straight.len()),
                "walls count from 0 in the order of the file",
            ));
        };
        for (key, length) in [("width", opening.width), ("height", opening.height)] {
            place
                .key(key)
                .within(length, 0.01, 20.0, "m", "lengths are metres")?;
        }
        place
            .key("sill")
            .within(opening.sill, 0.0, 20.0, "m", "lengths are metres")?;
        place.key("at").within(
            opening.at,
            0.0,
            wall.length,
            "m",
            "it is the distance of the opening's middle from the start of its wall",
        )?;
        let half = opening.width / 2.0;
        holes[opening.wall].push((
            [opening.at - half, opening.at + half],
            [opening.sill, opening.sill + opening.height],
        ));
    }
    Ok(straight
        .iter()
        .enumerate()
        .map(|(i, wall)| {
            let extent = extent(&straight, i);
            furniture(i, wall, &slabs(wall, extent, &holes[i]))
        })
        .collect())
}

fn check<'a>(place: &Place, entry: &'a WallEntry) -> Result<Straight<'a>, PackError> {
    for (key, point) in [("from", entry.from), ("to", entry.to)] {
        for value in point {
            place
                .key(key)
                .within(value, -50.0, 50.0, "m", "positions are metres")?;
        }
    }
    let [dx, dy] = [entry.to[0] - entry.from[0], entry.to[1] - entry.from[1]];
    let length = (dx * dx + dy * dy).sqrt();
    place.key("to").within(
        length,
        0.005,
        100.0,
        "m from the start",
        "leave out walls without length",
    )?;
    place
        .key("thickness")
        .within(entry.thickness, 0.005, 5.0, "m", "lengths are metres")?;
    let top = place
        .key("base")
        .within(entry.base, 0.0, 20.0, "m", "lengths are metres")?
        + LEAST;
    let tops = [
        ("height", entry.height),
        ("end_height", entry.end_height.unwrap_or(entry.height)),
    ];
    for (key, height) in tops {
        place.key(key).within(
            height,
            top,
            20.0,
            "m",
            "the top of a wall is above its base",
        )?;
    }
    Ok(Straight {
        entry,
        along: [dx / length, dy / length],
        length,
    })
}

/// Start and end along a wall: beyond or before its ends, so that corners are closed and no two
/// walls have coinciding sides.
///
/// Where two walls meet, both are lengthened to the outer corner. At a right angle the first is
/// lengthened by half of the other's thickness and the second shortened by half of the first's.
/// Ends of three or more walls stay: two of them close the corner.
fn extent(walls: &[Straight<'_>], index: usize) -> [f64; 2] {
    let wall = &walls[index];
    let beyond = |end: [f64; 2], out: [f64; 2]| -> f64 {
        let near = |p: [f64; 2]| (p[0] - end[0]).abs() < JOINED && (p[1] - end[1]).abs() < JOINED;
        let mut others = walls.iter().enumerate().filter_map(|(i, other)| {
            let reverse = other.along.map(|c| 0.0 - c);
            let out_of_end = if i == index {
                return None;
            } else if near(other.entry.from) {
                other.along
            } else if near(other.entry.to) {
                reverse
            } else {
                return None;
            };
            Some((i, other, out_of_end))
        });
        let (Some((i, other, away)), None) = (others.next(), others.next()) else {
            return 0.0;
        };
        // Angle between the direction out of this wall and the one into the other.
        let cos = out[0] * away[0] + out[1] * away[1];
        let sin = (out[0] * away[1] - out[1] * away[0]).abs();
        let (own, its) = (wall.entry.thickness / 2.0, other.entry.thickness / 2.0);
        if cos.abs() < 0.1 {
            if index < i { its } else { -own }
        } else {
            // Half of the angle: its tangent is sin / (1 + cos). A sharp corner stays open.
            (own * sin / (1.0 + cos).max(0.05)).min(2.0 * its.max(own))
        }
    };
    let back = wall.along.map(|c| 0.0 - c);
    [
        -beyond(wall.entry.from, back),
        wall.length + beyond(wall.entry.to, wall.along),
    ]
}

/// The wall without its holes: columns between the sides of holes, each with the heights that
/// no hole takes. Equal neighbours are one slab.
fn slabs(wall: &Straight<'_>, extent: [f64; 2], holes: &[([f64; 2], [f64; 2])]) -> Vec<Slab> {
    let entry = wall.entry;
    let rise = entry.end_height.unwrap_or(entry.height) - entry.height;
    let top_at = |x: f64| entry.height + rise * (x / wall.length).clamp(0.0, 1.0);
    let mut cuts: Vec<f64> = holes.iter().flat_map(|(x, _)| *x).collect();
    cuts.retain(|x| *x > extent[0] && *x < extent[1]);
    cuts.extend(extent);
    cuts.sort_by(f64::total_cmp);
    let mut all: Vec<Slab> = Vec::new();
    let mut before: Vec<Slab> = Vec::new();
    for pair in cuts.windows(2) {
        let x = [pair[0], pair[1]];
        if x[1] - x[0] < LEAST {
            continue;
        }
        let middle = (x[0] + x[1]) / 2.0;
        let mut taken: Vec<[f64; 2]> = holes
            .iter()
            .filter(|(hole, _)| hole[0] < middle && middle < hole[1])
            .map(|(_, z)| *z)
            .collect();
        taken.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let tops = x.map(top_at);
        let lowest = tops[0].min(tops[1]);
        let mut column = Vec::new();
        let mut base = entry.base;
        for [from, to] in taken {
            let until = from.min(lowest);
            if until - base >= LEAST {
                column.push(Slab {
                    x,
                    base,
                    tops: [until; 2],
                });
            }
            base = base.max(to);
        }
        if lowest - base >= LEAST {
            column.push(Slab { x, base, tops });
        }
        let continues = |last: &Slab, next: &Slab| {
            last.x[1] == next.x[0] && last.base == next.base && last.tops[1] == next.tops[0]
        };
        let whole = before.len() == column.len()
            && rise == 0.0
            && before
                .iter()
                .zip(&column)
                .all(|(last, next)| continues(last, next));
        if whole {
            let known = all.len() - column.len();
            for slab in &mut all[known..] {
                slab.x[1] = x[1];
            }
            before = all[known..].to_vec();
        } else {
            all.extend(&column);
            before = column;
        }
    }
    all
}

fn furniture(index: usize, wall: &Straight<'_>, slabs: &[Slab]) -> FurnitureEntry {
    let entry = wall.entry;
    let yaw = exact::atan2(wall.along[1], wall.along[0]);
    let half = entry.thickness / 2.0;
    let mut parts = Vec::new();
    for slab in slabs {
        if entry.material_left == entry.material_right {
            parts.push(visible(slab, [-half, half], &entry.material_left));
        } else {
            parts.push(visible(slab, [0.0, half], &entry.material_left));
            parts.push(visible(slab, [-half, 0.0], &entry.material_right));
        }
    }
    FurnitureEntry {
        name: format!("wall_{index}"),
        category: CATEGORY.to_owned(),
        at: [entry.from[0], entry.from[1], 0.0],
        yaw_deg: yaw.to_degrees(),
        parts,
        collision: Some(slabs.iter().map(|slab| colliding(slab, half)).collect()),
        ..FurnitureEntry::default()
    }
}

/// A rendered slab from `y[0]` to `y[1]` across the wall.
fn visible(slab: &Slab, y: [f64; 2], material: &str) -> PartEntry {
    let material = Some(material.to_owned());
    if slab.tops[0] == slab.tops[1] {
        return PartEntry {
            material,
            ..cuboid(slab, y)
        };
    }
    PartEntry {
        prism: Some(PrismEntry {
            outline: vec![
                [slab.x[0], slab.base],
                [slab.x[1], slab.base],
                [slab.x[1], slab.tops[1]],
                [slab.x[0], slab.tops[0]],
            ],
            height: y[1] - y[0],
        }),
        // Turned about x: y of the outline points up, its thickness towards -y.
        rpy_deg: Some([90.0, 0.0, 0.0]),
        at: Some([0.0, y[1], 0.0]),
        material,
        ..PartEntry::default()
    }
}

fn colliding(slab: &Slab, half: f64) -> PartEntry {
    if slab.tops[0] == slab.tops[1] {
        return cuboid(slab, [-half, half]);
    }
    let corners = [-half, half].into_iter().flat_map(|y| {
        [0, 1]
            .into_iter()
            .flat_map(move |end| [slab.base, slab.tops[end]].map(|z| [slab.x[end], y, z]))
    });
    PartEntry {
        hull: Some(corners.collect()),
        ..PartEntry::default()
    }
}

fn cuboid(slab: &Slab, y: [f64; 2]) -> PartEntry {
    let (x, z) = (slab.x, [slab.base, slab.tops[0]]);
    PartEntry {
        cuboid: Some([x[1] - x[0], y[1] - y[0], z[1] - z[0]]),
        at: Some([
            (x[0] + x[1]) / 2.0,
            (y[0] + y[1]) / 2.0,
            (z[0] + z[1]) / 2.0,
        ]),
        ..PartEntry::default()
    }
}
