//! Layout of the files of `assets/people`: one struct per table.

use std::collections::BTreeMap;

use serde::Deserialize;

/// `NAME/person.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PersonFile {
    pub origin: String,
    pub license: String,
    pub words: String,
    #[serde(rename = "sex")]
    _sex: String,
    pub age: String,
    pub mesh: String,
    pub stature: f64,
    pub mass: f64,
    pub seat_height: f64,
    pub cushion: f64,
    #[serde(rename = "crown")]
    _crown: f64,
    #[serde(rename = "knees")]
    _knees: f64,
    #[serde(rename = "hip_breadth")]
    _hip_breadth: f64,
    #[serde(rename = "shoulder_breadth")]
    _shoulder_breadth: f64,
    pub joints: Vec<String>,
    pub head_motion: HeadMotionTable,
    #[serde(rename = "head_box")]
    _head_box: toml::Table,
    pub lap: LapTable,
    pub landmark: BTreeMap<String, LandmarkTable>,
    pub capsules: CapsulesTable,
    pub capsule: Vec<CapsuleTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HeadMotionTable {
    pub yaw: f64,
    pub up: f64,
    pub down: f64,
    pub roll: f64,
    pub shares: [f64; 3],
    pub jaw_open: f64,
    #[serde(rename = "mouth_gap")]
    _mouth_gap: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LapTable {
    pub at: [f64; 3],
    pub size: [f64; 2],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LandmarkTable {
    pub joint: String,
    pub at: [f64; 3],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CapsulesTable {
    #[serde(rename = "near")]
    _near: f64,
    pub margin: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CapsuleTable {
    pub part: String,
    pub joint: String,
    pub a: [f64; 3],
    pub b: [f64; 3],
    pub radius: f64,
}

/// `NAME/postures.toml`.
#[derive(Debug, Deserialize)]
pub(super) struct PosturesFile {
    pub origin: String,
    pub license: String,
    #[serde(flatten)]
    pub posture: BTreeMap<String, PostureTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PostureTable {
    pub root: [f64; 3],
    pub com: [f64; 3],
    /// xx, yy, zz, xy, xz, yz.
    pub inertia: [f64; 6],
    pub joints: BTreeMap<String, [f64; 3]>,
}

/// Meaning of a posture in `postures.toml`.
#[derive(Debug, Deserialize)]
pub(super) struct PostureList {
    #[serde(rename = "origin")]
    _origin: String,
    #[serde(rename = "license")]
    _license: String,
    #[serde(flatten)]
    posture: BTreeMap<String, PostureWords>,
}

#[derive(Debug, Deserialize)]
struct PostureWords {
    share: f64,
}

impl PostureList {
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.posture.keys().map(String::as_str)
    }

    /// The posture at a cumulative share, 0 to 1.
    pub(super) fn at_share(&self, part: f64) -> &str {
        let all: f64 = self.posture.values().map(|p| p.share).sum();
        let mut left = part * all;
        let mut last = "";
        for (name, posture) in &self.posture {
            last = name;
            left -= posture.share;
            if left < 0.0 {
                break;
            }
        }
        last
    }
}

/// `looks.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AppearancesFile {
    #[serde(rename = "origin")]
    _origin: String,
    #[serde(rename = "license")]
    _license: String,
    pub material: BTreeMap<String, MaterialTable>,
    pub skin: Vec<SkinTable>,
    pub hair: Vec<HairTable>,
    pub clothes: Vec<ClothesTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialTable {
    pub roughness: f32,
    pub color: Option<String>,
    pub texture: Option<TextureTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TextureTable {
    pub pattern: String,
    pub metres: f32,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SkinTable {
    pub name: String,
    pub color: String,
    pub lips: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HairTable {
    pub name: String,
    pub color: String,
    pub brows: String,
    pub ages: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClothesTable {
    pub name: String,
    pub shirt: String,
    /// A colour, or `skin`.
    pub sleeves: String,
    pub trousers: String,
    pub shoes: String,
}
