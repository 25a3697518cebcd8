//! Pieces as kinds: rendered meshes, collision shapes, surfaces, leaves on joints.

use std::collections::BTreeMap;
use std::rc::Rc;

use wheelarm_pack::{KindFile, MeshEntry, MeshScale, PartEntry, SurfaceEntry};

use crate::archive::Archive;
use crate::build::leaves::{is_useful, leaf_kind, origin};
use crate::build::painter::{Painter, Part};
use crate::build::{Joints, rounded, rounded2, rounded3};
use crate::error::{ImportError, ModelError};
use crate::fit::{Fitted, METRES, bounds, fit};
use crate::joints::{JointKind, joints};
use crate::model::{self, Model};
use crate::paint::Paints;
use crate::raster::Point3;
use crate::rooms::Names;
use crate::sh3d::{Piece, PieceKind};
use crate::solid::{Solid, solids};
use crate::surfaces::{Surface, surfaces};
use crate::words::{self, Category};

/// Heights between which surfaces are measured, metres above the floor.
const SURFACES: (f64, f64) = (0.30, 1.30);
/// What hangs higher collides with nothing, metres.
const OVERHEAD: f64 = 2.0;
/// A piece on the floor that is thinner is driven over, metres.
const FLAT: f64 = 0.025;
/// Height up to which the lower part of a frame is a sill, metres.
const SILL: f64 = 0.15;
/// Coulomb coefficient of furniture.
pub(super) const FRICTION: f64 = 0.5;
/// What is done with a door of a room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// No door or window.
    None,
    /// A passage between rooms: its leaves are taken out.
    Open,
    /// A door or window that stays closed.
    Closed,
}

/// A leaf of a kind: its own kind at a pose in the frame of its carrier.
#[derive(Clone, Debug)]
pub struct Leaf {
    /// Name of its kind.
    pub kind: String,
    /// Word: `door` or `drawer`.
    pub word: &'static str,
    /// Origin in the frame of the carrier, metres.
    pub at: Point3,
    /// Collision shapes in its own frame.
    pub solids: Vec<Solid>,
}

/// A finished kind.
#[derive(Clone, Debug)]
pub struct Built {
    /// Name of its file.
    pub kind: String,
    /// Collision shapes of the kind without its leaves.
    pub solids: Vec<Solid>,
    /// Leaves on joints.
    pub leaves: Vec<Leaf>,
    /// Whether a passage cannot be opened: its model has no leaf that can be taken out.
    pub is_blocked: bool,
}

/// The kinds of a pack so far.
pub struct Kinds<'a> {
    archive: &'a mut Archive,
    models: BTreeMap<String, Result<Rc<Model>, ModelError>>,
    built: BTreeMap<String, Rc<Built>>,
    /// Names of kinds.
    pub names: Names,
    /// Files by name.
    pub kinds: BTreeMap<String, KindFile>,
    /// Meshes by path.
    pub meshes: BTreeMap<String, Vec<u8>>,
    /// Paths of meshes by their content.
    contents: BTreeMap<[u8; 32], String>,
    /// Rendered triangles of each kind.
    pub triangles: BTreeMap<String, usize>,
    joints: Joints,
}

impl<'a> Kinds<'a> {
    /// No kinds yet.
    pub fn new(archive: &'a mut Archive, joints: Joints) -> Self {
        Self {
            archive,
            models: BTreeMap::new(),
            built: BTreeMap::new(),
            names: Names::default(),
            kinds: BTreeMap::new(),
            meshes: BTreeMap::new(),
            contents: BTreeMap::new(),
            triangles: BTreeMap::new(),
            joints,
        }
    }

    /// The kind of a piece.
    ///
    /// # Errors
    /// The inner error concerns the model alone; the outer one the archive.
    pub fn of(
        &mut self,
        paints: &mut Paints,
        piece: &Piece,
        category: Category,
        passage: Passage,
    ) -> Result<Result<Rc<Built>, ModelError>, ImportError> {
        let Some(path) = piece.model.as_deref() else {
            return Ok(Err(ModelError::Missing(String::from("file"))));
        };
        // Everything that the kind depends on; surfaces depend on the height of the foot.
        let key = format!(
            "{path:?} {:?} {:?} {} {:?} {:?} {:?} {:?} {:?} {:?} {} {:?} {passage:?} {:?} {}",
            piece.size,
            piece.rotation,
            piece.mirrored,
            piece.pitch,
            piece.roll,
            piece.colour,
            piece.texture,
            piece.shininess,
            piece.materials,
            piece.back_face_shown,
            piece.elevation,
            piece.kind,
            category.word,
        );
        if let Some(built) = self.built.get(&key) {
            return Ok(Ok(Rc::clone(built)));
        }
        let model = match self.models.get(path) {
            Some(known) => known.clone(),
            None => {
                let read = model::read(self.archive, path)?.map(Rc::new);
                self.models.insert(path.to_owned(), read.clone());
                read
            }
        };
        let model = match model {
            Ok(model) => model,
            Err(error) => return Ok(Err(error)),
        };
        let built = Rc::new(self.build(paints, piece, category, passage, &model)?);
        self.built.insert(key, Rc::clone(&built));
        Ok(Ok(built))
    }

