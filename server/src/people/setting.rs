//! Who is to sit in the chair, and who does.

/// Who is to sit in the chair, as a scenario says it. What is empty is drawn.
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
    /// Seed of what is drawn and of the motion; `None`: the scenario's.
    pub seed: Option<u64>,
    /// How much the head moves, 0 to 1.
    pub motion: f64,
    /// The mouth opens and stays open.
    pub mouth_open: bool,
    /// The arm is slowed near the face and stopped before it.
    pub guard: bool,
    /// What was drawn.
    pub drawn: Option<DrawnPerson>,
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
            motion: 1.0,
            mouth_open: false,
            guard: false,
            drawn: None,
        }
    }
}

impl PersonSetting {
    /// Who is drawn where a task needs somebody and the scenario names nobody: still
    /// hands that leave the lap free, and the guard.
    #[must_use]
    pub fn cared_for() -> Self {
        Self {
            posture: "hands_on_armrests".to_owned(),
            guard: true,
            ..Self::default()
        }
    }
}

/// Who sits there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DrawnPerson {
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
