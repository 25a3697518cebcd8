//! The requested and the sampled person in the chair.

/// The requested person. Empty fields are sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct PersonSetting {
    /// Folder below `assets/people`.
    pub body: String,
    /// Posture of `assets/people/postures.toml`.
    pub posture: String,
    /// Colours of `assets/people/looks.toml`.
    pub skin: String,
    /// Hair colour.
    pub hair: String,
    /// Clothes.
    pub clothes: String,
    /// Seed of samples and motion; `None`: the scenario's.
    pub seed: Option<u64>,
    /// Strength of the head's motion, 0 to 1; `None`: the task's, or 1.
    pub motion: Option<f64>,
    /// The mouth opens and stays open.
    pub mouth_open: bool,
    /// Speed and force of arm, gripper and chair are limited near the person
    /// (`sim/person_guard`). On by default.
    pub guard: bool,
    /// Sampled values.
    pub drawn: Option<SampledPerson>,
}

impl Default for PersonSetting {
    fn default() -> Self {
        Self {
            body: String::new(),
            posture: String::new(),
            skin: String::new(),
            hair: String::new(),
            clothes: String::new(),
            seed: None,
            motion: None,
            mouth_open: false,
            guard: true,
            drawn: None,
        }
    }
}

/// A sampled person.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SampledPerson {
    /// Folder below `assets/people`.
    pub body: String,
    /// Posture.
    pub posture: String,
    /// Skin colour.
    pub skin: String,
    /// Hair colour.
    pub hair: String,
    /// Clothes.
    pub clothes: String,
}
