//! How a plan says its tasks: sentences by the grammar, several for one scene.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use wheelarm_proto::settings::{LanguageSplit, Named};
use wheelarm_proto::v1;

/// How tasks are said.
#[derive(Clone, Debug, PartialEq)]
pub struct Language {
    /// Seed of the first sentence of a scene; the next ones follow.
    pub seed: u64,
    /// Which templates and names are said.
    pub split: LanguageSplit,
    /// Share of sentences with a typing error, 0 to 1.
    pub typos: f64,
    /// Share of sentences with politeness, 0 to 1.
    pub politeness: f64,
    /// Share of sentences that may mean several things, 0 to 1.
    pub ambiguous: f64,
    /// Episodes in a row with one scene, each with a sentence of its own.
    pub sentences: u32,
}

/// `[language]` of a plan.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LanguageFile {
    #[serde(default)]
    seed: u64,
    #[serde(default, deserialize_with = "split")]
    split: LanguageSplit,
    #[serde(default = "none")]
    typos: Spanned<f64>,
    #[serde(default = "half")]
    politeness: Spanned<f64>,
    #[serde(default = "none")]
    ambiguous: Spanned<f64>,
    #[serde(default = "one")]
    pub sentences: Spanned<u32>,
}

fn split<'de, D: Deserializer<'de>>(from: D) -> Result<LanguageSplit, D::Error> {
    let name = String::deserialize(from)?;
    LanguageSplit::from_name(&name).map_err(D::Error::custom)
}
fn none() -> Spanned<f64> {
    Spanned::new(0..0, 0.0)
}
fn half() -> Spanned<f64> {
    Spanned::new(0..0, 0.5)
}
fn one() -> Spanned<u32> {
    Spanned::new(0..0, 1)
}

impl LanguageFile {
    /// The shares with their keys.
    pub fn shares(&self) -> [(&'static str, &Spanned<f64>); 3] {
        [
            ("typos", &self.typos),
            ("politeness", &self.politeness),
            ("ambiguous", &self.ambiguous),
        ]
    }

    pub fn checked(self) -> Language {
        Language {
            seed: self.seed,
            split: self.split,
            typos: self.typos.into_inner(),
            politeness: self.politeness.into_inner(),
            ambiguous: self.ambiguous.into_inner(),
            sentences: self.sentences.into_inner(),
        }
    }
}

impl Language {
    /// Which scene and which sentence of it an episode of a task has, both from 0.
    #[must_use]
    pub fn place(&self, index: u32) -> (u32, u32) {
        (index / self.sentences, index % self.sentences)
    }

    /// As a scenario says it, with sentence number `sentence` of its scene.
    #[must_use]
    pub fn message(&self, sentence: u32) -> v1::Language {
        v1::Language {
            seed: self.seed.wrapping_add(u64::from(sentence)),
            split: self.split.code().into(),
            typo_share: self.typos,
            politeness_share: Some(self.politeness),
            ambiguous_share: self.ambiguous,
            ..v1::Language::default()
        }
    }

    /// As one line, for the settings of an episode.
    #[must_use]
    pub fn words(&self, sentence: u32) -> String {
        format!(
            " language={}/{}/{}/{}/{}",
            self.seed.wrapping_add(u64::from(sentence)),
            self.split.name(),
            self.typos,
            self.politeness,
            self.ambiguous
        )
    }
}
