//! Axes of difficulty of a test set for `--axis` and the splits, each in three strengths.
//! The samples of an axis follow from the seed of the episode, so that a set is repeatable.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use wheelarm_proto::appearance::AppearanceText;
use wheelarm_proto::settings::{LanguageSplit, Named};
use wheelarm_proto::v1;

use crate::sentences::Language;
use crate::variation::Variation;

/// An axis of difficulty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Places and lenses of the robot's cameras.
    Camera,
    /// Noise of the IMU, the joints' encoders and the odometry.
    Noise,
    /// Light and exposure.
    Light,
    /// Walls, floor, furniture's materials, decoration.
    Background,
    /// Layout of the table: share of scenes with the teddy bear, in thirds.
    Layout,
    /// Another specimen of the robot (1), starts anywhere (2), both (3).
    Robot,
    /// Sentences by the grammar: of the training's split (1), held out (2), held out
    /// with typing errors (3).
    Language,
    /// Sensor models of the cameras: depth with noise, holes and shadows, colour with
    /// noise, both late.
    Depth,
    /// Delay from a command to the control.
    Delay,
}

impl Named for Axis {
    const WHAT: &'static str = "axis";
    const ALL: &'static [Self] = &[
        Self::Camera,
        Self::Noise,
        Self::Light,
        Self::Background,
        Self::Layout,
        Self::Robot,
        Self::Language,
        Self::Depth,
        Self::Delay,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Noise => "noise",
            Self::Light => "light",
            Self::Background => "background",
            Self::Layout => "layout",
            Self::Robot => "robot",
            Self::Language => "language",
            Self::Depth => "depth",
            Self::Delay => "delay",
        }
    }
}

/// Specimens of the robot from which its axis samples.
const SPECIMENS: u32 = 20;
/// Share of sentences with a typing error at the greatest strength.
const TYPOS: f64 = 0.5;

/// An axis at a strength, 1 to 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisAt(Axis, u32);

impl AxisAt {
    /// The axis.
    #[must_use]
    pub fn axis(&self) -> Axis {
        self.0
    }

    /// Whether it needs other layouts.
    #[must_use]
    pub fn is_layout(&self) -> bool {
        self.0 == Axis::Layout
    }

    /// Reads `AXIS=STRENGTH`, for example `light=2`.
    ///
    /// # Errors
    /// The value and the allowed ones.
    pub fn read(text: &str) -> Result<Self, String> {
        let form = || format!("{text:?} is not AXIS=STRENGTH, for example light=2");
        let (name, strength) = text.split_once('=').ok_or_else(form)?;
        let axis = Axis::from_name(name).map_err(|unknown| unknown.to_string())?;
        let strength = strength.parse().ok().filter(|s| (1..=3).contains(s));
        let strength = strength.ok_or_else(|| format!("{text:?}: a strength is 1, 2 or 3"))?;
        Ok(Self(axis, strength))
    }
}

impl<'de> Deserialize<'de> for AxisAt {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        Self::read(&text).map_err(D::Error::custom)
    }
}

impl Variation {
    /// Sets one axis and keeps the others.
    pub fn set(&mut self, AxisAt(axis, strength): AxisAt) {
        let mut appearances = |axes: &[&str]| {
            let appearance = self.appearance.unwrap_or_else(AppearanceText::own);
            self.appearance = Some(axes.iter().fold(appearance, |appearance, axis| {
                appearance.with_axis(axis, strength)
            }));
        };
        match axis {
            Axis::Camera => appearances(&["camera", "lens"]),
            Axis::Light => appearances(&["light", "exposure"]),
            Axis::Background => appearances(&["background", "materials", "decoration"]),
            Axis::Noise => self.sense(&["imu", "encoders", "odometry"], strength),
            Axis::Depth => self.sense(&["kinova_vision@gen3", "chair_stereo@wheelchair"], strength),
            Axis::Delay => self.sense(&["command"], strength),
            Axis::Layout => self.scenario.variant_share = Some(f64::from(strength) / 3.0),
            Axis::Robot => {
                if strength != 2 {
                    self.specimens = SPECIMENS;
                }
                if strength >= 2 {
                    self.scenario.set_starts(v1::Starts::Anywhere);
                }
            }
            Axis::Language => {
                let (split, typos) = match strength {
                    1 => (LanguageSplit::Train, 0.0),
                    2 => (LanguageSplit::HeldOut, 0.0),
                    _ => (LanguageSplit::HeldOut, TYPOS),
                };
                self.language = Some(Language {
                    typos,
                    ..Language::new(0, split)
                });
            }
        }
    }

    /// Adds sensor models, in the place of those of the same name.
    fn sense(&mut self, models: &[&str], strength: u32) {
        for place in models {
            let (model, camera) = place.split_once('@').unwrap_or((place, ""));
            self.scenario
                .sensors
                .retain(|known| (known.model.as_str(), known.camera.as_str()) != (model, camera));
            self.scenario.sensors.push(v1::SensorSetting {
                model: model.to_owned(),
                camera: camera.to_owned(),
                seed: None,
                strength: Some(f64::from(strength)),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_changes_the_scenario_by_itself_and_in_three_strengths() {
        let of = |variation: &Variation| format!("{:?}", variation.for_episode(500));
        let mut known = vec![of(&Variation::default())];
        for axis in Axis::ALL {
            for strength in 1..=3 {
                let mut variation = Variation::default();
                let at = AxisAt::read(&format!("{}={strength}", axis.name())).unwrap();
                variation.set(at);
                let text = of(&variation);
                assert!(!known.contains(&text), "{at:?} is like another");
                assert!(!variation.words(0).is_empty(), "{at:?}");
                known.push(text);
            }
        }
        for (bad, words) in [
            ("light", "AXIS=STRENGTH"),
            ("lights=1", "camera, noise, light"),
            ("light=0", "1, 2 or 3"),
            ("light=4", "1, 2 or 3"),
        ] {
            assert!(AxisAt::read(bad).unwrap_err().contains(words), "{bad}");
        }
    }
}
