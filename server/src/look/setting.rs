//! What a look varies and how strongly.

/// What is varied, each from 0 (off) to [`STRONGEST`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Look {
    /// Seed of all draws.
    pub seed: u64,
    /// Sun, sky, lamps and their colours.
    pub light: u8,
    /// Walls, floor, ceiling.
    pub background: u8,
    /// Furniture, by families of materials.
    pub materials: u8,
    /// Exposure and white balance.
    pub exposure: u8,
    /// Things that touch nothing.
    pub decoration: u8,
    /// Places of the robot's cameras.
    pub camera: u8,
    /// Focal lengths of the robot's cameras.
    pub lens: u8,
}

/// Greatest strength.
pub const STRONGEST: u8 = 3;

impl Look {
    /// Whether the pictures are drawn as without a look.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        let axes = [
            self.light,
            self.background,
            self.materials,
            self.exposure,
            self.decoration,
        ];
        axes == [0; 5]
    }
}

/// A strength as a share of the strongest.
pub(super) fn share_of(strength: u8) -> f64 {
    f64::from(strength.min(STRONGEST)) / f64::from(STRONGEST)
}
