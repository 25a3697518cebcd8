//! Looks as text and as settings. No axis is on that was not named, except by
//! the short form, which is the usual look.

use std::fmt;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::check::Invalid;
use crate::v1::Look;

/// Greatest strength of an axis.
pub const STRONGEST: u32 = 3;

/// Strength of the axes that the usual look has.
const USUAL: u32 = 2;

/// Seeds of a look's text: the episode's own.
pub const OWN_SEED: &str = "*";

/// An axis of a look.
pub struct Axis {
    /// Name in files and options.
    pub name: &'static str,
    /// Reads its strength.
    pub of: fn(&Look) -> u32,
    set: fn(&mut Look, u32),
    /// Whether the short form of a look has it.
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
    of: fn(&Look) -> u32,
    set: fn(&mut Look, u32),
    usual: bool,
) -> Axis {
    Axis {
        name,
        of,
        set,
        usual,
    }
}

impl Look {
    /// The usual look of a seed: all but the cameras at strength 2.
    #[must_use]
    pub fn usual(seed: u64) -> Self {
        let mut look = Self {
            seed,
            ..Self::default()
        };
        for axis in AXES.iter().filter(|axis| axis.usual) {
            (axis.set)(&mut look, USUAL);
        }
        look
    }

    /// Whether every axis is off.
    #[must_use]
    pub fn is_off(&self) -> bool {
        AXES.iter().all(|axis| (axis.of)(self) == 0)
    }

    /// Refuses a strength that is none.
    ///
    /// # Errors
    /// The axis, what was found and what is allowed.
    pub fn check(&self) -> Result<(), Invalid> {
        for axis in &AXES {
            let strength = f64::from((axis.of)(self));
            crate::check::within(axis.name, strength, 0.0, f64::from(STRONGEST)).map_err(
                |source| Invalid::In {
                    place: "look".to_owned(),
                    source: Box::new(source),
                },
            )?;
        }
        Ok(())
    }
}

/// A look as options and plans write it: `7` for the usual look of seed 7,
/// `7:light=3,camera=1` for these axes alone, `*` in the place of the seed for
/// each episode's own seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LookText {
    /// `None`: each episode's own.
    seed: Option<u64>,
    look: Look,
}

impl LookText {
    /// Each episode's own seed with every axis off.
    #[must_use]
    pub fn own() -> Self {
        Self {
            seed: None,
            look: Look::default(),
        }
    }

    /// The same with an axis at another strength; `axis` is the name of one.
    #[must_use]
    pub fn with(mut self, axis: &str, strength: u32) -> Self {
        let found = AXES.iter().find(|known| known.name == axis);
        debug_assert!(found.is_some(), "{axis} is an axis");
        if let Some(found) = found {
            (found.set)(&mut self.look, strength);
        }
        self
    }

    /// Reads `SEED[:AXIS=STRENGTH,…]`.
    ///
    /// # Errors
    /// What was found and what is allowed.
    pub fn read(text: &str) -> Result<Self, String> {
        let (seed, axes) = match text.split_once(':') {
            Some((seed, axes)) => (seed, Some(axes)),
            None => (text, None),
        };
        let seed = match seed {
            OWN_SEED => None,
            number => Some(number.parse().map_err(|_| {
                format!(
                    "look {text:?} begins with {number:?}, expected a seed (0 to {}) or `*` for \
                     each episode's own; for example 7, or 7:light=3,camera=1",
                    u64::MAX
                )
            })?),
        };
        let Some(axes) = axes else {
            let look = Look::usual(0);
            return Ok(Self { seed, look });
        };
        let mut look = Look::default();
        for entry in axes.split(',') {
            let (name, strength) = entry.split_once('=').ok_or_else(|| {
                format!("look {text:?} has {entry:?}, expected AXIS=STRENGTH, for example light=3")
            })?;
            let axis = AXES.iter().find(|axis| axis.name == name).ok_or_else(|| {
                let known: Vec<_> = AXES.iter().map(|axis| axis.name).collect();
                format!(
                    "look has the axis {name:?}, expected one of {}",
                    known.join(", ")
                )
            })?;
            let strength = strength.parse().ok().filter(|s| *s <= STRONGEST);
            let strength = strength.ok_or_else(|| {
                format!("look has {entry:?}, expected a strength of 0 (off), 1, 2 or 3")
            })?;
            (axis.set)(&mut look, strength);
        }
        Ok(Self { seed, look })
    }

    /// The look of an episode.
    #[must_use]
    pub fn of(&self, episode_seed: u64) -> Look {
        self.seeded(self.seed.unwrap_or(episode_seed))
    }

    /// The same axes with another seed.
    #[must_use]
    pub fn seeded(&self, seed: u64) -> Look {
        Look { seed, ..self.look }
    }
}

impl fmt::Display for LookText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.seed {
            Some(_) => write!(f, "{}", self.of(0)),
            None => {
                f.write_str(OWN_SEED)?;
                write_axes(f, &self.look)
            }
        }
    }
}

impl fmt::Display for Look {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.seed)?;
        write_axes(f, self)
    }
}

fn write_axes(f: &mut fmt::Formatter<'_>, look: &Look) -> fmt::Result {
    let on = AXES.iter().filter(|axis| (axis.of)(look) > 0);
    for (i, axis) in on.enumerate() {
        let before = if i == 0 { ':' } else { ',' };
        write!(f, "{before}{}={}", axis.name, (axis.of)(look))?;
    }
    Ok(())
}

impl<'de> Deserialize<'de> for LookText {
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
    fn a_look_is_read_and_written_and_what_is_wrong_is_named() {
        let usual = LookText::read("7").unwrap();
        assert_eq!(usual.of(1), Look::usual(7));
        assert_eq!((Look::usual(7).light, Look::usual(7).camera), (2, 0));
        let own = LookText::read("*:light=3,camera=1").unwrap();
        let look = own.of(5);
        assert_eq!((look.seed, look.light, look.camera), (5, 3, 1));
        assert_eq!((look.background, own.seeded(9).seed), (0, 9));
        assert!(!look.is_off() && LookText::read("1:light=0").unwrap().of(0).is_off());
        for text in ["7:light=2,lens=3", "*:exposure=1"] {
            assert_eq!(LookText::read(text).unwrap().to_string(), text);
        }
        for (text, words) in [
            ("seven", "\"seven\", expected a seed"),
            ("7:light", "expected AXIS=STRENGTH"),
            ("7:lihgt=2", "expected one of light, background"),
            ("7:light=4", "\"light=4\", expected a strength of 0"),
        ] {
            let told = LookText::read(text).unwrap_err();
            assert!(told.contains(words), "{told}");
        }
        let wrong = Look {
            lens: 9,
            ..Look::default()
        };
        let told = wrong.check().unwrap_err().to_string();
        assert!(
            told.contains("look") && told.contains("lens is 9"),
            "{told}"
        );
    }
}
