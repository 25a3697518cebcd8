//! Who is to sit in the chair, and who does.

/// Who is to sit in the chair, as a scenario says it. What is empty is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
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
    /// How much the head moves, 0 to 1; `None`: as the task says, or 1.
    pub motion: Option<f64>,
    /// The mouth opens and stays open.
    pub mouth_open: bool,
    /// The arm is slowed near the face and stopped before it.
    pub guard: bool,
    /// What was drawn.
    pub drawn: Option<DrawnPerson>,
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
