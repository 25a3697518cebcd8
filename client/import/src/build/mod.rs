//! Assembles a pack from a home: kinds, rooms, walls, pieces, start, camera, sources.

mod clear;
mod house;
mod kinds;
mod leaves;
mod painter;
mod plates;
mod sources;
mod start;
mod stuck;

use std::collections::BTreeMap;

use wheelarm_pack::{HomeFile, KindFile, LightEntry, MaterialFile, Pack, PieceEntry};
use wheelarm_proto::exact;

use crate::archive::Archive;
use crate::error::ImportError;
use crate::fit::METRES;
use crate::paint::Paints;
use crate::place::Obstacle;
use crate::plan::{self, Plan};
use crate::polygon::{self, Point};
use crate::raster::Point3;
use crate::rooms::{self, Names, PlanRoom};
use crate::sh3d::{Home, Piece, PieceKind};
use crate::words::{self, Category};
use clear::{Shape, clear_surfaces};
use kinds::{Built, Kinds, Passage};
use sources::{license, manifest, origin};
use start::{start_and_camera, wall_obstacles};
use stuck::fix_stuck_leaves;

/// Largest coordinate of a piece, metres: that of packs less a margin.
const FARTHEST: f64 = 49.0;
/// Height below which pieces obstruct a chair with an arm, metres.
const BODY: f64 = 1.5;

/// Which leaves become joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Joints {
    /// Doors and drawers of furniture.
    #[default]
    All,
    /// None: furniture stays closed.
    None,
}

/// Options of an import.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name of the pack and of its scene.
    pub name: String,
    /// Level: name or number from the lowest, 1 being the first.
    pub level: Option<String>,
    /// Kinds of furniture that are left out, for example `chairs`.
    pub without: Vec<String>,
    /// Leaves that become joints.
    pub joints: Joints,
    /// License when the file names none.
    pub license: Option<String>,
}

/// A piece that is not in the pack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Its name in the file.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// What an import did.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Name of the level; empty for a home without levels.
    pub level: String,
    /// Other levels.
    pub other_levels: Vec<String>,
    /// Number of rooms inside.
    pub rooms: usize,
    /// Number of rooms outside.
    pub outside: usize,
    /// Number of walls.
    pub walls: usize,
    /// Number of openings that the chair can pass, and of closed doors and windows.
    pub passages: usize,
    /// Closed doors and windows.
    pub closed: usize,
    /// Number of pieces in the file.
    pub found: usize,
    /// Number of pieces of the file in the pack.
    pub placed: usize,
    /// Number of leaves on hinges, and of drawers.
    pub hinges: usize,
    /// Drawers.
    pub rails: usize,
    /// Number of surfaces that carry objects.
    pub surfaces: usize,
    /// Number of rendered triangles of all pieces.
    pub triangles: usize,
    /// Number of collision shapes of all pieces.
    pub shapes: usize,
    /// Pieces that are not in the pack.
    pub left_out: Vec<LeftOut>,
    /// Warnings, each with its fix.
    pub notes: Vec<String>,
}

/// A finished import.
#[derive(Debug)]
pub struct Imported {
    /// The pack.
    pub pack: Pack,
    /// What was done.
    pub summary: Summary,
}

