//! Tables of material files.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::part::is_default;

/// `materials/NAME.toml`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialFile {
    /// Origin of the materials.
    pub origin: String,
    /// Their license.
    pub license: String,
    /// The materials, by name.
    pub material: BTreeMap<String, MaterialEntry>,
}

/// A material.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialEntry {
    /// sRGB as `#rrggbb`.
    pub color: String,
    /// 0 (mirror) to 1.
    pub roughness: f64,
    /// 0 dielectric to 1 metal.
    #[serde(default, skip_serializing_if = "is_default")]
    pub metallic: f64,
    /// Emitted light as a fraction of the base color.
    #[serde(default, skip_serializing_if = "is_default")]
    pub emission: f64,
    /// Image that multiplies the color.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texture: Option<TextureEntry>,
    /// Materials of one family may replace each other in an appearance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub family: Option<Family>,
    /// Share of transmitted light, with an appearance.
    #[serde(default, skip_serializing_if = "is_default")]
    pub transmission: f64,
}

/// An image on a material.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TextureEntry {
    /// Name of the image in `textures`, without `.png`.
    pub pattern: String,
    /// Metres of surface per repetition.
    pub metres: f64,
}

/// Families of materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub enum Family {
    Wall,
    Ceiling,
    Floor,
    Wood,
    Cabinet,
    Stone,
    Fabric,
    Metal,
    Plastic,
    Ceramic,
    Art,
    Fruit,
    Flower,
    Plant,
    /// Shades of lamps.
    Lamp,
    /// The view through the windows.
    Outdoors,
}

impl Family {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wall => "wall",
            Self::Ceiling => "ceiling",
            Self::Floor => "floor",
            Self::Wood => "wood",
            Self::Cabinet => "cabinet",
            Self::Stone => "stone",
            Self::Fabric => "fabric",
            Self::Metal => "metal",
            Self::Plastic => "plastic",
            Self::Ceramic => "ceramic",
            Self::Art => "art",
            Self::Fruit => "fruit",
            Self::Flower => "flower",
            Self::Plant => "plant",
            Self::Lamp => "lamp",
            Self::Outdoors => "outdoors",
        }
    }
}
