//! Layout of the files of a grammar; only the keys are checked here.

use serde::Deserialize;
use toml::Spanned;

use crate::grammar::{GoalForm, Number, Verb};

pub(crate) type Texts = Vec<Spanned<String>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NounsFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub colour: Vec<ColourEntry>,
    pub posture: Vec<PostureEntry>,
    pub noun: Vec<NounEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PostureEntry {
    pub participle: Spanned<String>,
    pub verbs: [Spanned<String>; 2],
    pub of: Spanned<Vec<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ColourEntry {
    pub name: String,
    pub texts: Texts,
    #[serde(default)]
    pub understood: Texts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NounEntry {
    pub of: Option<Vec<String>>,
    pub category: Option<String>,
    pub goal: Option<String>,
    #[serde(default)]
    pub number: Number,
    #[serde(default)]
    pub contents: bool,
    pub colour: Option<bool>,
    #[serde(default)]
    pub tail: bool,
    pub split: Option<Spanned<String>>,
    pub generated: Option<bool>,
    pub texts: Spanned<Texts>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CategoriesFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub noun: Vec<NounEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlacesFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub goal: Vec<GoalEntry>,
    pub place: Vec<PlaceEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GoalEntry {
    pub of: Spanned<Vec<String>>,
    pub holds: GoalForm,
    #[serde(rename = "where")]
    pub at: Spanned<String>,
    pub to: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlaceEntry {
    pub area: String,
    #[serde(rename = "where")]
    pub on: Spanned<Vec<String>>,
    pub from: Spanned<Vec<String>>,
    pub understood: Option<Spanned<Vec<String>>>,
    pub drive: Option<bool>,
    pub split: Option<Spanned<String>>,
    pub generated: Option<bool>,
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
    pub generated: Option<bool>,
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
    pub verbs: Spanned<Vec<Verb>>,
    pub texts: Texts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PolitenessFile {
    pub origin: Spanned<String>,
    pub license: Spanned<String>,
    pub before: Vec<BeforeEntry>,
    pub after: Texts,
    pub understood_before: Texts,
    pub understood_after: Texts,
    pub thanks: Texts,
    pub reasons: Texts,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BeforeEntry {
    #[serde(default)]
    pub question: bool,
    #[serde(default)]
    pub comma: bool,
    #[serde(default)]
    pub opens: bool,
    pub texts: Texts,
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
    pub of: Option<Spanned<Vec<String>>>,
    pub holds: Option<Spanned<GoalForm>>,
    #[serde(default)]
    pub removes: bool,
    pub split: Option<Spanned<String>>,
    pub generated: Option<bool>,
    pub texts: Texts,
}