/// Imports a home.
///
/// # Errors
/// When the home has no such level, no walls or no rooms, or exceeds a limit of packs.
pub fn assemble(
    file: &str,
    home: &Home,
    archive: &mut Archive,
    options: &Options,
) -> Result<Imported, ImportError> {
    let plan = Plan::of(file, home, options.level.as_deref())?;
    let mut summary = Summary {
        level: plan.level_name().to_owned(),
        other_levels: other_levels(&plan),
        found: home.pieces.len(),
        ..Summary::default()
    };
    for (what, count) in &home.unread {
        let note = format!("{count} elements {what:?} are not read");
        summary.notes.push(note);
    }
    let walls = plan.walls();
    let rooms = rooms::rooms(&options.name, &plan, &walls, &mut summary.notes)?;
    let openings = plan::openings(&plan, &walls);
    let mut paints = Paints::default();
    let wall_entries = house::walls(&plan, &walls, &mut paints, archive)?;
    let room_entries = house::rooms(&plan, &rooms, &mut paints, archive)?;

    let mut placer = Placer {
        plan: &plan,
        rooms: &rooms,
        options,
        kinds: Kinds::new(archive, options.joints),
        paints: &mut paints,
        names: Names::default(),
        pieces: Vec::new(),
        shapes: Vec::new(),
        sources: BTreeMap::new(),
        summary: &mut summary,
    };
    // Taken by the floor and the ceiling of the pack.
    for name in ["floor", "ceiling", "baseboards"] {
        placer.names.give(name, name);
    }
    let mut opening_entries = Vec::new();
    for (index, piece) in home.pieces.iter().enumerate() {
        let of: Vec<&plan::Opening> = openings.iter().filter(|o| o.piece == index).collect();
        let passage = match piece.kind {
            PieceKind::DoorOrWindow => house::passage(&plan, piece, &of, &walls, &rooms),
            _ => Passage::None,
        };
        let name = placer.piece(piece, passage)?;
        let is_shown = piece.visible && plan.is_on(piece.level.as_deref());
        if is_shown && !of.is_empty() {
            match passage {
                Passage::Open => placer.summary.passages += 1,
                _ => placer.summary.closed += 1,
            }
        }
        let entries = of.iter().map(|o| house::opening(o, passage, name.clone()));
        opening_entries.extend(entries);
    }
    let Placer {
        kinds,
        mut pieces,
        mut shapes,
        mut sources,
        ..
    } = placer;
    let mut blocks: Vec<Obstacle> = shapes
        .iter()
        .filter(|shape| shape.low < BODY && shape.high > 0.03)
        .map(|shape| Obstacle {
            outline: shape.outline.clone(),
        })
        .collect();
    blocks.extend(wall_obstacles(&walls, &opening_entries));
    shapes.extend(walls.iter().map(|wall| Shape {
        outline: wall.outline().to_vec(),
        low: 0.0,
        high: wall.height.max(wall.end_height),
        piece: None,
    }));
    let Kinds {
        kinds: mut tables,
        mut triangles,
        mut names,
        meshes,
        ..
    } = kinds;
    let (mut former, stuck) = fix_stuck_leaves(
        &mut pieces,
        &mut tables,
        &mut triangles,
        &mut names,
        &shapes,
    );
    if !stuck.is_empty() {
        summary.notes.push(format!(
            "doors or drawers of {} stay closed: other furniture or a wall is drawn into them; move one of the two",
            stuck.join(", ")
        ));
    }
    former.extend(clear_surfaces(
        &mut pieces,
        &mut tables,
        &mut triangles,
        &mut names,
        &shapes,
    ));
    for (kind, former) in former {
        if let Some(source) = sources.get(&former).cloned() {
            sources.insert(kind, source);
        }
    }
    sources.retain(|kind, _| tables.contains_key(kind));
    plates::add_plates(&mut tables);
    let baseboards = house::baseboards(&plan, &walls, &opening_entries, &mut paints);
    if let Some(kind) = baseboards {
        tables.insert("baseboards".into(), kind);
        pieces.push(piece_entry("baseboards", "baseboards", [0.0; 3], 0.0));
    }
    let (start, camera) = start_and_camera(options, &plan, &rooms, &blocks, &shapes, &mut summary)?;
    let license = license(home, options, &mut summary);
    let origin = origin(file, home);
    let home_file = HomeFile {
        origin: origin.clone(),
        license: license.clone(),
        light: light(),
        room_camera: camera,
        start,
        room: room_entries,
        wall: wall_entries,
        opening: opening_entries,
        piece: pieces,
        object: Vec::new(),
        place: Vec::new(),
        handle: Vec::new(),
    };
    count(&home_file, &tables, &triangles, &mut summary);
    let manifest = manifest(options, home, &origin, &license, &sources, &mut summary);
    summary.rooms = rooms.iter().filter(|room| !room.is_outside).count();
    summary.outside = rooms.len() - summary.rooms;
    summary.walls = walls.len();
    summary.notes.append(&mut paints.notes);
    let mut files = meshes;
    for (name, png) in paints.textures {
        files.insert(format!("textures/{name}.png"), png);
    }
    let materials = MaterialFile {
        origin,
        license,
        material: paints.materials,
    };
    let text = toml::to_string(&materials).map_err(|error| unwritable("materials", &error))?;
    files.insert("materials/home.toml".into(), text.into_bytes());
    let pack = Pack::from_tables(&manifest, Some(&home_file), &tables, files)
        .map_err(|error| unwritable(&options.name, &error))?;
    Ok(Imported { pack, summary })
}

fn unwritable(path: &str, error: &dyn std::fmt::Display) -> ImportError {
    ImportError::Unwritable {
        path: path.to_owned(),
        reason: error.to_string(),
    }
}

