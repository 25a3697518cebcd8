//! Pieces as kinds: rendered meshes, collision shapes, surfaces, leaves on joints.

use std::collections::BTreeMap;
use std::rc::Rc;

use wheelarm_pack::{
    Family, GraspEntry, JointEntry, KindFile, MeshEntry, MeshScale, PartEntry, SurfaceEntry,
};

use crate::archive::Archive;
use crate::build::{Joints, rounded, rounded2, rounded3};
use crate::error::{ImportError, ModelError};
use crate::fit::{Fitted, METRES, bounds, fit};
use crate::glb::{self, Corner};
use crate::joints::{Joint, JointKind, extent, is_mirror, is_pane, joints};
use crate::model::{self, Model};
use crate::paint::{Paints, family_of};
use crate::raster::Point3;
use crate::rooms::Names;
use crate::sh3d::{Piece, PieceKind, Rgb};
use crate::simplify;
use crate::solid::{Solid, solids};
use crate::surfaces::{Surface, surfaces};
use crate::words::{self, Category};

/// Heights between which surfaces are measured, metres above the floor.
const SURFACES: (f64, f64) = (0.30, 1.30);
/// What hangs higher collides with nothing, metres.
const OVERHEAD: f64 = 2.0;
/// What lies on the floor and is thinner is driven over, metres.
const FLAT: f64 = 0.025;
/// Coulomb coefficient of furniture.
const FRICTION: f64 = 0.5;
/// Largest opening of a leaf, degrees.
const OPENING_DEG: f64 = 100.0;
/// Least number of triangles of a leaf.
const LEAST_LEAF: usize = 8;
/// Largest extent of a pin of a drawer across its axis is not checked; leaves are larger than
/// this along their hinge, metres.
const LEAST_SIDE: f64 = 0.10;

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
    names: Names,
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
        let solids = collision(piece, category, passage, model, &fitted, &carcass);
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
            let entry = leaf_kind(joint, model, &fitted, parts);
            self.kinds.insert(leaf.clone(), entry);
            let at = rounded3(origin(joint, model, &fitted));
            leaves.push(Leaf {
                kind: leaf,
                word,
                at,
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

/// A rendered part that is not stored yet.
struct Part {
    entry: PartEntry,
    bytes: Vec<u8>,
    triangles: usize,
}

/// Divides triangles by their materials.
struct Painter<'a> {
    paints: &'a mut Paints,
    archive: &'a mut Archive,
    model: &'a Model,
    fitted: &'a Fitted,
    piece: &'a Piece,
    passage: Passage,
}

/// What a triangle is made of.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Surfacing {
    Material(u32),
    Pane,
    Mirror,
}

