//! A home of a world pack for the report: the furniture that the server collides with.

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};
use wheelarm_pack::{FurnitureEntry, GraspEntry, HomeFile, Pack, PackError, PartEntry};
use wheelarm_planning::footprint_check::{Pose2, wrap};
use wheelarm_planning::obb::Obb;
use wheelarm_proto::exact;
use wheelarm_proto::furniture::JointMotion;

use super::home::{Home, Leaf, Opening, OpeningKind, Owner, Piece, Room, Solid, Surface};

/// Why a pack has no report.
#[derive(Debug, thiserror::Error)]
pub enum NoHome {
    /// It has no home.
    #[error("pack {0} has no home.toml; a report is about a home: name another pack")]
    Missing(String),
    /// The home cannot be expanded.
    #[error(transparent)]
    Pack(#[from] PackError),
}

impl Home {
    /// The home of a pack.
    ///
    /// # Errors
    /// [`NoHome`] when the pack has none, or it is invalid.
    pub fn from_pack(pack: &Pack) -> Result<Self, NoHome> {
        let name = &pack.id().name;
        let file = pack.home().ok_or_else(|| NoHome::Missing(name.clone()))?;
        let furniture = pack.furniture()?;
        let mut home = Self {
            name: name.clone(),
            rooms: file.room.iter().map(room).collect(),
            openings: openings(file),
            start: Some(Pose2 {
                x: file.start.at[0],
                y: file.start.at[1],
                heading: wrap(file.start.yaw_deg.to_radians()),
            }),
            ..Self::default()
        };
        for entry in &furniture {
            let is_piece = file.piece.iter().any(|piece| piece.name == entry.name);
            let owner = match is_piece {
                true => Owner::Piece(home.pieces.len()),
                false => Owner::Building,
            };
            let pose = pose(entry.at, [0.0, 0.0, entry.yaw_deg]);
            let parts = entry.collision.as_ref().unwrap_or(&entry.parts);
            let collides = parts.iter().filter(|part| part.collide != Some(false));
            let placed: Vec<Obb> = collides.flat_map(boxes).map(|obb| obb.at(&pose)).collect();
            let solids = placed.iter().map(|obb| Solid::from_box(owner, obb));
            home.solids.extend(solids);
            if let Owner::Piece(piece) = owner {
                home.leaves
                    .extend(leaf((piece, &home.pieces), entry, pose, placed));
                let surfaces = entry.surfaces.iter();
                home.surfaces
                    .extend(surfaces.map(|surface| self::surface(piece, entry, surface)));
                home.pieces.push(Piece {
                    name: entry.name.clone(),
                    category: entry.category.clone(),
                });
            }
        }
        Ok(home)
    }
}

fn room(entry: &wheelarm_pack::RoomEntry) -> Room {
    Room {
        name: entry.name.clone(),
        kind: entry.kind.clone(),
        outline: entry.outline.clone(),
    }
}

fn openings(file: &HomeFile) -> Vec<Opening> {
    let opening = |entry: &wheelarm_pack::OpeningEntry| {
        let place = entry.doorway(file)?;
        Some(Opening {
            kind: match entry.kind {
                wheelarm_pack::OpeningKind::Door => OpeningKind::Door,
                wheelarm_pack::OpeningKind::Frame => OpeningKind::Frame,
                wheelarm_pack::OpeningKind::Window => OpeningKind::Window,
            },
            centre: place.centre,
            along: place.along,
            width: place.width,
            heights: [entry.sill, entry.sill + entry.height],
            thickness: place.thickness,
            closed: entry.leaf.is_some(),
        })
    };
    file.opening.iter().filter_map(opening).collect()
}

/// The leaf of an entry; `None` for what does not move.
fn leaf(
    (piece, others): (usize, &[Piece]),
    entry: &FurnitureEntry,
    rest: Isometry3<f64>,
    boxes: Vec<Obb>,
) -> Option<Leaf> {
    let hinge = entry.hinge.as_ref().map(|hinge| {
        let travel = hinge.travel_deg.to_radians();
        (JointMotion::Turns, &hinge.on, hinge.axis, travel)
    });
    let slide = entry.slide.as_ref();
    let slide = slide.map(|slide| (JointMotion::Slides, &slide.on, slide.axis, slide.travel));
    let (motion, on, axis, travel) = hinge.or(slide)?;
    let grasps = entry.grasps.iter();
    Some(Leaf {
        piece,
        carrier: others.iter().position(|other| other.name == *on),
        rest,
        motion,
        axis: Unit::try_new(rest.rotation * Vector3::from(axis), 1e-3)?,
        travel,
        grasps: grasps.map(|grasp| rest * hand(grasp)).collect(),
        boxes,
    })
}

/// Pose of the hand at a grasp, in the body: z approaches, x closes.
fn hand(grasp: &GraspEntry) -> Isometry3<f64> {
    let (z, x) = (Vector3::from(grasp.approach), Vector3::from(grasp.closing));
    let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::from(grasp.point), turn)
}

