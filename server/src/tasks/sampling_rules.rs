//! Rules by which a seed samples starts and objects, the field `draws` of a scenario.

use crate::scene::Scene;

/// See the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplingRules {
    /// Objects within the ranges of their area; each start anywhere is searched for.
    Ranges,
    /// Starts anywhere and objects by floor map and reach map.
    Maps,
}

impl SamplingRules {
    /// The rules with a number of the contract.
    #[must_use]
    pub fn from_number(number: u32) -> Option<Self> {
        let all = [Self::Ranges, Self::Maps];
        all.into_iter().find(|rules| rules.number() == number)
    }

    /// Their number in the contract.
    #[must_use]
    pub fn number(self) -> u32 {
        match self {
            Self::Ranges => 1,
            Self::Maps => 2,
        }
    }

    /// Those of a scenario that names none: by the maps where a pack's home has rooms.
    #[must_use]
    pub fn of_scene(scene: &Scene) -> Self {
        let home = scene.pack.as_ref().and_then(|pack| pack.home());
        match home.is_some_and(|home| !home.room.is_empty()) {
            true => Self::Maps,
            false => Self::Ranges,
        }
    }
}
