//! Looks as text and as settings. Only named axes are on, except in the short form,
//! which is the usual look.

use std::fmt;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::check::Invalid;
use crate::v1::Appearance;

/// Largest strength of an axis.
pub const STRONGEST: u32 = 3;

/// Strength of the axes of the usual look.
const USUAL: u32 = 2;

/// Seed in an appearance's text that means the episode's own seed.
pub const OWN_SEED: &str = "*";

/// An axis of an appearance.
pub struct Axis {
    /// Name in files and options.
    pub name: &'static str,
    /// Reads its strength.
    pub of: fn(&Appearance) -> u32,
    set: fn(&mut Appearance, u32),
    /// Whether the short form of an appearance includes it.
    usual: bool,
}

/// Every axis.
pub const AXES: [Axis; 7] = [
    axis("light", |l| l.light, |l, s| l.light = s, true),
    axis(
        "background",
        |l| l.background,
        |l, s| l.background = s,
        true,
    ),
    axis("materials", |l| l.materials, |l, s| l.materials = s, true),
    axis("exposure", |l| l.exposure, |l, s| l.exposure = s, true),
    axis(
        "decoration",
        |l| l.decoration,
        |l, s| l.decoration = s,
        true,
    ),
    axis("camera", |l| l.camera, |l, s| l.camera = s, false),
    axis("lens", |l| l.lens, |l, s| l.lens = s, false),
];

const fn axis(
    name: &'static str,
    of: fn(&Appearance) -> u32,
    set: fn(&mut Appearance, u32),
    usual: bool,
) -> Axis {
    Axis {
        name,
        of,
        set,
        usual,
    }
}

impl Appearance {
    /// The usual look of a seed: all but the cameras at strength 2.
    #[must_use]
    pub fn usual(seed: u64) -> Self {
        let mut appearance = Self {
            seed,
            ..Self::default()
        };
        for axis in AXES.iter().filter(|axis| axis.usual) {
            (axis.set)(&mut appearance, USUAL);
        }
        appearance
    }

    /// Whether every axis is off.
    #[must_use]
    pub fn is_off(&self) -> bool {
        AXES.iter().all(|axis| (axis.of)(self) == 0)
    }

    /// Rejects an invalid strength.
    ///
    /// # Errors
    /// The axis, what was found and what is allowed.
    pub fn check(&self) -> Result<(), Invalid> {
        for axis in &AXES {
            let strength = f64::from((axis.of)(self));
            crate::check::within(axis.name, strength, 0.0, f64::from(STRONGEST)).map_err(
                |source| Invalid::In {
                    place: "appearance".to_owned(),
                    source: Box::new(source),
                },
            )?;
        }
        Ok(())
    }
}

/// An appearance in options and plans: `7` for the usual look of seed 7, `7:light=3,camera=1`
/// for these axes only, `*` in place of the seed for each episode's own seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AppearanceText {
    /// `None`: each episode's own seed.
    seed: Option<u64>,
    appearance: Appearance,
}

impl AppearanceText {
    /// Each episode's own seed with every axis off.
    #[must_use]
    pub fn own() -> Self {
        Self {
            seed: None,
            appearance: Appearance::default(),
        }
    }

    /// The same with another strength of the axis named `axis`.
    #[must_use]
    pub fn with_axis(mut self, axis: &str, strength: u32) -> Self {
        let found = AXES.iter().find(|known| known.name == axis);
        debug_assert!(found.is_some(), "{axis} is an axis");
        if let Some(found) = found {
            (found.set)(&mut self.appearance, strength);
        }
        self
    }

