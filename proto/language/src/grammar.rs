//! A grammar: templates of sentences, referring phrases, names, places, reasons and
//! politeness, loaded from `assets/language`.

use std::collections::BTreeSet;

use serde::Deserialize;

use crate::space::{Order, Side};

/// Files of a grammar below `assets/language`, in the order of loading.
pub const FILES: [&str; 13] = [
    "nouns.toml",
    "places.toml",
    "phrases.toml",
    "reasons.toml",
    "politeness.toml",
    "homes.toml",
    "categories.toml",
    "lift.toml",
    "put.toml",
    "open.toml",
    "close.toml",
    "bring.toml",
    "give.toml",
];

/// An invalid grammar file.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("language/{file}:{line}: {key} is {found}; allowed: {allowed}")]
pub struct GrammarError {
    /// File below `assets/language`.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Key.
    pub key: String,
    /// Value found.
    pub found: String,
    /// Allowed values.
    pub allowed: String,
}

/// Requested action.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "snake_case")]
pub enum Verb {
    /// Grasp and hold it.
    Lift,
    /// Put it somewhere and release it.
    Put,
    /// Pull it open.
    Open,
    /// Push it closed.
    Close,
    /// Bring it to the mouth.
    Bring,
    /// Put it into the lap.
    Give,
}

impl Verb {
    /// The name in files and reports.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Lift => "lift",
            Self::Put => "put",
            Self::Open => "open",
            Self::Close => "close",
            Self::Bring => "bring",
            Self::Give => "give",
        }
    }
}

/// Which templates and names are used.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// All.
    #[default]
    Any,
    /// Those that are not held out.
    Train,
    /// Held-out templates, and held-out names of the target.
    HeldOut,
}

/// A slot in a pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Slot {
    Object,
    /// A goal alone: `the mat`.
    Goal,
    /// A goal with its preposition of rest: `on the mat`, `in the bin`.
    AtGoal,
    /// A goal with its preposition of motion: `onto the mat`, `into the bin`.
    ToGoal,
    Place,
    /// A place with any understood preposition.
    At,
    /// A place with a preposition of an object's position.
    On,
    /// A place with a preposition of removal.
    From,
    Noun,
    Other,
    Nth,
    /// The posture of the noun as a participle: `standing`.
    Standing,
    /// The posture of the noun as a verb: `stands`.
    Stands,
}

impl Slot {
    pub(crate) const ALL: [(&'static str, Self); 13] = [
        ("object", Self::Object),
        ("goal", Self::Goal),
        ("at_goal", Self::AtGoal),
        ("to_goal", Self::ToGoal),
        ("place", Self::Place),
        ("at", Self::At),
        ("on", Self::On),
        ("from", Self::From),
        ("noun", Self::Noun),
        ("other", Self::Other),
        ("nth", Self::Nth),
        ("standing", Self::Standing),
        ("stands", Self::Stands),
    ];

    /// Slots of goals.
    pub(crate) const GOALS: [Self; 3] = [Self::Goal, Self::AtGoal, Self::ToGoal];
    /// Slots of places with a preposition.
    pub(crate) const PLACES: [Self; 3] = [Self::At, Self::On, Self::From];
}

/// A piece of a pattern.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Piece {
    Word(String),
    Slot(Slot),
    /// The form with a singular or mass noun, and that with a plural one.
    Agreement([String; 2]),
}

/// A text with slots.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pattern {
    /// As it is written.
    pub text: String,
    pub pieces: Vec<Piece>,
}

impl Pattern {
    pub fn has(&self, slot: Slot) -> bool {
        self.pieces.contains(&Piece::Slot(slot))
    }

    pub fn has_any(&self, slots: &[Slot]) -> bool {
        slots.iter().any(|slot| self.has(*slot))
    }
}

/// Meaning of a referring phrase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Means {
    /// By name only.
    Plain,
    /// By the position relative to another entity.
    Beside(Side),
    /// The nearest to another one.
    Next,
    /// Number `place` in an order; `None`: given by `{nth}`.
    Order(Order, Option<usize>),
}

/// Whether a text is generated, and in which split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Use {
    pub held_out: bool,
    /// False: understood but never generated.
    pub is_generated: bool,
}