impl Painter<'_> {
    /// The parts of some triangles, relative to `origin`, one for each material.
    fn parts(&mut self, triangles: &[usize], origin: Point3) -> Result<Vec<Part>, ImportError> {
        let mut by: BTreeMap<Surfacing, Vec<usize>> = BTreeMap::new();
        for &index in triangles {
            let triangle = &self.model.triangles[index];
            let group = &self.model.groups[triangle.group as usize];
            let of = if is_pane(group) {
                Surfacing::Pane
            } else if is_mirror(group) {
                Surfacing::Mirror
            } else {
                Surfacing::Material(triangle.material)
            };
            by.entry(of).or_default().push(index);
        }
        let mut by_name: BTreeMap<(String, bool), Vec<usize>> = BTreeMap::new();
        let mut order: Vec<(String, bool)> = Vec::new();
        for (of, indices) in by {
            let key = match of {
                Surfacing::Pane if self.passage == Passage::None => (self.paints.glass(), false),
                Surfacing::Pane => (self.paints.pane(), false),
                Surfacing::Mirror => (self.paints.mirror(), false),
                Surfacing::Material(material) => self.material(material as usize)?,
            };
            if !by_name.contains_key(&key) {
                order.push(key.clone());
            }
            by_name.entry(key).or_default().extend(indices);
        }
        let mut parts = Vec::new();
        for key in order {
            let indices = &by_name[&key];
            let part = self.mesh(indices, origin, key.1);
            if part.is_empty() {
                continue;
            }
            parts.push(Part {
                triangles: part.len(),
                bytes: glb::write(&part),
                entry: PartEntry {
                    material: Some(key.0),
                    collide: Some(false),
                    ..PartEntry::default()
                },
            });
        }
        Ok(parts)
    }

    fn mesh(&self, indices: &[usize], origin: Point3, mapped: bool) -> Vec<[Corner; 3]> {
        let mut triangles: Vec<[Corner; 3]> = Vec::with_capacity(indices.len());
        for &index in indices {
            let points = corners(self.model, self.fitted, index);
            let uvs = self.model.triangles[index].uvs.filter(|_| mapped);
            let mut triangle = [0, 1, 2].map(|k| {
                let point = [0, 1, 2].map(|axis| points[k][axis] - origin[axis]);
                (point, uvs.map(|uvs| uvs[k]))
            });
            if self.piece.mirrored {
                triangle.swap(1, 2);
            }
            triangles.push(triangle);
            if self.piece.back_face_shown {
                let [a, b, c] = triangle;
                triangles.push([a, c, b]);
            }
        }
        let size = [0, 1, 2].map(|axis| self.fitted.high[axis] - self.fitted.low[axis]);
        simplify::simplify(triangles, size[0].max(size[1]).max(size[2]))
    }

    /// The material of a part, and whether the mesh's texture coordinates count.
    fn material(&mut self, index: usize) -> Result<(String, bool), ImportError> {
        let material = &self.model.materials[index];
        let change = self
            .piece
            .materials
            .iter()
            .find(|change| change.name == material.name);
        let family = family_of(&material.name);
        let shininess = change
            .and_then(|change| change.shininess)
            .or(self.piece.shininess)
            .unwrap_or(material.shininess);
        let base = if family == Some(Family::Metal) {
            0.35
        } else {
            0.65
        };
        let roughness = (base - 0.4 * shininess).max(0.1);
        let texture = match change {
            Some(change) if change.texture.is_some() => change.texture.clone(),
            Some(change) if change.colour.is_some() => None,
            _ => self.piece.texture.clone(),
        };
        if let Some(texture) = texture {
            let image = self
                .paints
                .image(self.archive, &texture, family, roughness, None)?;
            if let Some(name) = image {
                return Ok((name, false));
            }
        }
        let own = change
            .and_then(|change| change.colour)
            .or(self.piece.colour);
        if let (None, Some(path)) = (own, &material.image) {
            let texture = crate::sh3d::Texture {
                image: path.clone(),
                width: 100.0,
                height: 100.0,
            };
            let image = self
                .paints
                .image(self.archive, &texture, family, roughness, Some(1.0))?;
            if let Some(name) = image {
                return Ok((name, true));
            }
        }
        let colour: Rgb = own.unwrap_or(material.colour);
        if material.transparency > 0.5 {
            return Ok((self.paints.glass(), false));
        }
        let is_shade = self.piece.kind == PieceKind::Light
            && colour.iter().all(|&c| c > 150)
            && family != Some(Family::Metal);
        if is_shade {
            return Ok((self.paints.shade(colour), false));
        }
        Ok((self.paints.colour(colour, family, roughness), false))
    }
}

fn corners(model: &Model, fitted: &Fitted, index: usize) -> [Point3; 3] {
    model.triangles[index]
        .corners
        .map(|c| fitted.points[c as usize])
}

/// Whether a leaf is worth a joint: an upright or level hinge across the front, or a rail
/// that leads to the front.
fn is_useful(joint: &Joint, model: &Model, fitted: &Fitted) -> bool {
    let (low, high) = extent(model, fitted, &joint.leaf);
    let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    let is_large = size[1] > LEAST_SIDE && size[2] > 0.05;
    let is_thin = size[0] < size[1];
    let turns = joint.kind == JointKind::Hinge && joint.axis != 0 && is_thin;
    let slides = joint.kind == JointKind::Rail && joint.axis == 0;
    joint.leaf.len() >= LEAST_LEAF && is_large && (turns || slides)
}

/// Origin of a leaf in the frame of its carrier: on the axis of a hinge, at the leaf's foot.
fn origin(joint: &Joint, model: &Model, fitted: &Fitted) -> Point3 {
    let (low, high) = extent(model, fitted, &joint.leaf);
    match (joint.kind, joint.axis) {
        (JointKind::Hinge, 2) => [joint.at[0], joint.at[1], low[2]],
        (JointKind::Hinge, _) => [joint.at[0], 0.5 * (low[1] + high[1]), joint.at[2]],
        (JointKind::Rail, _) => [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]],
    }
}

