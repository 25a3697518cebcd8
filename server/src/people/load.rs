//! Loads a sampled person from `assets/people` and validates it.

use std::path::Path;

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};

use super::file::{AppearancesFile, PersonFile, PostureTable, PosturesFile};
use super::folder::{FOLDER, read};
use super::mesh::{MeshFile, SkinnedMesh};
use super::motion::HeadLimits;
use super::part::{BodyPart, CAPSULES};
use super::setting::SampledPerson;
use super::skeleton::Skeleton;
use super::{Capsule, Landmark, Lap, Person};
use crate::geometry::{Material, Texture};
use crate::scene::{Place, SceneError, provenance};

/// Lowest and highest mass, kg. [choice: what a chair carries]
const MASS: [f64; 2] = [20.0, 200.0];

impl Person {
    /// Loads the sampled person.
    ///
    /// # Errors
    /// [`SceneError`] that names the file, the key and the fix.
    pub fn load(assets: &Path, drawn: SampledPerson) -> Result<Self, SceneError> {
        let path = format!("{FOLDER}/{}/person.toml", drawn.body);
        let place = Place::file(&path);
        let person: PersonFile = read(assets, &path)?;
        provenance(&place, &person.origin, &person.license)?;
        let posture_path = format!("{FOLDER}/{}/postures.toml", drawn.body);
        let mut postures: PosturesFile = read(assets, &posture_path)?;
        let posture_place = Place::file(&posture_path);
        provenance(&posture_place, &postures.origin, &postures.license)?;
        let posture = postures.posture.remove(&drawn.posture).ok_or_else(|| {
            let names: Vec<&str> = postures.posture.keys().map(String::as_str).collect();
            posture_place.key("posture").wrong(
                format!("{:?}", drawn.posture),
                format!("one of {}", names.join(", ")),
                "this body does not have this posture: name another",
            )
        })?;
        let appearances: AppearancesFile = read(assets, &format!("{FOLDER}/looks.toml"))?;
        let file = format!("{FOLDER}/{}/{}", drawn.body, person.mesh);
        let broken = |words: String| {
            Place::file(&file).wrong(
                words,
                "a mesh of assets/tools/people",
                "make it again: make people",
            )
        };
        let raw = MeshFile::read(&assets.join(&file)).map_err(broken)?;
        if raw.joints != person.joints {
            return Err(broken("other joints than person.toml".to_owned()));
        }
        let joint = |name: &str, key: &str| {
            let found = person.joints.iter().position(|joint| joint == name);
            found.ok_or_else(|| {
                let words = format!("{name:?}");
                place
                    .key(key)
                    .wrong(words, "a joint of `joints`", "correct the name")
            })
        };
        let head = joint("head", "joints")?;
        let skeleton = skeleton(&raw, &person, &posture, &posture_place, joint)?;
        let capsules = capsules(&person, &place, &skeleton, joint)?;
        let face_from = capsules.iter().find(|c| c.part == BodyPart::Face);
        let face_from = face_from.map_or(0.0, |c| (c.ends[0].x + c.ends[1].x) / 2.0);
        let material = |name: &str| material(&appearances, &drawn, name);
        let mesh = SkinnedMesh::new(raw, head, face_from, material).map_err(broken)?;
        let mouth = person.landmark.get("mouth").ok_or_else(|| {
            let expected = "a point between the lips";
            place
                .key("landmark.mouth")
                .wrong("missing", expected, "make it again: make people")
        })?;
        let [xx, yy, zz, xy, xz, yz] = posture.inertia;
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let least = inertia.symmetric_eigenvalues().min();
        if !(least > 0.0 && least.is_finite()) {
            let key = format!("{}.inertia", drawn.posture);
            return Err(posture_place.key(&key).wrong(
                format!("{:?}", posture.inertia),
                "xx, yy, zz, xy, xz, yz of a body",
                "make it again: make people",
            ));
        }
        let [light, heavy] = MASS;
        let m = &person.head_motion;
        Ok(Self {
            words: person.words,
            stature: place
                .key("stature")
                .within(person.stature, 0.5, 2.5, "m", "metres")?,
            mass: place
                .key("mass")
                .within(person.mass, light, heavy, "kg", "kilograms")?,
            com: posture_place.key("com").position(posture.com)?.into(),
            inertia,
            seat_height: place.key("seat_height").length(person.seat_height)?,
            cushion: place
                .key("cushion")
                .within(person.cushion, 0.0, 0.2, "m", "metres")?,
            capsules,
            margin: place.key("capsules.margin").within(
                person.capsules.margin,
                0.0,
                0.1,
                "m",
                "metres",
            )?,
            lap: Lap {
                at: place.key("lap.at").position(person.lap.at)?.into(),
                size: person.lap.size,
            },
            mouth: Landmark {
                joint: joint(&mouth.joint, "landmark.mouth.joint")?,
                at: place.key("landmark.mouth.at").position(mouth.at)?.into(),
            },
            skeleton,
            mesh,
            limits: HeadLimits {
                yaw: m.yaw,
                up: m.up,
                down: m.down,
                roll: m.roll,
                jaw: m.jaw_open,
            },
            drawn,
        })
    }
}