impl Use {
    /// Whether a split generates it, apart from the target.
    pub fn is_in(self, split: Split) -> bool {
        self.is_generated && (split != Split::Train || !self.held_out)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Phrase {
    pub pattern: Pattern,
    pub means: Means,
    pub of: Use,
}

/// What a name refers to.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Names {
    /// Objects of these kinds.
    Kinds(Vec<String>),
    /// Objects of this category.
    Category(String),
    /// The goal of this name.
    Goal(String),
}

/// Grammatical number of a noun.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Number {
    #[default]
    Singular,
    Plural,
    /// Singular and uncountable: soup.
    Mass,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Noun {
    pub text: String,
    pub words: Vec<String>,
    pub names: Names,
    pub number: Number,
    /// The name refers to the contents, not the container.
    pub is_contents: bool,
    /// A color word may precede it.
    pub takes_colour: bool,
    /// Words follow the noun itself, so that the phrase ends with the name.
    pub has_tail: bool,
    pub of: Use,
}

/// Posture of objects of some kinds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Posture {
    pub participle: String,
    /// With a singular and with a plural noun.
    pub verbs: [String; 2],
    pub kinds: Vec<String>,
}

/// Kind of a goal.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "snake_case")]
pub(crate) enum GoalForm {
    Surface,
    Container,
}

/// The prepositions of some goals.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GoalKind {
    pub goals: Vec<String>,
    pub holds: GoalForm,
    pub at: String,
    pub to: String,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Colour {
    pub name: String,
    pub text: String,
    pub words: Vec<String>,
    pub is_spoken: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlaceName {
    pub area: String,
    pub text: String,
    pub words: Vec<String>,
    /// Prepositions of position, of removal, and those that are only understood.
    pub on: Vec<String>,
    pub from: Vec<String>,
    pub understood: Vec<String>,
    /// A name to which the chair can drive.
    pub is_drive: bool,
    pub of: Use,
}

/// Politeness of a template.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// An imperative: politeness before and after it.
    Request,
    /// A wish: "please" after it.
    Wish,
    /// Neither.
    Statement,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Template {
    /// Stable name: the verb and the words of the text.
    pub id: String,
    pub verb: Verb,
    pub pattern: Pattern,
    pub form: Form,
    /// Kinds that the request accepts, when the text names none.
    pub wants: Vec<String>,
    /// Kinds for which it is used; empty: all.
    pub kinds: Vec<String>,
    /// Goals for which it is used; `None`: all.
    pub holds: Option<GoalForm>,
    /// Its verb removes the object, so that "from the table" may follow.
    pub removes: bool,
    pub of: Use,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reason {
    pub text: String,
    pub words: Vec<String>,
    pub kinds: Vec<String>,
    pub verbs: Vec<Verb>,
}

/// Politeness before a request.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Preamble {
    pub text: String,
    pub words: Vec<String>,
    pub is_question: bool,
    /// A comma separates it.
    pub has_comma: bool,
    /// A form of address: only at the beginning of the utterance, before a reason.
    pub opens: bool,
    pub is_spoken: bool,
}

/// Combination of a reason and a request.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Frame {
    pub text: String,
    pub reason_first: bool,
    /// Words between them.
    pub between: Vec<String>,
}

impl Frame {
    /// The reason and the request together; `opener`: the form of address before both.
    pub fn joined(&self, opener: Option<&str>, reason: &str, request: &str) -> String {
        let text = self.text.replace("{request}", request);
        opened(opener, &text.replace("{reason}", reason))
    }
}

/// The text behind a form of address.
pub(crate) fn opened(opener: Option<&str>, text: &str) -> String {
    match opener {
        Some(opener) => format!("{opener}, {text}"),
        None => text.to_owned(),
    }
}

/// The words of `homes.toml`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct HomeWords {
    /// Kinds and their texts, the usual one first.
    pub rooms: Vec<(Vec<String>, Vec<String>)>,
    pub furniture: Vec<(Vec<String>, Vec<String>)>,
    /// Names of leaves by category.
    pub leaves: Vec<Noun>,
    /// Phrases about leaves.
    pub phrases: Vec<Phrase>,
    /// Phrases about sizes of objects.
    pub sizes: Vec<Phrase>,
    /// Names of objects by category.
    pub categories: Vec<Noun>,
}

