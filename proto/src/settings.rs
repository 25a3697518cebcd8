//! Choices of scenarios and recordings: one type each, with one set of names for
//! command lines, TOML and files.

use std::fmt;

use crate::{defaults, v1};

/// A choice among named values.
pub trait Named: Copy + PartialEq + 'static {
    /// Kind of choice, for errors: `quality`.
    const WHAT: &'static str;
    /// Every value.
    const ALL: &'static [Self];
    /// Its name: lower case and `-`.
    fn name(self) -> &'static str;

    /// The value of a name.
    ///
    /// # Errors
    /// [`UnknownName`] with the available names.
    fn from_name(name: &str) -> Result<Self, UnknownName> {
        let found = Self::ALL.iter().find(|value| value.name() == name);
        found.copied().ok_or_else(|| UnknownName {
            what: Self::WHAT,
            name: name.to_owned(),
            known: Self::ALL.iter().map(|value| value.name()).collect(),
        })
    }
}

/// A name that does not exist.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownName {
    what: &'static str,
    name: String,
    known: Vec<&'static str>,
}

impl fmt::Display for UnknownName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, name, known } = self;
        write!(f, "{what} {name:?} is none of {}", known.join(", "))
    }
}

impl std::error::Error for UnknownName {}

/// How simulation time relates to wall time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pacing {
    /// One simulated second per second, slower where the host cannot keep up.
    #[default]
    RealTime,
    /// Waits for the commander at every control tick and for the recorders' credit.
    LockStep,
    /// As fast as possible.
    Fast,
}

impl Named for Pacing {
    const WHAT: &'static str = "pacing";
    const ALL: &'static [Self] = &[Self::RealTime, Self::LockStep, Self::Fast];

    fn name(self) -> &'static str {
        match self {
            Self::RealTime => "real-time",
            Self::LockStep => "lock-step",
            Self::Fast => "fast",
        }
    }
}

impl Pacing {
    /// The value of a message, if set.
    #[must_use]
    pub fn from_proto(code: v1::Pacing) -> Option<Self> {
        match code {
            v1::Pacing::Unspecified => None,
            v1::Pacing::RealTime => Some(Self::RealTime),
            v1::Pacing::LockStep => Some(Self::LockStep),
            v1::Pacing::Fast => Some(Self::Fast),
        }
    }

    /// As an enum of the contract.
    #[must_use]
    pub fn code(self) -> v1::Pacing {
        match self {
            Self::RealTime => v1::Pacing::RealTime,
            Self::LockStep => v1::Pacing::LockStep,
            Self::Fast => v1::Pacing::Fast,
        }
    }
}

/// Rendering effort of an image; recorded with the data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// No shadows.
    Fast,
    /// One shadow map; neither shadows nor edges are filtered.
    Draft,
    /// Filtered shadows, anti-aliased edges, smoothed ambient light.
    #[default]
    Standard,
    /// Soft shadows, four samples per pixel.
    High,
}

impl Named for Quality {
    const WHAT: &'static str = "quality";
    const ALL: &'static [Self] = &[Self::Fast, Self::Draft, Self::Standard, Self::High];

    fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Draft => "draft",
            Self::Standard => "standard",
            Self::High => "high",
        }
    }
}

impl Quality {
    /// The value of a message, if set.
    #[must_use]
    pub fn from_proto(code: v1::RenderQuality) -> Option<Self> {
        match code {
            v1::RenderQuality::Unspecified => None,
            v1::RenderQuality::Fast => Some(Self::Fast),
            v1::RenderQuality::Draft => Some(Self::Draft),
            v1::RenderQuality::Standard => Some(Self::Standard),
            v1::RenderQuality::High => Some(Self::High),
        }
    }

    /// As an enum of the contract.
    #[must_use]
    pub fn code(self) -> v1::RenderQuality {
        match self {
            Self::Fast => v1::RenderQuality::Fast,
            Self::Draft => v1::RenderQuality::Draft,
            Self::Standard => v1::RenderQuality::Standard,
            Self::High => v1::RenderQuality::High,
        }
    }
}

/// Start of the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Starts {
    /// Near the target, facing the shelf, the arm at home and the gripper open.
    #[default]
    Near,
    /// Anywhere in the home from where a path exists, the arm in one of the robot's
    /// postures, the gripper open or closed.
    Anywhere,
}

impl Named for Starts {
    const WHAT: &'static str = "starts";
    const ALL: &'static [Self] = &[Self::Near, Self::Anywhere];

    fn name(self) -> &'static str {
        match self {
            Self::Near => "near",
            Self::Anywhere => "anywhere",
        }
    }
}

impl Starts {
    /// The value of a message, if set.
    #[must_use]
    pub fn from_proto(code: v1::Starts) -> Option<Self> {
        match code {
            v1::Starts::Unspecified => None,
            v1::Starts::Near => Some(Self::Near),
            v1::Starts::Anywhere => Some(Self::Anywhere),
        }
    }

    /// As an enum of the contract.
    #[must_use]
    pub fn code(self) -> v1::Starts {
        match self {
            Self::Near => v1::Starts::Near,
            Self::Anywhere => v1::Starts::Anywhere,
        }
    }
}