/// Places pieces.
struct Placer<'a, 'b, 'k> {
    plan: &'a Plan<'b>,
    rooms: &'a [PlanRoom],
    options: &'a Options,
    kinds: Kinds<'k>,
    paints: &'a mut Paints,
    names: Names,
    pieces: Vec<PieceEntry>,
    shapes: Vec<Shape>,
    /// Author and license of each kind.
    sources: BTreeMap<String, (String, Option<String>)>,
    summary: &'a mut Summary,
}

impl Placer<'_, '_, '_> {
    /// Places a piece, or notes why not. Returns its name.
    fn piece(&mut self, piece: &Piece, passage: Passage) -> Result<Option<String>, ImportError> {
        let category = match piece.kind {
            PieceKind::Furniture => words::category_of(&piece.catalogue, &piece.name),
            PieceKind::DoorOrWindow => words::of_opening(
                &piece.catalogue,
                &piece.name,
                passage != Passage::Open && piece.elevation > 20.0,
            ),
            PieceKind::Light => words::LAMP,
        };
        if let Some(reason) = self.reason_to_leave(piece, category, passage) {
            self.leave(piece, reason);
            return Ok(None);
        }
        let built = match self.kinds.of(self.paints, piece, category, passage)? {
            Ok(built) => built,
            Err(error) => {
                self.leave(piece, error.to_string());
                return Ok(None);
            }
        };
        if built.is_blocked {
            let reason = "its model has no leaf that can be taken out; the opening stays free";
            self.leave(piece, reason.into());
            return Ok(None);
        }
        Ok(Some(self.place(piece, category, &built)))
    }

    fn leave(&mut self, piece: &Piece, reason: String) {
        let name = if piece.name.is_empty() {
            "without a name"
        } else {
            &piece.name
        };
        self.summary.left_out.push(LeftOut {
            name: name.to_owned(),
            reason,
        });
    }

    fn reason_to_leave(
        &self,
        piece: &Piece,
        category: Category,
        passage: Passage,
    ) -> Option<String> {
        if !self.plan.is_on(piece.level.as_deref()) {
            return Some(match self.level_of(piece) {
                "" => "it is on no level".into(),
                level => format!("it is on level {level:?}"),
            });
        }
        let [x, y] = self.plan.place(piece.at);
        let far = [x, y, piece.elevation * METRES];
        if far.iter().any(|c| c.abs() > FARTHEST) {
            return Some(format!(
                "it is farther than {FARTHEST} m from the middle of the walls; move or delete it"
            ));
        }
        if !piece.visible {
            return Some("it is hidden in the file".into());
        }
        let mut without = self.options.without.iter();
        let word = without.find(|word| words::is_of(word, category.word, &piece.name));
        let word = word.filter(|_| passage == Passage::None)?;
        Some(format!("--without {word}"))
    }

    fn level_of(&self, piece: &Piece) -> &str {
        let id = piece.level.as_deref().unwrap_or_default();
        let mut levels = self.plan.home.levels.iter();
        levels
            .find(|level| level.id == id)
            .map_or("", |level| level.name.as_str())
    }

    fn place(&mut self, piece: &Piece, category: Category, built: &Built) -> String {
        let word = if category.word == words::OTHER.word {
            words::slug(&piece.name, 40)
        } else {
            category.word.to_owned()
        };
        // `wall_0`, `wall_1`, … are the walls.
        let word = if word.starts_with("wall") {
            "furniture"
        } else {
            &word
        };
        let name = self.names.give(word, "furniture");
        let [x, y] = self.plan.place(piece.at);
        let at = rounded3([x, y, piece.elevation * METRES]);
        let yaw_deg = yaw_deg(piece.angle);
        let (sin, cos) = exact::sin_cos(yaw_deg.to_radians());
        let turn = |p: Point| {
            [
                at[0] + cos * p[0] - sin * p[1],
                at[1] + sin * p[0] + cos * p[1],
            ]
        };
        let room = self.room_at([x, y]);
        let mut entry = piece_entry(&name, &built.kind, at, yaw_deg);
        entry.room = room.clone();
        self.pieces.push(entry);
        let index = Some(self.pieces.len() - 1);
        self.shapes.extend(built.solids.iter().map(|solid| Shape {
            outline: solid.outline.iter().map(|&p| turn(p)).collect(),
            low: solid.low + at[2],
            high: solid.high + at[2],
            piece: index,
        }));
        for leaf in &built.leaves {
            let [x, y] = turn([leaf.at[0], leaf.at[1]]);
            let at = rounded3([x, y, at[2] + leaf.at[2]]);
            let of_leaf = self.names.give(&format!("{name}_{}", leaf.word), leaf.word);
            let mut entry = piece_entry(&of_leaf, &leaf.kind, at, yaw_deg);
            entry.on = Some(name.clone());
            entry.room = room.clone();
            let index = Some(self.pieces.len());
            self.pieces.push(entry);
            let [x, y, z] = at;
            let turn = |p: Point| [x + cos * p[0] - sin * p[1], y + sin * p[0] + cos * p[1]];
            self.shapes.extend(leaf.solids.iter().map(|solid| Shape {
                outline: solid.outline.iter().map(|&p| turn(p)).collect(),
                low: solid.low + z,
                high: solid.high + z,
                piece: index,
            }));
        }
        let source = (
            piece.creator.clone().unwrap_or_default(),
            piece.license.clone(),
        );
        for kind in std::iter::once(&built.kind).chain(built.leaves.iter().map(|l| &l.kind)) {
            self.sources
                .entry(kind.clone())
                .or_insert_with(|| source.clone());
        }
        self.summary.placed += 1;
        name
    }

    fn room_at(&self, at: Point) -> Option<String> {
        let mut rooms = self.rooms.iter();
        let room = rooms.find(|room| polygon::contains(&room.outline, at));
        room.map(|room| room.name.clone())
    }
}