    fn build(
        &mut self,
        paints: &mut Paints,
        piece: &Piece,
        category: Category,
        passage: Passage,
        model: &Model,
    ) -> Result<Built, ImportError> {
        let fitted = fit(model, piece);
        let id = piece.catalogue.split_once('#').map_or("", |(_, id)| id);
        let is_shape = id.starts_with("texturable") || id.is_empty();
        let base = match is_shape {
            true if category.word == words::OTHER.word => words::slug(&piece.name, 40),
            true => category.word.to_owned(),
            false => words::slug(&words::split_camel(id), 40),
        };
        let name = self.names.give(&base, category.word);
        let found = match (passage, self.joints) {
            (Passage::Open, _) => joints(model, &fitted),
            (Passage::None, Joints::All) if piece.kind == PieceKind::Furniture => {
                let all = joints(model, &fitted).into_iter();
                all.filter(|joint| is_useful(joint, model, &fitted))
                    .collect()
            }
            _ => Vec::new(),
        };
        let mut moves = vec![false; model.triangles.len()];
        for joint in &found {
            for &index in &joint.leaf {
                moves[index] = true;
            }
        }
        let carcass: Vec<usize> = (0..moves.len()).filter(|&index| !moves[index]).collect();
        let mut painter = Painter {
            paints,
            archive: self.archive,
            model,
            fitted: &fitted,
            piece,
            passage,
        };
        let mut parts = painter.parts(&carcass, [0.0; 3])?;
        let mut leaf_parts = Vec::new();
        if passage == Passage::None {
            for joint in &found {
                let origin = origin(joint, model, &fitted);
                leaf_parts.push(painter.parts(&joint.leaf, origin)?);
            }
        }
        let triangles = self.store(&name, &mut parts);
        let mut solids = collision(piece, category, passage, model, &fitted, &carcass);
        if passage == Passage::Open {
            take_sill_out(&mut solids, &fitted);
        }
        let corners: Vec<[Point3; 3]> = carcass
            .iter()
            .map(|&i| corners(model, &fitted, i))
            .collect();
        let foot = piece.elevation * METRES;
        let measured = if passage == Passage::None && category.carries {
            surfaces(&corners, &solids, SURFACES.0 - foot, SURFACES.1 - foot)
        } else {
            Vec::new()
        };
        let is_blocked = passage == Passage::Open && blocks(&solids, fitted.low[1], fitted.high[1]);
        self.triangles.insert(name.clone(), triangles);
        self.kinds.insert(
            name.clone(),
            KindFile {
                category: category.word.to_owned(),
                friction: Some(FRICTION),
                parts: parts.into_iter().map(|part| part.entry).collect(),
                collision: Some(solids.iter().map(shape).collect()),
                surfaces: measured
                    .iter()
                    .enumerate()
                    .map(|(i, s)| surface(i, s))
                    .collect(),
                ..KindFile::default()
            },
        );
        let mut leaves = Vec::new();
        for (joint, mut parts) in found.iter().zip(leaf_parts) {
            let word = if joint.kind == JointKind::Hinge {
                "door"
            } else {
                "drawer"
            };
            let leaf = self
                .names
                .give(&format!("{name}_{word}_{}", joint.number), word);
            let triangles = self.store(&leaf, &mut parts);
            self.triangles.insert(leaf.clone(), triangles);
            let (entry, solids) = leaf_kind(joint, model, &fitted, parts);
            self.kinds.insert(leaf.clone(), entry);
            let at = rounded3(origin(joint, model, &fitted));
            leaves.push(Leaf {
                kind: leaf,
                word,
                at,
                solids,
            });
        }
        Ok(Built {
            kind: name,
            solids,
            leaves,
            is_blocked,
        })
    }