fn skeleton(
    raw: &MeshFile,
    person: &PersonFile,
    posture: &PostureTable,
    place: &Place,
    joint: impl Fn(&str, &str) -> Result<usize, SceneError>,
) -> Result<Skeleton, SceneError> {
    let mut turns = vec![UnitQuaternion::identity(); raw.joints.len()];
    for (name, turn) in &posture.joints {
        let turn = place.key("joints").key(name).position(*turn)?;
        turns[joint(name, "joints")?] = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    }
    let root = place.key("root").position(posture.root)?;
    let shares = person.head_motion.shares;
    let neck = ["neck_1", "neck_2", "head"];
    let neck = [
        (joint(neck[0], "joints")?, shares[0]),
        (joint(neck[1], "joints")?, shares[1]),
        (joint(neck[2], "joints")?, shares[2]),
    ];
    let jaw = joint("jaw", "joints")?;
    let (parents, rest) = (raw.parents.clone(), raw.rest.clone());
    Ok(Skeleton::new(parents, rest, turns, root.into(), neck, jaw))
}

/// Its capsules in the order of [`CAPSULES`].
fn capsules(
    person: &PersonFile,
    place: &Place,
    skeleton: &Skeleton,
    joint: impl Fn(&str, &str) -> Result<usize, SceneError>,
) -> Result<Vec<Capsule>, SceneError> {
    let capsules = CAPSULES.iter().map(|name| {
        let mut tables = person.capsule.iter().enumerate();
        let Some((i, table)) = tables.find(|(_, table)| table.part == *name) else {
            let found = format!("{} capsules", person.capsule.len());
            let expected = format!("one of the part {name:?}");
            return Err(place
                .key("capsule")
                .wrong(found, expected, "make it again: make people"));
        };
        let place = place.entry("capsule", i);
        let joint = joint(&table.joint, "capsule.joint")?;
        let end = |key: &str, at: [f64; 3]| place.key(key).position(at).map(Point3::from);
        let part = BodyPart::from_name(&table.part).ok_or_else(|| {
            let found = format!("{:?}", table.part);
            place
                .key("part")
                .wrong(found, "a part of a body", "correct the name")
        })?;
        Ok(Capsule {
            name: table.part.clone(),
            part,
            joint,
            ends: [end("a", table.a)?, end("b", table.b)?],
            radius: place
                .key("radius")
                .within(table.radius, 0.005, 0.4, "m", "metres")?,
            moves: skeleton.moves(joint),
        })
    });
    capsules.collect()
}

/// A material of the mesh with the sampled appearance.
fn material(appearances: &AppearancesFile, drawn: &SampledPerson, name: &str) -> Option<Material> {
    let table = appearances.material.get(name)?;
    let skin = appearances.skin.iter().find(|s| s.name == drawn.skin)?;
    let hair = appearances.hair.iter().find(|h| h.name == drawn.hair)?;
    let clothes = appearances
        .clothes
        .iter()
        .find(|c| c.name == drawn.clothes)?;
    let bare = clothes.sleeves == "skin";
    let color = match name {
        "skin" => &skin.color,
        "sleeves" if bare => &skin.color,
        "lips" => &skin.lips,
        "brows" => &hair.brows,
        "hair" => &hair.color,
        "shirt" => &clothes.shirt,
        "sleeves" => &clothes.sleeves,
        "trousers" => &clothes.trousers,
        "shoes" => &clothes.shoes,
        _ => table.color.as_ref()?,
    };
    // Bare forearms have the skin's material.
    let table = match name == "sleeves" && bare {
        true => appearances.material.get("skin")?,
        false => table,
    };
    Some(Material {
        name: format!("person_{name}"),
        color: rgb(color)?,
        roughness: table.roughness,
        metallic: 0.0,
        emission: 0.0,
        texture: table.texture.as_ref().map(|t| Texture {
            pattern: t.pattern.clone(),
            metres: t.metres,
            file: None,
        }),
        family: None,
        transmission: 0.0,
    })
}

/// `#rrggbb` as sRGB, 0 to 1.
fn rgb(text: &str) -> Option<[f32; 3]> {
    let digits = text
        .strip_prefix('#')
        .filter(|d| d.len() == 6 && d.is_ascii())?;
    let mut color = [0.0; 3];
    for (i, value) in color.iter_mut().enumerate() {
        let byte = u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok()?;
        *value = f32::from(byte) / 255.0;
    }
    Some(color)
}
