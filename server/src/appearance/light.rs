//! Sun, sky and lamps of an appearance, and the exposure.

use nalgebra::{Point3, Vector3};
use wheelarm_proto::exact;

use super::file::{AppearanceFile, Sky};
use super::irradiance::{Irradiance, MOST_LAMPS, times};
use super::random::{Random, Row};
use super::setting::{Appearance, share_of};
use crate::scene::Lighting;

/// Light before the exposure.
pub(super) struct Light {
    pub lighting: Lighting,
    pub irradiance: Irradiance,
    pub lamps: [Option<[f32; 3]>; MOST_LAMPS],
    /// Sky as seen through a window, linear.
    pub pane: [f32; 3],
    pub outdoors: f32,
}

impl Light {
    /// Colour factor of the view outside, sRGB: at most 1, darker for a dark sky.
    pub fn outdoors_color(&self) -> [f32; 3] {
        let brightest = self.pane.into_iter().fold(1e-3, f32::max);
        let level = self.outdoors.min(1.0).sqrt();
        self.pane.map(|c| (c / brightest).sqrt() * level)
    }
}

/// Largest rotation of the sun at the largest strength, degrees.
const SUN_TURN_DEG: f64 = 65.0;
/// Share of the ambient light from the windows.
const FROM_WINDOWS: f32 = 0.35;
/// Brightness of a sky relative to its colour.
const PANE: f32 = 1.6;
/// Stops of exposure at the largest strength.
const STOPS: f64 = 0.7;
/// Change of red and blue by the white balance at the largest strength.
const BALANCE: f64 = 0.10;
/// Intensity of a lamp at one metre.
const LAMP: f32 = 0.55;

pub(super) fn draw(appearance: &Appearance, file: &AppearanceFile, scene: Lighting) -> Light {
    let plain = Light {
        lighting: scene,
        irradiance: Irradiance::hemispheric(scene.sky, scene.ground),
        lamps: [None; MOST_LAMPS],
        pane: [1.0; 3],
        outdoors: 1.0,
    };
    if appearance.light == 0 {
        return plain;
    }
    let mut random = Random::new(appearance.seed, Row::Light, 0);
    let skies: Vec<&Sky> = file
        .sky
        .iter()
        .filter(|sky| sky.strength <= u32::from(appearance.light))
        .collect();
    let Some(&sky) = random.one_of(&skies) else {
        return plain;
    };
    let turn = random
        .about(SUN_TURN_DEG * share_of(appearance.light))
        .to_radians();
    let height = random.range(sky.elevation_deg).to_radians();
    let warmth = kelvin(random.range(sky.kelvin));
    let dim = random.range([0.85, 1.1]) as f32;

    let [x, y, _] = scene.sun_direction.map(f64::from);
    let east = exact::atan2(y, x) + turn;
    let (sin, cos) = exact::sin_cos(height);
    let towards = [cos * exact::cos(east), cos * exact::sin(east), sin].map(|x| x as f32);
    let pane = sky.color.linear().map(|c| c * sky.brightness * dim);
    // Half of the sky's tint reaches the middle of the room.
    let mean = (pane[0] + pane[1] + pane[2]) / 3.0;
    let tint = pane.map(|c| 0.5 + 0.5 * c / mean.max(1e-3));
    let level = sky.room * dim;
    let around = |c: [f32; 3]| times(c, tint).map(|c| c * level);
    let lighting = Lighting {
        sun_direction: towards,
        sun: warmth.map(|c| c * sky.sun * dim),
        sky: around(scene.sky),
        ground: around(scene.ground),
    };
    let rest = |c: [f32; 3]| c.map(|c| c * (1.0 - FROM_WINDOWS));
    let mut irradiance = Irradiance::hemispheric(rest(lighting.sky), rest(lighting.ground));
    let centre = Point3::from(file.centre);
    for window in &file.window {
        let to: Vector3<f64> = Point3::from(window.at) - centre;
        let area = (window.size[0] * window.size[1]) as f32;
        let far = (to.norm_squared() as f32).max(4.0);
        let light = pane.map(|c| c * PANE * area / far);
        irradiance.add_from(&to.normalize().cast(), light);
    }
    let mut random = Random::new(appearance.seed, Row::Lamps, 0);
    let lamps = std::array::from_fn(|_| {
        let on = random.share() < f64::from(sky.lamps);
        let warmth = kelvin(random.range([2600.0, 4600.0]));
        let strength = LAMP * random.range([0.7, 1.3]) as f32;
        on.then(|| warmth.map(|c| c * strength))
    });
    Light {
        lighting,
        irradiance,
        lamps,
        pane,
        outdoors: (sky.brightness * dim).max(0.03),
    }
}

/// Factor on all light.
pub(super) fn exposure(appearance: &Appearance) -> [f32; 3] {
    if appearance.exposure == 0 {
        return [1.0; 3];
    }
    let share = share_of(appearance.exposure);
    let mut random = Random::new(appearance.seed, Row::Exposure, 0);
    let gain = exact::powf(2.0, random.about(STOPS * share));
    let balance = [
        1.0 + random.about(BALANCE * share),
        1.0,
        1.0 + random.about(BALANCE * share),
    ];
    balance.map(|b| (b * gain) as f32)
}

/// Linear sRGB of a black body at 2000, 3000, … 9000 K, largest component 1 (after
/// Mitchell Charity's table of black-body colours).
const BLACK_BODY: [[f32; 3]; 8] = [
    [1.0, 0.25, 0.01],
    [1.0, 0.46, 0.16],
    [1.0, 0.64, 0.38],
    [1.0, 0.78, 0.61],
    [1.0, 0.89, 0.84],
    [0.96, 0.90, 1.0],
    [0.77, 0.80, 1.0],
    [0.66, 0.73, 1.0],
];

/// Colour of a light of this temperature for a camera that is half balanced to it:
/// linear, with mean 1.
fn kelvin(temperature: f64) -> [f32; 3] {
    let at = ((temperature - 2000.0) / 1000.0).clamp(0.0, 6.999);
    let (row, t) = (at as usize, at.fract() as f32);
    let body: [f32; 3] =
        std::array::from_fn(|k| BLACK_BODY[row][k] * (1.0 - t) + BLACK_BODY[row + 1][k] * t);
    let mean = (body[0] + body[1] + body[2]) / 3.0;
    body.map(|c| 0.5 + 0.5 * c / mean)
}
