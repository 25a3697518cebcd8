//! How the files of a grammar look; nothing checked but the keys.

use serde::Deserialize;
use toml::Spanned;

use crate::grammar::Verb;

pub(crate) type Texts = Vec<Spanned<String>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NounsFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub colour: Vec<ColourEntry>,
    pub noun: Vec<NounEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ColourEntry {
    pub name: String,
    pub texts: Texts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NounEntry {
    pub of: Option<Vec<String>>,
    pub category: Option<String>,
    pub goal: Option<String>,
    pub split: Option<Spanned<String>>,
    pub said: Option<bool>,
    pub texts: Spanned<Texts>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlacesFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub place: Vec<PlaceEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlaceEntry {
    pub area: String,
    pub prepositions: Spanned<Vec<String>>,
    pub split: Option<Spanned<String>>,
    pub said: Option<bool>,
    pub texts: Texts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PhrasesFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub phrase: Vec<PhraseEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PhraseEntry {
    pub means: Spanned<String>,
    pub split: Option<Spanned<String>>,
    pub said: Option<bool>,
    pub texts: Texts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReasonsFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub reason: Vec<ReasonEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReasonEntry {
    pub of: Spanned<Vec<String>>,
    pub verb: Option<Verb>,
    pub texts: Texts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PolitenessFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub before: Texts,
    pub after: Texts,
    pub thanks: Texts,
    pub reasons: Texts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct VerbFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub verb: Verb,
    pub words: Vec<String>,
    pub template: Vec<TemplateEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TemplateEntry {
    pub form: Option<Spanned<String>>,
    pub wants: Option<Spanned<Vec<String>>>,
    pub split: Option<Spanned<String>>,
    pub said: Option<bool>,
    pub texts: Texts,
}
