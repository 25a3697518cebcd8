//! Visual randomization (looks): one scene with other light, materials and exposure. A
//! pure function of a seed, strengths and a file below `assets/appearances`; it does not
//! affect the physics.

mod camera;
mod derive;
mod file;
mod furnish;
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
pub use setting::{Appearance, STRONGEST};

use crate::geometry::{Family, Material};
use crate::scene::{Lighting, Scene, SceneError};
use file::AppearanceFile;
use irradiance::times;

/// An active lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// In `house`, metres.
    pub at: Point3<f32>,
    /// Colour times intensity, linear.
    pub color: [f32; 3],
}

/// A sampled look.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledAppearance {
    appearance: Appearance,
    file: AppearanceFile,
    /// Direct light and sky light, including exposure.
    pub lighting: Lighting,
    /// Ambient light.
    pub irradiance: Irradiance,
    /// Reflections on smooth surfaces.
    pub reflection: Reflection,
    /// Active lamps of the scene, in the scene's order; surplus entries are unused.
    /// Colour times intensity, linear.
    lamps: [Option<[f32; 3]>; MOST_LAMPS],
    /// Brightness factor of emissive surfaces.
    gain: f32,
    /// Brightness factor of the view through the windows, and its colour, sRGB.
    outdoors: f32,
    outdoors_color: [f32; 3],
    /// Decoration in addition to the furniture.
    pub decoration: Vec<Decoration>,
}

impl SampledAppearance {
    /// Samples an appearance of a scene from `appearances/SCENE.toml`, of a pack from its
    /// `appearance.toml` or, without one, from its rooms.
    ///
    /// # Errors
    /// [`SceneError`] with the file, the line or key, the value found and the allowed
    /// values.
    pub fn new(appearance: Appearance, scene: &Scene, assets: &Path) -> Result<Self, SceneError> {
        let file = derive::for_scene(assets, scene)?;
        let light = light::draw(&appearance, &file, scene.lighting);
        let gain = light::exposure(&appearance);
        let mut drawn = Self {
            appearance,
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
        drawn.decoration = palette::decoration(&drawn.appearance, &drawn.file);
        Ok(drawn)
    }

    /// The material of furniture with `material` in this look. Its transparency is
    /// unchanged.
    #[must_use]
    pub fn furniture(&self, material: &Material) -> Material {
        let mut replaced = palette::swapped(&self.appearance, &self.file, material);
        replaced.emission *= self.gain;
        match replaced.family {
            Some(Family::Outdoors) => {
                replaced.emission *= self.outdoors.min(1.0);
                let tint = self.outdoors_color;
                replaced.color = std::array::from_fn(|k| replaced.color[k] * tint[k]);
            }
            // Active lamps are listed separately.
            Some(Family::Lamp) if self.appearance.light > 0 => replaced.emission = 0.0,
            _ => {}
        }
        replaced
    }

    /// The material of robot and objects: unchanged.
    #[must_use]
    pub fn unchanged(&self, material: &Material) -> Material {
        Material {
            emission: material.emission * self.gain,
            ..material.clone()
        }
    }

    /// The light of the lamp with this number, if it is active.
    #[must_use]
    pub fn lamp(&self, number: usize, at: Point3<f32>) -> Option<Lamp> {
        let color = self.lamps.get(number).copied().flatten()?;
        Some(Lamp { at, color })
    }

    /// Brightness of the shade of an active lamp.
    #[must_use]
    pub fn lamp_glow(&self) -> f32 {
        0.9 * self.gain
    }
}

#[cfg(test)]
mod tests;