fn piece_entry(name: &str, kind: &str, at: Point3, yaw_deg: f64) -> PieceEntry {
    PieceEntry {
        name: name.to_owned(),
        kind: kind.to_owned(),
        at,
        yaw_deg,
        room: None,
        area: String::new(),
        scale: None,
        mirror: false,
        on: None,
        materials: BTreeMap::new(),
        optional: false,
    }
}

/// The rotation of a kind whose front is along x: clockwise in the file, where an unturned
/// piece has its front down the plan.
fn yaw_deg(angle: f64) -> f64 {
    let degrees = -90.0 - angle.to_degrees();
    let turns = (degrees / 360.0).round();
    let yaw = ((degrees - 360.0 * turns) * 1.0e4).round() / 1.0e4;
    // One name for the two ends of the range, and for both zeros.
    if yaw <= -180.0 { 180.0 } else { yaw + 0.0 }
}

fn other_levels(plan: &Plan<'_>) -> Vec<String> {
    let levels = plan.home.levels.iter().enumerate();
    levels
        .filter(|(index, _)| Some(*index) != plan.level)
        .map(|(_, level)| level.name.clone())
        .collect()
}

fn light() -> LightEntry {
    LightEntry {
        sun_direction: [0.45, -0.65, 0.80],
        sun: [1.10, 1.01, 0.85],
        sky: [0.62, 0.65, 0.70],
        ground: [0.56, 0.52, 0.47],
    }
}

/// Counts what the pieces consist of.
fn count(
    home: &HomeFile,
    kinds: &BTreeMap<String, KindFile>,
    triangles: &BTreeMap<String, usize>,
    summary: &mut Summary,
) {
    for piece in &home.piece {
        let Some(kind) = kinds.get(&piece.kind) else {
            continue;
        };
        summary.triangles += triangles.get(&piece.kind).copied().unwrap_or(0);
        summary.shapes += kind.collision.as_ref().map_or(0, Vec::len);
        summary.surfaces += kind.surfaces.len();
        match &kind.joint {
            Some(joint) if joint.turns => summary.hinges += 1,
            Some(_) => summary.rails += 1,
            None => {}
        }
    }
}

/// Rounds to a tenth of a millimetre; negative zero becomes zero.
fn rounded(value: f64) -> f64 {
    (value * 1.0e4).round() / 1.0e4 + 0.0
}

pub(crate) fn rounded2(point: Point) -> Point {
    point.map(rounded)
}

fn rounded3(point: Point3) -> Point3 {
    point.map(rounded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn piece_faces_down_the_plan_and_turns_clockwise() {
        assert_eq!(yaw_deg(0.0), -90.0);
        assert_eq!(yaw_deg(std::f64::consts::FRAC_PI_2), 180.0);
        assert_eq!(yaw_deg(std::f64::consts::PI), 90.0);
        assert_eq!(yaw_deg(-std::f64::consts::FRAC_PI_2), 0.0);
        assert_eq!(yaw_deg(20.0 * std::f64::consts::PI), -90.0);
    }
}
