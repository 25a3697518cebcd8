//! Body parts, for IDs, labels and forces.

/// A part of a body.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
pub enum BodyPart {
    /// The head without the face.
    Head,
    /// The face.
    Face,
    /// The mouth: a part of the face with its own ID.
    Mouth,
    /// Neck and torso.
    Torso,
    /// Upper arms and forearms.
    Arms,
    /// Hands.
    Hands,
    /// The thighs of a seated person.
    Lap,
    /// Legs below the knee, and feet.
    Legs,
}

/// All, in the order of ids and forces.
pub const PARTS: [BodyPart; 8] = [
    BodyPart::Head,
    BodyPart::Face,
    BodyPart::Mouth,
    BodyPart::Torso,
    BodyPart::Arms,
    BodyPart::Hands,
    BodyPart::Lap,
    BodyPart::Legs,
];

impl BodyPart {
    /// Name, for example `hands`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Face => "face",
            Self::Mouth => "mouth",
            Self::Torso => "torso",
            Self::Arms => "arms",
            Self::Hands => "hands",
            Self::Lap => "lap",
            Self::Legs => "legs",
        }
    }

    /// Index in [`PARTS`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// From the name of a capsule or a joint; `None` for others.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        let word = name
            .strip_prefix("left_")
            .or(name.strip_prefix("right_"))
            .unwrap_or(name);
        let stem = word.split('_').next().unwrap_or_default();
        Some(match stem {
            "head" | "jaw" => Self::Head,
            "face" => Self::Face,
            "neck" | "shoulders" | "chest" | "waist" | "belly" | "pelvis" | "spine"
            | "clavicle" => Self::Torso,
            "upper" | "forearm" => Self::Arms,
            "hand" | "thumb" | "index" | "middle" | "ring" | "little" => Self::Hands,
            "hip" | "thigh" => Self::Lap,
            "shank" | "foot" => Self::Legs,
            _ => return None,
        })
    }
}

/// Name of a capsule where bodies are named, by its index in [`CAPSULES`].
#[must_use]
pub fn person_part(capsule: usize) -> String {
    let name = CAPSULES.get(capsule).copied().unwrap_or_default();
    format!("person_{name}")
}

/// Names of the capsules of every body, in order: `BodyRef::Person` is an index into
/// it.
pub const CAPSULES: [&str; 28] = [
    "head",
    "face",
    "neck",
    "shoulders",
    "chest",
    "waist",
    "belly",
    "pelvis",
    "left_upper_arm",
    "left_forearm",
    "left_hand",
    "left_index",
    "left_little",
    "left_thumb",
    "left_hip",
    "left_thigh",
    "left_shank",
    "left_foot",
    "right_upper_arm",
    "right_forearm",
    "right_hand",
    "right_index",
    "right_little",
    "right_thumb",
    "right_hip",
    "right_thigh",
    "right_shank",
    "right_foot",
];
