//! Looks: one run under other light, materials and exposure. Pure: from a seed,
//! strengths and a file below `assets/looks` to what the cameras see. Nothing here
//! reaches the physics.

mod camera;
mod environment;
mod file;
mod light;
mod palette;

use std::path::Path;

use nalgebra::Point3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

pub use camera::{CameraError, camera_error};
pub use environment::{Irradiance, Reflection};
pub use file::Kind;

use crate::geometry::{Family, Material};
use crate::scene::{Lighting, Scene, SceneError};
use file::LookFile;

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

/// A lamp that is on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// In `house`, metres.
    pub at: Point3<f32>,
    /// Colour times intensity, linear.
    pub color: [f32; 3],
}

/// Most lamps that light a room at once.
pub const MOST_LAMPS: usize = 4;

/// A thing that is drawn and touched by nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoration {
    /// What it is.
    pub kind: Kind,
    /// Middle of its back (pictures) or of its foot, in `house`, metres.
    pub at: [f64; 3],
    /// Where it looks, radians from east.
    pub along: f64,
    /// Width and height, metres; of rugs both lie on the floor.
    pub size: [f64; 2],
    /// Its materials: frame or pot or shade, picture or leaves or border.
    pub materials: [Material; 2],
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
            reflection: environment::reflection(&file, &light, gain),
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

fn times(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| a[k] * b[k])
}

/// Random numbers of a look: a row for each thing that is drawn, so that none
/// depends on another.
struct Random(ChaCha8Rng);

/// What is drawn from a row of its own.
#[derive(Clone, Copy)]
enum Row {
    Light,
    Lamps,
    Exposure,
    Decoration,
    Camera,
    Lens,
    /// By the hash of its name.
    Material,
}

impl Random {
    fn new(seed: u64, row: Row, number: u32) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream((row as u64 + 1) << 32 | u64::from(number));
        Self(random)
    }

    /// 0 to 1, from 53 bits: independent of any library's sampling.
    fn share(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn range(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.share()
    }

    /// -`most` to `most`.
    fn about(&mut self, most: f64) -> f64 {
        self.range([-most, most])
    }

    fn one_of<'a, T>(&mut self, list: &'a [T]) -> Option<&'a T> {
        let at = (self.share() * list.len() as f64) as usize;
        list.get(at)
    }
}

/// A strength as a share of the strongest.
fn share_of(strength: u8) -> f64 {
    f64::from(strength.min(STRONGEST)) / f64::from(STRONGEST)
}

#[cfg(test)]
mod tests;