fn surface(piece: usize, entry: &FurnitureEntry, surface: &wheelarm_pack::SurfaceEntry) -> Surface {
    let yaw = wrap((entry.yaw_deg + surface.inwards_deg).to_radians());
    let edge = pose(entry.at, [0.0, 0.0, entry.yaw_deg]) * Point3::from(surface.edge);
    let (sin, cos) = exact::sin_cos(yaw);
    let half = surface.depth / 2.0;
    Surface {
        piece,
        name: surface.name.clone(),
        centre: [edge.x + cos * half, edge.y + sin * half],
        height: edge.z,
        yaw,
        size: [surface.depth, surface.width],
    }
}

/// A pose from a position and rotations about the fixed axes x, then y, then z, degrees.
fn pose(at: [f64; 3], rpy_deg: [f64; 3]) -> Isometry3<f64> {
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let about = |i: usize| UnitQuaternion::from_axis_angle(&axes[i], rpy_deg[i].to_radians());
    Isometry3::from_parts(Translation3::from(at), about(2) * about(1) * about(0))
}

/// Boxes around a colliding shape in its body, one for each of its places.
fn boxes(part: &PartEntry) -> Vec<Obb> {
    let Some((centre, half)) = bounds(part) else {
        return Vec::new();
    };
    let at = part.at.unwrap_or_default();
    let places = part.places.clone().unwrap_or_else(|| vec![at]);
    let rotation = part.rpy_deg.unwrap_or_default();
    let place = |at: [f64; 3]| Obb {
        pose: pose(at, rotation) * Translation3::from(centre),
        half,
        round: false,
    };
    places.into_iter().map(place).collect()
}

/// Middle and half extents of a shape in its own frame; `None` for those that only render.
fn bounds(part: &PartEntry) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let centred = |half: [f64; 3]| Some((Vector3::zeros(), Vector3::from(half)));
    let standing = |radius: f64, height: f64| {
        let half = height / 2.0;
        Some((Vector3::z() * half, Vector3::new(radius, radius, half)))
    };
    if let Some(size) = part.cuboid {
        return centred(size.map(|length| length / 2.0));
    }
    if let Some(rounded) = &part.rounded_box {
        return centred(rounded.size.map(|length| length / 2.0));
    }
    if let Some(round) = part.cylinder.as_ref().or(part.capsule.as_ref()) {
        return centred([round.radius, round.radius, round.height / 2.0]);
    }
    if let Some(sphere) = &part.sphere {
        return centred([sphere.radius; 3]);
    }
    if let Some(frustum) = &part.frustum {
        let radius = frustum.bottom_radius.max(frustum.top_radius);
        return centred([radius, radius, frustum.height / 2.0]);
    }
    if let Some(cup) = &part.cup {
        return standing(cup.bottom_radius.max(cup.top_radius), cup.height);
    }
    let points = part.hull.as_ref().filter(|points| !points.is_empty())?;
    let fold = |pick: fn(f64, f64) -> f64, from: f64| {
        [0, 1, 2].map(|axis| points.iter().map(|point| point[axis]).fold(from, pick))
    };
    let low = Vector3::from(fold(f64::min, f64::INFINITY));
    let high = Vector3::from(fold(f64::max, f64::NEG_INFINITY));
    Some(((low + high) / 2.0, (high - low) / 2.0))
}
