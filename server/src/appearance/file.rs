//! `assets/appearances/SCENE.toml`: skies, material families, places of decoration. Errors
//! name the line.

use std::collections::BTreeMap;
use std::path::Path;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use wheelarm_proto::exact;

use crate::geometry::{Family, texture};
use crate::scene::{Place, SceneError, parse, provenance};

/// The file.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct AppearanceFile {
    pub origin: String,
    pub license: String,
    /// Centre of the reflections, metres in `house`.
    pub centre: [f64; 3],
    /// Lowest and highest corner of the room, metres in `house`.
    pub room: [[f64; 3]; 2],
    #[serde(default)]
    pub window: Vec<Window>,
    pub sky: Vec<Sky>,
    #[serde(default)]
    pub family: BTreeMap<Family, Palette>,
    #[serde(default)]
    pub decoration: Vec<Spot>,
}

/// Window panes that show the sky.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct Window {
    pub at: [f64; 3],
    /// Width and height, metres.
    #[serde(deserialize_with = "lengths")]
    pub size: [f64; 2],
}

/// A sky and the light below it.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct Sky {
    name: String,
    /// Used at this strength and above.
    #[serde(deserialize_with = "strength")]
    pub strength: u32,
    #[serde(deserialize_with = "intensity")]
    pub sun: f32,
    #[serde(deserialize_with = "elevation")]
    pub elevation_deg: [f64; 2],
    #[serde(deserialize_with = "temperature")]
    pub kelvin: [f64; 2],
    pub color: Color,
    #[serde(deserialize_with = "intensity")]
    pub brightness: f32,
    #[serde(deserialize_with = "intensity")]
    pub room: f32,
    #[serde(deserialize_with = "fraction")]
    pub lamps: f32,
}

/// Materials of a family.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct Palette {
    #[serde(deserialize_with = "some")]
    pub colors: Vec<Color>,
    #[serde(default)]
    pub textures: Vec<Pattern>,
    /// Share of members without texture, 0 to 1.
    #[serde(default, deserialize_with = "fraction")]
    pub plain: f32,
    #[serde(deserialize_with = "fractions")]
    pub roughness: [f64; 2],
}

#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct Pattern {
    pub pattern: String,
    #[serde(deserialize_with = "length")]
    pub metres: f64,
}

/// A place that takes decoration.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct Spot {
    pub kind: Kind,
    pub at: [f64; 3],
    pub along_deg: f64,
    #[serde(deserialize_with = "lengths")]
    pub size: [f64; 2],
}

/// Kind of decoration.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// On a wall.
    #[serde(rename = "picture")]
    WallImage,
    /// On the floor.
    Rug,
    /// On a high surface.
    Plant,
    /// Below the ceiling.
    Lamp,
}

/// `#rrggbb`, sRGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Color(pub [f32; 3]);

impl Color {
    /// Linear.
    pub fn linear(self) -> [f32; 3] {
        self.0.map(|c| {
            if c <= 0.040_45 {
                c / 12.92
            } else {
                exact::powf((c + 0.055) / 1.055, 2.4)
            }
        })
    }
}

impl<'de> Deserialize<'de> for Color {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6);
        let value = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        let value = value.ok_or_else(|| {
            D::Error::custom(format!(
                "{text:?}, expected a colour as \"#rrggbb\" in sRGB"
            ))
        })?;
        Ok(Self(
            [16, 8, 0].map(|shift| ((value >> shift) & 0xff) as f32 / 255.0),
        ))
    }
}

fn within<E: serde::de::Error>(value: f64, low: f64, high: f64) -> Result<f64, E> {
    if value >= low && value <= high {
        return Ok(value);
    }
    Err(E::custom(format!("{value}, expected {low} to {high}")))
}

fn one<'de, D: Deserializer<'de>>(from: D, low: f64, high: f64) -> Result<f64, D::Error> {
    within(f64::deserialize(from)?, low, high)
}

fn two<'de, D: Deserializer<'de>>(from: D, low: f64, high: f64) -> Result<[f64; 2], D::Error> {
    let values = <[f64; 2]>::deserialize(from)?;
    for value in values {
        within(value, low, high)?;
    }
    Ok(values)
}

/// From low to high.
fn range<'de, D: Deserializer<'de>>(from: D, low: f64, high: f64) -> Result<[f64; 2], D::Error> {
    let values = two(from, low, high)?;
    if values[0] > values[1] {
        return Err(D::Error::custom(format!(
            "{values:?}, expected the lower value first"
        )));
    }
    Ok(values)
}

fn strength<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    let value = f64::from(u32::deserialize(from)?);
    within(value, 1.0, 3.0).map(|strength| strength as u32)
}

fn intensity<'de, D: Deserializer<'de>>(from: D) -> Result<f32, D::Error> {
    one(from, 0.0, 3.0).map(|x| x as f32)
}

fn fraction<'de, D: Deserializer<'de>>(from: D) -> Result<f32, D::Error> {
    one(from, 0.0, 1.0).map(|x| x as f32)
}

fn length<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    one(from, 0.01, 20.0)
}

fn lengths<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    two(from, 0.01, 20.0)
}

fn fractions<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    range(from, 0.0, 1.0)
}

fn elevation<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    range(from, 15.0, 89.0)
}

fn temperature<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    range(from, 2000.0, 9000.0)
}

fn some<'de, T: Deserialize<'de>, D: Deserializer<'de>>(from: D) -> Result<Vec<T>, D::Error> {
    let list = Vec::deserialize(from)?;
    if list.is_empty() {
        return Err(D::Error::custom(
            "an empty list, expected one entry or more",
        ));
    }
    Ok(list)
}

/// Reads and checks the appearances of a scene of the assets.
pub(super) fn load(assets: &Path, scene: &str) -> Result<AppearanceFile, SceneError> {
    let path = format!("appearances/{scene}.toml");
    let file: AppearanceFile = parse(assets, &path)?;
    check(assets, &path, file)
}

/// Checks the appearances of the file at `path`.
pub(super) fn check(
    assets: &Path,
    path: &str,
    file: AppearanceFile,
) -> Result<AppearanceFile, SceneError> {
    let place = Place::file(path);
    provenance(&place, &file.origin, &file.license)?;
    if !file.sky.iter().any(|sky| sky.strength == 1) {
        return Err(place.key("sky").wrong(
            "without one of strength 1",
            "at least one sky of strength 1",
            "give a sky strength = 1",
        ));
    }
    for k in 0..3 {
        let [low, high] = file.room.map(|corner| corner[k]);
        if !(low < file.centre[k] && file.centre[k] < high) {
            return Err(place.key("centre").wrong(
                format!("{:?}", file.centre),
                format!("a point inside the room, {:?}", file.room),
                "move it inside",
            ));
        }
    }
    let known = texture::names(assets);
    for (family, palette) in &file.family {
        for pattern in &palette.textures {
            if !known.contains(&pattern.pattern) {
                let place = place.key("family").key(family.name()).key("textures");
                return Err(place.wrong(
                    format!("{:?}", pattern.pattern),
                    format!("one of {}", known.join(", ")),
                    "put the image into assets/textures, or name one that is there",
                ));
            }
        }
    }
    Ok(file)
}
