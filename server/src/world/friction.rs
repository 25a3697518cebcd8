//! Friction of a joint.

/// Speed below which dry friction decreases linearly, rad/s. [choice: 16 mm/s at a
/// stretched hand, 1 % of the speed limits]
const CREEP: f64 = 0.02;

/// Friction of a joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Friction {
    /// Opposes motion, independent of speed, N·m.
    pub dry: f64,
    /// Proportional to the speed, N·m·s/rad.
    pub viscous: f64,
}

impl Friction {
    /// The damping that produces this friction's torque at a speed, N·m·s/rad.
    pub(super) fn damping(self, velocity: f64) -> f64 {
        self.viscous + self.dry / velocity.abs().max(CREEP)
    }
}
