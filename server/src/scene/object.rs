//! Objects: loads `assets/objects/NAME.toml` as a free body.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::error::{Place, SceneError};
use super::file::{GraspEntry, ObjectFile};
use super::folder;
use super::part::Reader;
use super::{Body, Grasp, MassProperties, material, soft};

/// Largest opening of any gripper, metres; planners check the actual gripper's.
const WIDEST: f64 = 0.3;
/// Largest force of any gripper, N.
const HARDEST: f64 = 1000.0;

/// Reads one object; it is at the origin and has no area yet.
pub(super) fn read(reader: &Reader<'_>, kind: &str) -> Result<Body, SceneError> {
    let path = format!("objects/{kind}.toml");
    let packed = reader.pack.filter(|pack| pack.file(&path).is_some());
    let file: ObjectFile = match packed {
        Some(pack) => folder::parse_packed(pack, &path)?,
        None => folder::parse(reader.assets, &path)?,
    };
    let place = match packed {
        Some(pack) => Place::file(&pack.asset_path(&path)),
        None => Place::file(&path),
    };
    // An object of the assets has the materials and meshes of the assets.
    let reader = &Reader {
        pack: packed,
        ..*reader
    };
    folder::provenance(&place, &file.origin, &file.license)?;
    let parts = reader.body(
        &place,
        file.material.as_deref(),
        &file.parts,
        file.collision.as_deref(),
    )?;
    let friction =
        place
            .key("friction")
            .within(file.friction, 0.0, 2.0, "", "it is a Coulomb coefficient")?;
    let mut body = Body {
        name: kind.to_owned(),
        area: String::new(),
        category: file.category.clone(),
        colour: file.colour.clone(),
        noun: noun(&file),
        pose: Isometry3::identity(),
        mass: None,
        friction,
        collision: parts.collision,
        hulls: parts.hulls,
        soft: soft::read(reader, &place, &file)?,
        visual: parts.visual,
        grasps: Vec::new(),
        tip: file
            .tip
            .map(|tip| place.key("tip").position(tip))
            .transpose()?
            .map(Point3::from),
        optional: false,
    };
    body.mass = Some(mass(&place, file.mass, file.com, file.inertia, &body)?);
    for (i, entry) in file.grasps.iter().enumerate() {
        body.grasps.push(grasp(&place.entry("grasps", i), entry)?);
    }
    Ok(body)
}

/// Reads only `assets/objects/KIND.toml`; the object is at the origin.
///
/// # Errors
/// When the file is missing or a value is invalid.
pub fn object(assets: &Path, kind: &str) -> Result<Body, SceneError> {
    let materials = material::library(assets, None)?;
    let reader = Reader {
        assets,
        pack: None,
        materials: &materials,
    };
    read(&reader, kind)
}

/// The noun of an object of a pack: its words for tasks without the color before them.
fn noun(file: &ObjectFile) -> String {
    let words = file.stock.as_ref().map_or("", |stock| stock.words.as_str());
    // An orange that is orange is not named by its color.
    let noun = words.strip_prefix(&format!("{} ", file.colour));
    noun.unwrap_or(words).trim().to_owned()
}

/// Checks mass, centre and inertia against the size of the collision shapes.
pub(super) fn mass(
    place: &Place,
    mass: f64,
    com: [f64; 3],
    inertia: [f64; 3],
    body: &Body,
) -> Result<MassProperties, SceneError> {
    let Some(bounds) = body.collision_bounds(&Isometry3::identity()) else {
        return Err(place.key("collision").wrong(
            "empty",
            "at least one shape that collides",
            "let a part collide or list shapes under `collision`",
        ));
    };
    let mass = place.key("mass").within(
        mass,
        0.001,
        100.0,
        "kg",
        "masses are kilograms: 603 g is 0.603",
    )?;
    let given = com;
    let com = Point3::from(place.key("com").position(com)?);
    let inside = |at: [f64; 3]| (0..3).all(|i| (bounds.min[i]..=bounds.max[i]).contains(&at[i]));
    if !inside(com.coords.into()) {
        let turned = [given[0], 0.0 - given[2], given[1]];
        let cure = match inside(turned) {
            true => format!(
                "glTF and GLB files have y up and are turned to z up: their (x, y, z) becomes \
                 (x, -z, y), so write com = {turned:?}"
            ),
            false => "give the centre of mass in the object's own frame, z up (glTF and GLB \
                      files have y up and are turned: their (x, y, z) becomes (x, -z, y))"
                .to_owned(),
        };
        return Err(place.key("com").wrong(
            format!("{given:?}"),
            format!(
                "a point inside the collision shapes, {:.3?} to {:.3?} m",
                bounds.min.coords.as_slice(),
                bounds.max.coords.as_slice()
            ),
            &cure,
        ));
    }
    // No mass can be further out than the farthest corner of the bounds.
    let reach = (bounds.max - com).abs().sup(&(bounds.min - com).abs());
    let [xx, yy, zz] = inertia;
    for (i, moment) in [xx, yy, zz].into_iter().enumerate() {
        let (a, b) = (reach[(i + 1) % 3], reach[(i + 2) % 3]);
        place.key("inertia").within(
            moment,
            1e-9,
            mass * (a * a + b * b),
            "kg·m²",
            "inertia is about the centre of mass, in kg·m²: mass and size bound it",
        )?;
    }
    if xx > yy + zz || yy > zz + xx || zz > xx + yy {
        return Err(place.key("inertia").wrong(
            format!("{inertia:?} kg·m²"),
            "no moment greater than the sum of the two others",
            "no body has such an inertia: compute it again",
        ));
    }
    Ok(MassProperties {
        mass,
        com,
        inertia: Matrix3::from_diagonal(&Vector3::new(xx, yy, zz)),
    })
}

pub(super) fn grasp(place: &Place, entry: &GraspEntry) -> Result<Grasp, SceneError> {
    let unit = |key: &str, v: [f64; 3]| {
        let v = Vector3::from(v);
        if (v.norm() - 1.0).abs() < 1e-3 {
            Ok(v.normalize())
        } else {
            Err(place.key(key).wrong(
                format!("{:?} of length {:.3}", v.as_slice(), v.norm()),
                "a direction of length 1",
                "give a unit vector in the object's frame",
            ))
        }
    };
    let z = unit("approach", entry.approach)?;
    let x = unit("closing", entry.closing)?;
    if x.dot(&z).abs() > 1e-3 {
        return Err(place.key("closing").wrong(
            format!("{:?}", entry.closing),
            format!("a direction perpendicular to approach {:?}", entry.approach),
            "fingers close across the approach direction",
        ));
    }
    let x = (x - z * x.dot(&z)).normalize();
    let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Ok(Grasp {
        name: entry.name.clone(),
        pose: Isometry3::from_parts(
            Translation3::from(place.key("point").position(entry.point)?),
            turn,
        ),
        width: place.key("width").within(
            entry.width,
            0.001,
            WIDEST,
            "m",
            "no gripper opens that far: choose a narrower place",
        )?,
        symmetric: entry.symmetric,
        force: place.key("force").within(
            entry.force.unwrap_or(0.0),
            0.0,
            HARDEST,
            "N",
            "no gripper presses that hard",
        )?,
        from_above: entry.from_above,
    })
}