    /// Reads `SEED[:AXIS=STRENGTH,…]`.
    ///
    /// # Errors
    /// The text found and the allowed form.
    pub fn read(text: &str) -> Result<Self, String> {
        let (seed, axes) = match text.split_once(':') {
            Some((seed, axes)) => (seed, Some(axes)),
            None => (text, None),
        };
        let seed = match seed {
            OWN_SEED => None,
            number => Some(number.parse().map_err(|_| {
                format!(
                    "appearance {text:?} begins with {number:?}, expected a seed (0 to {}) or `*` for \
                     each episode's own; for example 7, or 7:light=3,camera=1",
                    u64::MAX
                )
            })?),
        };
        let Some(axes) = axes else {
            let appearance = Appearance::usual(0);
            return Ok(Self { seed, appearance });
        };
        let mut appearance = Appearance::default();
        for entry in axes.split(',') {
            let (name, strength) = entry.split_once('=').ok_or_else(|| {
                format!(
                    "appearance {text:?} has {entry:?}, expected AXIS=STRENGTH, for example light=3"
                )
            })?;
            let axis = AXES.iter().find(|axis| axis.name == name).ok_or_else(|| {
                let known: Vec<_> = AXES.iter().map(|axis| axis.name).collect();
                format!(
                    "appearance has the axis {name:?}, expected one of {}",
                    known.join(", ")
                )
            })?;
            let strength = strength.parse().ok().filter(|s| *s <= STRONGEST);
            let strength = strength.ok_or_else(|| {
                format!("appearance has {entry:?}, expected a strength of 0 (off), 1, 2 or 3")
            })?;
            (axis.set)(&mut appearance, strength);
        }
        Ok(Self { seed, appearance })
    }

    /// The appearance of an episode.
    #[must_use]
    pub fn for_episode(&self, episode_seed: u64) -> Appearance {
        self.seeded(self.seed.unwrap_or(episode_seed))
    }

    /// The same axes with another seed.
    #[must_use]
    pub fn seeded(&self, seed: u64) -> Appearance {
        Appearance {
            seed,
            ..self.appearance
        }
    }
}

impl fmt::Display for AppearanceText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.seed {
            Some(_) => write!(f, "{}", self.for_episode(0)),
            None => {
                f.write_str(OWN_SEED)?;
                write_axes(f, &self.appearance)
            }
        }
    }
}

impl fmt::Display for Appearance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.seed)?;
        write_axes(f, self)
    }
}

fn write_axes(f: &mut fmt::Formatter<'_>, appearance: &Appearance) -> fmt::Result {
    let on = AXES.iter().filter(|axis| (axis.of)(appearance) > 0);
    for (i, axis) in on.enumerate() {
        let before = if i == 0 { ':' } else { ',' };
        write!(f, "{before}{}={}", axis.name, (axis.of)(appearance))?;
    }
    Ok(())
}

impl<'de> Deserialize<'de> for AppearanceText {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        Self::read(&text).map_err(D::Error::custom)
    }
}

/// Reads the strength of an axis.
pub(crate) fn strength<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    let found = i64::deserialize(from)?;
    u32::try_from(found)
        .ok()
        .filter(|strength| *strength <= STRONGEST)
        .ok_or_else(|| D::Error::custom(format!("strength {found}, expected 0 (off), 1, 2 or 3")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_are_parsed_and_errors_name_the_wrong_part() {
        let usual = AppearanceText::read("7").unwrap();
        assert_eq!(usual.for_episode(1), Appearance::usual(7));
        assert_eq!(
            (Appearance::usual(7).light, Appearance::usual(7).camera),
            (2, 0)
        );
        let own = AppearanceText::read("*:light=3,camera=1").unwrap();
        let appearance = own.for_episode(5);
        assert_eq!(
            (appearance.seed, appearance.light, appearance.camera),
            (5, 3, 1)
        );
        assert_eq!((appearance.background, own.seeded(9).seed), (0, 9));
        assert!(
            !appearance.is_off()
                && AppearanceText::read("1:light=0")
                    .unwrap()
                    .for_episode(0)
                    .is_off()
        );
        for text in ["7:light=2,lens=3", "*:exposure=1"] {
            assert_eq!(AppearanceText::read(text).unwrap().to_string(), text);
        }
        for (text, words) in [
            ("seven", "\"seven\", expected a seed"),
            ("7:light", "expected AXIS=STRENGTH"),
            ("7:lihgt=2", "expected one of light, background"),
            ("7:light=4", "\"light=4\", expected a strength of 0"),
        ] {
            let message = AppearanceText::read(text).unwrap_err();
            assert!(message.contains(words), "{message}");
        }
        let wrong = Appearance {
            lens: 9,
            ..Appearance::default()
        };
        let message = wrong.check().unwrap_err().to_string();
        assert!(
            message.contains("appearance") && message.contains("lens is 9"),
            "{message}"
        );
    }
}