/// Motion style of the scripted operator; scenarios contain the name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// As fast as the robot can safely move.
    #[default]
    Quick,
    /// As slowly and smoothly as people with a joystick.
    Human,
}

impl Named for Style {
    const WHAT: &'static str = "style";
    const ALL: &'static [Self] = &[Self::Quick, Self::Human];

    fn name(self) -> &'static str {
        match self {
            Self::Quick => "quick",
            Self::Human => "human",
        }
    }
}

/// Which templates and names of the grammar are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LanguageSplit {
    /// All.
    #[default]
    Any,
    /// Those that are not held out.
    Train,
    /// Held-out ones.
    HeldOut,
}

/// Which objects the tasks of every home place: the same choice.
pub type ObjectSplit = LanguageSplit;

impl Named for LanguageSplit {
    const WHAT: &'static str = "split";
    const ALL: &'static [Self] = &[Self::Any, Self::Train, Self::HeldOut];

    fn name(self) -> &'static str {
        match self {
            Self::Any => "any",
            Self::Train => "train",
            Self::HeldOut => "held_out",
        }
    }
}

impl LanguageSplit {
    /// The value of a message, if set.
    #[must_use]
    pub fn from_proto(code: v1::LanguageSplit) -> Option<Self> {
        match code {
            v1::LanguageSplit::Unspecified => None,
            v1::LanguageSplit::Any => Some(Self::Any),
            v1::LanguageSplit::Train => Some(Self::Train),
            v1::LanguageSplit::HeldOut => Some(Self::HeldOut),
        }
    }

    /// As an enum of the contract.
    #[must_use]
    pub fn code(self) -> v1::LanguageSplit {
        match self {
            Self::Any => v1::LanguageSplit::Any,
            Self::Train => v1::LanguageSplit::Train,
            Self::HeldOut => v1::LanguageSplit::HeldOut,
        }
    }
}

/// How a recording stores depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Depth {
    /// float32 metres, bit for bit as rendered; +inf where nothing is hit.
    #[default]
    Metres,
    /// 16-bit millimetres at half the size, rounded to nearest; 0 where nothing is hit
    /// or the surface is beyond 65.535 m.
    Millimetres,
    /// No depth, for policies that use colour only.
    Nothing,
}

impl Named for Depth {
    const WHAT: &'static str = "depth";
    const ALL: &'static [Self] = &[Self::Metres, Self::Millimetres, Self::Nothing];

    fn name(self) -> &'static str {
        match self {
            Self::Metres => "f32",
            Self::Millimetres => "u16",
            Self::Nothing => "none",
        }
    }
}

impl v1::CameraSetting {
    /// As text, the form that [`Self::from_text`] reads; lens and place are left out.
    #[must_use]
    pub fn text(&self) -> String {
        let rate = self.rate_hz.unwrap_or(defaults::CAMERA_RATE_HZ);
        format!("{}={}x{}@{rate}", self.name, self.width, self.height)
    }

    /// Parses `NAME=WIDTHxHEIGHT@HZ`, for example `gen3=1280x720@10`; the name `*`
    /// means every robot camera that is not named.
    ///
    /// # Errors
    /// The text and the allowed form.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let read = || {
            let (name, rest) = text.split_once('=')?;
            let (size, rate_hz) = match rest.split_once('@') {
                Some((size, rate)) => (size, rate.parse().ok()?),
                None => (rest, defaults::CAMERA_RATE_HZ),
            };
            let (width, height) = size.split_once('x')?;
            let setting = Self {
                name: name.to_owned(),
                width: width.parse().ok()?,
                height: height.parse().ok()?,
                rate_hz: Some(rate_hz),
                ..Self::default()
            };
            (!name.is_empty()).then_some(setting)
        };
        read().ok_or_else(|| {
            format!("{text:?} is not NAME=WIDTHxHEIGHT@HZ, for example *=1280x720@10 for all robot cameras")
        })
    }
}

/// Largest strength of a sensor model.
pub const MAX_SENSOR_STRENGTH: f64 = 3.0;

impl v1::SensorSetting {
    /// As text, the form that [`Self::from_text`] reads.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = self.model.clone();
        if !self.camera.is_empty() {
            text = format!("{text}@{}", self.camera);
        }
        match self.strength {
            Some(strength) => format!("{text}={strength}"),
            None => text,
        }
    }

    /// Parses `MODEL` or `MODEL@CAMERA`, either with `=STRENGTH`, for example
    /// `kinova_vision@gen3=2` or `imu`.
    ///
    /// # Errors
    /// The text and the allowed form.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let read = || {
            let (place, strength) = match text.split_once('=') {
                Some((place, strength)) => (place, Some(strength.parse().ok()?)),
                None => (text, None),
            };
            let (model, camera) = place.split_once('@').unwrap_or((place, ""));
            let setting = Self {
                model: model.to_owned(),
                camera: camera.to_owned(),
                seed: None,
                strength,
            };
            (!model.is_empty()).then_some(setting)
        };
        let range = 0.0..=MAX_SENSOR_STRENGTH;
        let strength = read().and_then(|setting| setting.strength);
        if let Some(strength) = strength.filter(|strength| !range.contains(strength)) {
            return Err(format!(
                "{text:?}: the strength is {strength}; allowed is 0 to {MAX_SENSOR_STRENGTH}"
            ));
        }
        read().ok_or_else(|| {
            format!("{text:?} is not MODEL, MODEL@CAMERA or either with =STRENGTH, for example kinova_vision@gen3=2")
        })
    }
}