    /// Stores the meshes of parts; equal ones once. Returns the number of triangles.
    fn store(&mut self, name: &str, parts: &mut [Part]) -> usize {
        let mut sum = 0;
        for (number, part) in parts.iter_mut().enumerate() {
            sum += part.triangles;
            let hash = *blake3::hash(&part.bytes).as_bytes();
            let path = self.contents.entry(hash).or_insert_with(|| {
                let path = format!("meshes/{name}_{number}.glb");
                self.meshes
                    .insert(path.clone(), std::mem::take(&mut part.bytes));
                path
            });
            part.entry.mesh = Some(MeshEntry {
                path: path.clone(),
                scale: MeshScale::default(),
            });
        }
        sum
    }
}

pub(super) fn corners(model: &Model, fitted: &Fitted, index: usize) -> [Point3; 3] {
    model.triangles[index]
        .corners
        .map(|c| fitted.points[c as usize])
}

/// The collision shapes of a piece.
fn collision(
    piece: &Piece,
    category: Category,
    passage: Passage,
    model: &Model,
    fitted: &Fitted,
    carcass: &[usize],
) -> Vec<Solid> {
    let foot = piece.elevation * METRES;
    let size = [0, 1, 2].map(|axis| fitted.high[axis] - fitted.low[axis]);
    let is_flat = size[2] < FLAT && foot < FLAT;
    if is_flat || foot > OVERHEAD || category.word == "rug" {
        return Vec::new();
    }
    if passage == Passage::Closed {
        // A plate across the opening; frames and handles are thinner than the wall.
        let middle = 0.5 * (fitted.low[0] + fitted.high[0]);
        let half = (0.5 * size[0]).min(0.03);
        let at = |x: f64, from: Point3| [x, from[1], from[2]];
        return vec![Solid::cuboid(
            at(middle - half, fitted.low),
            at(middle + half, fitted.high),
        )];
    }
    let is_small = size[0].max(size[1]) < 0.30 && size[2] < 0.60 && passage == Passage::None;
    if is_small {
        let used: Vec<Point3> = carcass
            .iter()
            .flat_map(|&i| corners(model, fitted, i))
            .collect();
        let (low, high) = bounds(&used);
        return vec![Solid::cuboid(low, high)];
    }
    let triangles: Vec<[u32; 3]> = carcass
        .iter()
        .map(|&i| model.triangles[i].corners)
        .collect();
    solids(&fitted.points, &triangles)
}

/// Takes the lower part of a frame out of the collision shapes of a passage: French windows of
/// catalogs have one of 6 cm, which no wheelchair gets over.
fn take_sill_out(solids: &mut Vec<Solid>, fitted: &Fitted) {
    let (left, right) = (fitted.low[1], fitted.high[1]);
    solids.retain(|solid| solid.high > SILL || !is_across(solid, left, right));
}

/// Whether a shape is in the middle half of a passage.
fn is_across(solid: &Solid, left: f64, right: f64) -> bool {
    let quarter = 0.25 * (right - left);
    let (low, high) = crate::polygon::bounds(&solid.outline);
    low[1] < right - quarter && high[1] > left + quarter
}

/// Whether shapes are in the middle half of a passage.
fn blocks(solids: &[Solid], left: f64, right: f64) -> bool {
    let mut in_height = solids.iter().filter(|s| s.low < 1.2 && s.high > SILL);
    in_height.any(|solid| is_across(solid, left, right))
}

/// A collision shape as an entry: a box when it is one, otherwise a hull.
pub(super) fn shape(solid: &Solid) -> PartEntry {
    if let Some((middle, size)) = solid.as_box() {
        return PartEntry {
            cuboid: Some(rounded3(size)),
            at: Some(rounded3(middle)),
            ..PartEntry::default()
        };
    }
    let mut hull = Vec::new();
    for height in [solid.low, solid.high] {
        for &corner in &solid.outline {
            let [x, y] = rounded2(corner);
            hull.push([x, y, rounded(height)]);
        }
    }
    PartEntry {
        hull: Some(hull),
        ..PartEntry::default()
    }
}

/// Name of a surface within its kind.
pub(super) fn surface_name(index: usize) -> String {
    match index {
        0 => "top".into(),
        index => format!("level_{index}"),
    }
}

/// A measured rectangle as an entry, approached from the front.
fn surface(index: usize, surface: &Surface) -> SurfaceEntry {
    let (low, high) = (surface.low, surface.high);
    SurfaceEntry {
        name: surface_name(index),
        edge: rounded3([high[0], 0.5 * (low[1] + high[1]), surface.height]),
        inwards_deg: 180.0,
        depth: rounded(high[0] - low[0]),
        width: rounded(high[1] - low[1]),
    }
}