/// A grammar.
#[derive(Clone, Debug, PartialEq)]
pub struct Grammar {
    pub(crate) colours: Vec<Colour>,
    pub(crate) nouns: Vec<Noun>,
    pub(crate) postures: Vec<Posture>,
    pub(crate) places: Vec<PlaceName>,
    pub(crate) goals: Vec<GoalKind>,
    pub(crate) phrases: Vec<Phrase>,
    pub(crate) reasons: Vec<Reason>,
    /// Politeness: text and words.
    pub(crate) before: Vec<Preamble>,
    pub(crate) after: Vec<(String, Vec<String>)>,
    /// Words after a request that are only understood.
    pub(crate) understood_after: Vec<Vec<String>>,
    pub(crate) thanks: Vec<(String, Vec<String>)>,
    pub(crate) frames: Vec<Frame>,
    pub(crate) templates: Vec<Template>,
    /// Words that identify a verb when no template matches.
    pub(crate) verb_words: Vec<(String, Verb)>,
    /// Words of homes with rooms and kinds of furniture.
    pub(crate) homes: HomeWords,
    /// All its words.
    pub(crate) vocabulary: BTreeSet<String>,
}

/// Ordinals in sentences.
pub(crate) const NTH: [&str; 6] = ["first", "second", "third", "fourth", "fifth", "sixth"];

impl Grammar {
    /// Number of generated templates, and of held-out ones among them.
    #[must_use]
    pub fn template_count(&self) -> (usize, usize) {
        count(self.templates.iter().map(|t| t.of))
    }

    /// The same for names of objects and goals.
    #[must_use]
    pub fn noun_count(&self) -> (usize, usize) {
        count(self.nouns.iter().map(|n| n.of))
    }

    /// Whether a template is held out.
    #[must_use]
    pub fn is_held_out(&self, template: &str) -> bool {
        let mut found = self.templates.iter().filter(|t| t.id == template);
        found.any(|t| t.of.held_out)
    }

    /// Number of its words, including politeness and words that are only understood.
    #[must_use]
    pub fn word_count(&self) -> usize {
        self.vocabulary.len()
    }

    /// Name of a kind of object: its first name in the files, or the kind itself.
    #[must_use]
    pub fn name_of<'a>(&'a self, kind: &'a str) -> &'a str {
        let names = |noun: &&Noun| match &noun.names {
            Names::Kinds(kinds) => kinds.iter().any(|k| k == kind),
            Names::Goal(goal) => goal == kind,
            Names::Category(_) => false,
        };
        self.nouns
            .iter()
            .find(names)
            .map_or(kind, |noun| noun.text.as_str())
    }

    /// Name of an area.
    #[must_use]
    pub fn area_name<'a>(&'a self, area: &'a str) -> &'a str {
        let place = self.places.iter().find(|place| place.area == area);
        place.map_or(area, |place| place.text.as_str())
    }

    /// The preposition for objects at an area.
    pub(crate) fn preposition(&self, area: &str) -> &str {
        let place = self.places.iter().find(|place| place.area == area);
        place
            .and_then(|p| p.on.first())
            .map_or("at", String::as_str)
    }

    /// Posture verbs of a kind of object, if the grammar has them.
    pub(crate) fn posture(&self, kind: &str) -> Option<&Posture> {
        let fits = |posture: &&Posture| posture.kinds.iter().any(|k| k == kind);
        self.postures.iter().find(fits)
    }

    /// The prepositions of a goal.
    pub(crate) fn goal(&self, name: &str) -> Option<&GoalKind> {
        let fits = |goal: &&GoalKind| goal.goals.iter().any(|g| g == name);
        self.goals.iter().find(fits)
    }
}

fn count(uses: impl Iterator<Item = Use>) -> (usize, usize) {
    let generated: Vec<Use> = uses.filter(|of| of.is_generated).collect();
    (
        generated.len(),
        generated.iter().filter(|of| of.held_out).count(),
    )
}