/// Reads and writes numbers of messages as text.
pub(crate) mod text {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    use super::Named;

    fn write<T: Named, S: Serializer>(value: Option<T>, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(value.map_or("", T::name))
    }

    fn read<'de, T: Named, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
        let name = String::deserialize(from)?;
        T::from_name(&name).map_err(D::Error::custom)
    }

    /// Whether a number is the unspecified value.
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
    pub fn is_unspecified(number: &i32) -> bool {
        *number == 0
    }

    /// The pacing of a scenario.
    pub mod pacing {
        use super::{Deserializer, Serializer};
        use crate::settings::Pacing;
        use crate::v1;

        #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
        pub fn serialize<S: Serializer>(number: &i32, to: S) -> Result<S::Ok, S::Error> {
            let code = v1::Pacing::try_from(*number).unwrap_or_default();
            super::write(Pacing::from_proto(code), to)
        }

        pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<i32, D::Error> {
            super::read(from).map(|pacing: Pacing| pacing.code().into())
        }
    }

    /// The start of the robot.
    pub mod starts {
        use super::{Deserializer, Serializer};
        use crate::settings::Starts;
        use crate::v1;

        #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
        pub fn serialize<S: Serializer>(number: &i32, to: S) -> Result<S::Ok, S::Error> {
            let code = v1::Starts::try_from(*number).unwrap_or_default();
            super::write(Starts::from_proto(code), to)
        }

        pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<i32, D::Error> {
            super::read(from).map(|starts: Starts| starts.code().into())
        }
    }

    /// The used templates and names.
    pub mod language_split {
        use super::{Deserializer, Serializer};
        use crate::settings::LanguageSplit;
        use crate::v1;

        #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
        pub fn serialize<S: Serializer>(number: &i32, to: S) -> Result<S::Ok, S::Error> {
            let code = v1::LanguageSplit::try_from(*number).unwrap_or_default();
            super::write(LanguageSplit::from_proto(code), to)
        }

        pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<i32, D::Error> {
            super::read(from).map(|split: LanguageSplit| split.code().into())
        }
    }

    /// The quality of a scenario.
    pub mod quality {
        use super::{Deserializer, Serializer};
        use crate::settings::Quality;
        use crate::v1;

        #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
        pub fn serialize<S: Serializer>(number: &i32, to: S) -> Result<S::Ok, S::Error> {
            let code = v1::RenderQuality::try_from(*number).unwrap_or_default();
            super::write(Quality::from_proto(code), to)
        }

        pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<i32, D::Error> {
            super::read(from).map(|quality: Quality| quality.code().into())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_survives_a_round_trip() {
        for pacing in Pacing::ALL {
            assert_eq!(Pacing::from_proto(pacing.code()), Some(*pacing));
            assert_eq!(Pacing::from_name(pacing.name()), Ok(*pacing));
        }
        for quality in Quality::ALL {
            assert_eq!(Quality::from_proto(quality.code()), Some(*quality));
            assert_eq!(Quality::from_name(quality.name()), Ok(*quality));
        }
        for starts in Starts::ALL {
            assert_eq!(Starts::from_proto(starts.code()), Some(*starts));
            assert_eq!(Starts::from_name(starts.name()), Ok(*starts));
        }
        for split in LanguageSplit::ALL {
            assert_eq!(LanguageSplit::from_proto(split.code()), Some(*split));
            assert_eq!(LanguageSplit::from_name(split.name()), Ok(*split));
        }
        assert_eq!(Depth::from_name("u16"), Ok(Depth::Millimetres));
        let camera = v1::CameraSetting::from_text("room=640x360@5").unwrap();
        assert_eq!((camera.name.as_str(), camera.rate_hz), ("room", Some(5.0)));
        assert!(v1::CameraSetting::from_text("room=640").is_err());
        let sensor = v1::SensorSetting::from_text("kinova_vision@gen3=2").unwrap();
        let message = (sensor.model.as_str(), sensor.camera.as_str());
        assert_eq!(
            (message, sensor.strength),
            (("kinova_vision", "gen3"), Some(2.0))
        );
        assert_eq!(sensor.text(), "kinova_vision@gen3=2");
        let imu = v1::SensorSetting::from_text("imu").unwrap();
        assert_eq!(imu.text(), "imu");
        assert_eq!((imu.camera.as_str(), imu.strength), ("", None));
        assert!(v1::SensorSetting::from_text("imu=much").is_err());
        let words = Quality::from_name("best").unwrap_err().to_string();
        assert_eq!(
            words,
            "quality \"best\" is none of fast, draft, standard, high"
        );
    }
}
