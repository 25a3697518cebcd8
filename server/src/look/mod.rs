//! Looks: one run under other light, materials and exposure. Pure: from a seed,
//! strengths and a file below `assets/looks` to what the cameras see. Nothing here
//! reaches the physics.

mod camera;
mod file;
mod irradiance;
mod light;
mod palette;
mod random;
mod reflection;
mod setting;

use std::path::Path;

use nalgebra::Point3;

pub use camera::{CameraError, camera_error};
pub use file::Kind;
pub use irradiance::{Irradiance, MOST_LAMPS};
pub use palette::Decoration;
pub use reflection::Reflection;
pub use setting::{Look, STRONGEST};

use crate::geometry::{Family, Material};
use crate::scene::{Lighting, Scene, SceneError};
use file::LookFile;
use irradiance::times;

/// A lamp that is on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// In `house`, metres.
    pub at: Point3<f32>,
    /// Colour times intensity, linear.
    pub color: [f32; 3],
}

/// A look, drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    look: Look,
    file: LookFile,
    /// Direct light, and what the sky gives; exposure is in it.
    pub lighting: Lighting,
    /// Light from all around.
    pub irradiance: Irradiance,
    /// What smooth surfaces mirror.
    pub reflection: Reflection,
    /// Lamps of the scene that are on, by the order in which they stand there;
    /// more than there are are not used. Colour times intensity, linear.
    lamps: [Option<[f32; 3]>; MOST_LAMPS],
    /// What shines of itself is brighter by this.
    gain: f32,
    /// What is seen through the windows shines by this, and has this colour, sRGB.
    outdoors: f32,
    outdoors_color: [f32; 3],
    /// What stands or hangs beside the furniture.
    pub decoration: Vec<Decoration>,
}

impl Drawn {
    /// Draws a look of a scene from `looks/SCENE.toml`.
    ///
    /// # Errors
    /// [`SceneError`] with the file, the line or key, what was found and what is
    /// allowed.
    pub fn new(look: Look, scene: &Scene, assets: &Path) -> Result<Self, SceneError> {
        let file = file::load(assets, &scene.name)?;
        let light = light::draw(&look, &file, scene.lighting);
        let gain = light::exposure(&look);
        let mut drawn = Self {
            look,
            lighting: light.lighting,
            irradiance: light.irradiance.times(gain),
            reflection: reflection::drawn(&file, &light, gain),
            lamps: light.lamps.map(|lamp| lamp.map(|c| times(c, gain))),
            gain: (gain[0] + gain[1] + gain[2]) / 3.0,
            outdoors: light.outdoors,
            outdoors_color: light.outdoors_color(),
            decoration: Vec::new(),
            file,
        };
        let Lighting {
            sun, sky, ground, ..
        } = &mut drawn.lighting;
        for light in [sun, sky, ground] {
            *light = times(*light, gain);
        }
        drawn.decoration = palette::decoration(&drawn.look, &drawn.file);
        Ok(drawn)
    }

    /// The material that furniture of `material` has. Its transparency stays.
    #[must_use]
    pub fn furniture(&self, material: &Material) -> Material {
        let mut seen = palette::swapped(&self.look, &self.file, material);
        seen.emission *= self.gain;
        match seen.family {
            Some(Family::Outdoors) => {
                seen.emission *= self.outdoors.min(1.0);
                let tint = self.outdoors_color;
                seen.color = std::array::from_fn(|k| seen.color[k] * tint[k]);
            }
            // Which lamp is on is said where they stand.
            Some(Family::Lamp) if self.look.light > 0 => seen.emission = 0.0,
            _ => {}
        }
        seen
    }

    /// The material that robot and objects have: their own.
    #[must_use]
    pub fn kept(&self, material: &Material) -> Material {
        Material {
            emission: material.emission * self.gain,
            ..material.clone()
        }
    }

    /// The light of the lamp of this number, if it is on.
    #[must_use]
    pub fn lamp(&self, number: usize, at: Point3<f32>) -> Option<Lamp> {
        let color = self.lamps.get(number).copied().flatten()?;
        Some(Lamp { at, color })
    }

    /// How bright the shade of a lamp is that is on.
    #[must_use]
    pub fn lamp_glow(&self) -> f32 {
        0.9 * self.gain
    }
}

#[cfg(test)]
mod tests;