/// The kind of a leaf: its joint, a box for the leaf and one for its handle, grasps.
fn leaf_kind(joint: &Joint, model: &Model, fitted: &Fitted, parts: Vec<Part>) -> KindFile {
    let o = origin(joint, model, fitted);
    let relative = |p: Point3| [0, 1, 2].map(|axis| p[axis] - o[axis]);
    let panel: Vec<usize> = joint
        .leaf
        .iter()
        .copied()
        .filter(|index| joint.handle.binary_search(index).is_err())
        .collect();
    let panel = if panel.is_empty() {
        &joint.leaf
    } else {
        &panel
    };
    let (low, high) = extent(model, fitted, panel);
    let (low, high) = (relative(low), relative(high));
    let mut shapes = Vec::new();
    match joint.kind {
        JointKind::Hinge => {
            // Two millimetres less on each side: the leaf moves past its frame.
            let gap = 0.002;
            shapes.push(Solid::cuboid(
                [low[0], low[1] + gap, low[2] + gap],
                [high[0], high[1] - gap, high[2] - gap],
            ));
        }
        JointKind::Rail => {
            let front = (high[0] - 0.02).max(low[0]);
            let gap = 0.002;
            shapes.push(Solid::cuboid(
                [front, low[1] + gap, low[2] + gap],
                [high[0], high[1] - gap, high[2] - gap],
            ));
        }
    }
    let size = [0, 1, 2].map(|axis| (high[axis] - low[axis]).max(0.015));
    let com = [0, 1, 2].map(|axis| 0.5 * (low[axis] + high[axis]));
    let volume = size[0] * size[1] * size[2];
    let mut grasps = Vec::new();
    if !joint.handle.is_empty() {
        let (low, high) = extent(model, fitted, &joint.handle);
        let (low, high) = (relative(low), relative(high));
        shapes.push(Solid::cuboid(low, high));
        grasps = handle_grasps(low, high);
    }
    let (axis, mass, friction, damping) = match joint.kind {
        JointKind::Hinge => {
            let axis = if joint.axis == 2 {
                // The free edge moves to the front.
                [0.0, 0.0, if com[1] > 0.0 { -1.0 } else { 1.0 }]
            } else {
                [0.0, if com[2] > 0.0 { 1.0 } else { -1.0 }, 0.0]
            };
            (axis, (250.0 * volume).clamp(1.5, 20.0), 1.0, 0.5)
        }
        JointKind::Rail => ([1.0, 0.0, 0.0], 2.5, 5.0, 10.0),
    };
    let square = |axis: usize| size[axis] * size[axis];
    // The smallest eigenvalues of thin plates are raised: rounding must keep
    // Ixx + Iyy >= Izz in every order.
    let inertia = [(1, 2), (0, 2), (0, 1)].map(|(a, b)| {
        let whole = mass / 12.0 * (square(a) + square(b)) + 1.0e-4;
        (whole * 1.0e6).round() / 1.0e6
    });
    let slides = joint.kind == JointKind::Rail;
    KindFile {
        category: if slides {
            "drawer".into()
        } else {
            "door".into()
        },
        friction: Some(FRICTION),
        parts: parts.into_iter().map(|part| part.entry).collect(),
        collision: Some(shapes.iter().map(shape).collect()),
        joint: Some(JointEntry {
            turns: !slides,
            axis,
            travel: slides.then(|| rounded((0.8 * size[0]).clamp(0.05, 0.40))),
            travel_deg: (!slides).then_some(OPENING_DEG),
            mass: rounded(mass),
            com: rounded3(com),
            inertia,
            friction,
            damping,
        }),
        grasps,
        ..KindFile::default()
    }
}

/// Grasps of a handle from the front, across its thin sides.
fn handle_grasps(low: Point3, high: Point3) -> Vec<GraspEntry> {
    let middle = [0, 1, 2].map(|axis| 0.5 * (low[axis] + high[axis]));
    let mut grasps = Vec::new();
    for (name, axis) in [("across", 1), ("along", 2)] {
        let width = (high[axis] - low[axis]).max(0.012);
        if width >= 0.075 {
            continue;
        }
        let mut closing = [0.0; 3];
        closing[axis] = 1.0;
        grasps.push(GraspEntry {
            name: format!("handle_{name}"),
            point: rounded3([middle[0] + 0.028, middle[1], middle[2]]),
            approach: [-1.0, 0.0, 0.0],
            closing,
            width: rounded(width),
            symmetric: false,
            force: None,
            from_above: false,
        });
    }
    grasps
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

/// Whether shapes stand in the middle half of a passage.
fn blocks(solids: &[Solid], left: f64, right: f64) -> bool {
    let quarter = 0.25 * (right - left);
    solids.iter().any(|solid| {
        let (low, high) = crate::polygon::bounds(&solid.outline);
        let in_height = solid.low < 1.2 && solid.high > 0.15;
        in_height && low[1] < right - quarter && high[1] > left + quarter
    })
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

/// A measured rectangle as an entry, approached from the front.
fn surface(index: usize, surface: &Surface) -> SurfaceEntry {
    let (low, high) = (surface.low, surface.high);
    SurfaceEntry {
        name: if index == 0 {
            "top".into()
        } else {
            format!("level_{index}")
        },
        edge: rounded3([high[0], 0.5 * (low[1] + high[1]), surface.height]),
        inwards_deg: 180.0,
        depth: rounded(high[0] - low[0]),
        width: rounded(high[1] - low[1]),
    }
}
