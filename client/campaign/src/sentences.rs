//! Sentences of the grammar for a plan, a split or an evaluation, several per scene.

use std::ops::Range;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use wheelarm_proto::settings::{LanguageSplit, Named};
use wheelarm_proto::v1;

/// Settings of the sentences.
#[derive(Clone, Debug, PartialEq)]
pub struct Language {
    /// Seed of the first sentence of a scene; the next ones follow.
    pub seed: u64,
    /// Templates and names that are used.
    pub split: LanguageSplit,
    /// Share of sentences with a typing error, 0 to 1.
    pub typos: f64,
    /// Share of sentences with politeness, 0 to 1.
    pub politeness: f64,
    /// Share of sentences that match several objects, 0 to 1.
    pub ambiguous: f64,
    /// Consecutive episodes with one scene, each with another sentence.
    pub sentences: u32,
}

/// `[variation.language]` of a plan or a split.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LanguageFile {
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
    sentences: Spanned<u32>,
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
    /// The checked settings.
    ///
    /// # Errors
    /// Position of the mistake in the text, bytes, and the allowed values.
    pub fn checked(self) -> Result<Language, (Range<usize>, String)> {
        for (key, share) in [
            ("typos", &self.typos),
            ("politeness", &self.politeness),
            ("ambiguous", &self.ambiguous),
        ] {
            let value = share.get_ref();
            if !(0.0..=1.0).contains(value) {
                let what = format!("language.{key} is {value}; it is a share, 0 to 1");
                return Err((share.span(), what));
            }
        }
        if *self.sentences.get_ref() == 0 {
            let what = "language.sentences is 0; at least 1 is needed".to_owned();
            return Err((self.sentences.span(), what));
        }
        Ok(Language {
            seed: self.seed,
            split: self.split,
            typos: self.typos.into_inner(),
            politeness: self.politeness.into_inner(),
            ambiguous: self.ambiguous.into_inner(),
            sentences: self.sentences.into_inner(),
        })
    }
}

impl Language {
    /// One sentence for each scene, without typing errors, half of them polite.
    #[must_use]
    pub fn new(seed: u64, split: LanguageSplit) -> Self {
        Self {
            seed,
            split,
            typos: 0.0,
            politeness: 0.5,
            ambiguous: 0.0,
            sentences: 1,
        }
    }

    /// Index of the scene, and of its sentence, of an episode of a task, both from 0.
    #[must_use]
    pub fn place(&self, index: u32) -> (u32, u32) {
        (index / self.sentences, index % self.sentences)
    }

    /// The message for a scenario, with sentence number `sentence` of its scene.
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
