//! Axes of an appearance and their strengths.

/// Strengths of the axes, each from 0 (off) to [`STRONGEST`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Appearance {
    /// Seed of all samples.
    pub seed: u64,
    /// Sun, sky, lamps and their colours.
    pub light: u8,
    /// Walls, floor, ceiling.
    pub background: u8,
    /// Furniture, by families of materials.
    pub materials: u8,
    /// Exposure and white balance.
    pub exposure: u8,
    /// Decoration without collision.
    pub decoration: u8,
    /// Mounts of the robot's cameras.
    pub camera: u8,
    /// Focal lengths of the robot's cameras.
    pub lens: u8,
}

/// Largest strength.
pub const STRONGEST: u8 = 3;

impl Appearance {
    /// Whether images are rendered as without an appearance.
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

/// A strength relative to the largest one.
pub(super) fn share_of(strength: u8) -> f64 {
    f64::from(strength.min(STRONGEST)) / f64::from(STRONGEST)
}
