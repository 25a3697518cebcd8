//! The wording of a request: combines words by number, contents, color, posture and
//! preposition as defined in the grammar's files. The generator chooses at random;
//! `agreement_tests` tries every choice.

use crate::grammar::{
    GoalForm, Grammar, Means, NTH, Noun, Number, Pattern, Phrase, Piece, Slot, Template, Verb,
};
use crate::meaning::{Meaning, Named};
use crate::scene::Scene;
use crate::space::Order;

/// A place: index of its name, and the preposition before it.
pub(crate) type At<'a> = (usize, &'a str);

/// A choice of words for an object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObjectWords<'a> {
    pub phrase: &'a Phrase,
    pub name: Named,
    pub at: Option<At<'a>>,
    pub other: Option<Named>,
    pub nth: Option<usize>,
}

/// A choice of words for a request.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RequestWords<'a> {
    pub template: &'a Template,
    pub object: Option<ObjectWords<'a>>,
    /// Name of the goal.
    pub goal: Option<usize>,
    /// Name of the place to which the chair drives.
    pub place: Option<usize>,
    /// Place in the template itself.
    pub at: Option<At<'a>>,
}

/// Particles that are unclear after a long object.
const PARTICLES: [&str; 12] = [
    "up", "open", "out", "shut", "closed", "in", "back", "a", "down", "lifted", "picked", "wide",
];
/// Largest number of words of an object before such a particle.
const SHORT: usize = 4;
/// Words after which a template takes no adverb.
const ADVERBS: [&str; 4] = ["gently", "completely", "all the way", "a little"];
/// Words that begin a clause. An adverb behind the clause belongs to it: "the drawer
/// counting from the top slowly", "the table where we eat now".
const CLAUSES: [&str; 8] = [
    " that ",
    " which ",
    " where ",
    " counting ",
    " count ",
    " until ",
    " so that ",
    "{ends/end} up",
];

impl RequestWords<'_> {
    /// The request as text, lower case and without politeness; `None` when the words do
    /// not agree.
    pub fn text(&self, grammar: &Grammar, scene: &Scene, meaning: &Meaning) -> Option<String> {
        let template = self.template;
        let target = &scene.entities[meaning.target];
        if !template.kinds.is_empty() && !template.kinds.contains(&target.kind) {
            return None;
        }
        let mut text = template.pattern.text.clone();
        if let Some(object) = &self.object {
            let noun = &grammar.nouns[object.name.noun];
            let words = object.text(grammar, &target.kind)?;
            if !takes_object(template, object.phrase, &words) {
                return None;
            }
            if self
                .places()
                .any(|p| repeats(&grammar.places[p].text, &noun.text))
            {
                return None;
            }
            text = inflected(&text, noun.number).replace("{object}", &words);
        }
        if let Some(goal) = meaning.goal {
            let kind = grammar.goal(&scene.entities[goal].name)?;
            if template.holds.is_some_and(|holds| holds != kind.holds) {
                return None;
            }
            let goal_words = &grammar.nouns[self.goal?].text;
            if self
                .places()
                .any(|p| repeats(&grammar.places[p].text, goal_words))
            {
                return None;
            }
            // The container is thrown away: its contents are gone.
            let noun = self.object.map(|object| &grammar.nouns[object.name.noun]);
            if kind.holds == GoalForm::Container && noun.is_some_and(|noun| noun.is_contents) {
                return None;
            }
            let the = format!("the {goal_words}");
            text = text
                .replace("{at_goal}", &format!("{} {the}", kind.at))
                .replace("{to_goal}", &format!("{} {the}", kind.to))
                .replace("{goal}", &the);
        } else if template.verb == Verb::Put {
            return None;
        }
        if template.pattern.has(Slot::Place) {
            let place = &grammar.places[self.place?];
            if !place.is_drive {
                return None;
            }
            text = text.replace("{place}", &place.text);
        }
        with_place(&text, &template.pattern, grammar, self.at)
    }

    /// The places in the text, of the template or of the object.
    fn places(&self) -> impl Iterator<Item = usize> {
        let pattern = &self.template.pattern;
        let driven = self.place.filter(|_| pattern.has(Slot::Place));
        let own = self.at.filter(|_| pattern.has_any(&Slot::PLACES));
        let object = self
            .object
            .filter(|o| o.phrase.pattern.has_any(&Slot::PLACES));
        let object = object.and_then(|object| object.at);
        let places = own.into_iter().chain(object).map(|(place, _)| place);
        driven.into_iter().chain(places)
    }

    /// Whether an adverb behind the request belongs to its verb.
    pub fn takes_adverb(&self, grammar: &Grammar) -> bool {
        let has_clause = |text: &str| CLAUSES.iter().any(|words| text.contains(words));
        let in_object = self.object.is_some_and(|object| {
            let pattern = &object.phrase.pattern;
            has_clause(&pattern.text) || pattern.has(Slot::Standing)
        });
        let in_place = self.places().any(|p| has_clause(&grammar.places[p].text));
        let text = &self.template.pattern.text;
        let has_adverb = ADVERBS.iter().any(|adverb| text.contains(adverb));
        let is_free = !in_object && !in_place && !has_clause(text) && !has_adverb;
        is_free && self.template.wants.is_empty()
    }
}

impl ObjectWords<'_> {
    /// The words for an object of this kind; `None` when they do not agree.
    pub fn text(&self, grammar: &Grammar, kind: &str) -> Option<String> {
        let noun = &grammar.nouns[self.name.noun];
        let pattern = &self.phrase.pattern;
        let posture = grammar.posture(kind);
        let has_posture = pattern.has_any(&[Slot::Standing, Slot::Stands]);
        let is_counted = matches!(self.phrase.means, Means::Order(..));
        if (has_posture && (posture.is_none() || noun.is_contents))
            || (is_counted && (noun.number != Number::Singular || noun.is_contents))
            || (noun.has_tail && !ends_with_noun(pattern))
            || (pattern.has(Slot::Nth) && self.nth == Some(0) && !counts_first(self.phrase))
        {
            return None;
        }
        if pattern.has_any(&Slot::PLACES) && repeats(&grammar.places[self.at?.0].text, &noun.text) {
            return None;
        }
        let mut text = inflected(&pattern.text, noun.number);
        if let Some(posture) = posture {
            let verb = &posture.verbs[usize::from(noun.number == Number::Plural)];
            text = text
                .replace("{standing}", &posture.participle)
                .replace("{stands}", verb);
        }
        text = text.replace("{noun}", &name(grammar, self.name)?);
        if pattern.has(Slot::Other) {
            text = text.replace("{other}", &format!("the {}", name(grammar, self.other?)?));
        }
        if pattern.has(Slot::Nth) {
            text = text.replace("{nth}", NTH.get(self.nth?)?);
        }
        with_place(&text, pattern, grammar, self.at)
    }
}

/// Whether "first" is spoken in a phrase: before its noun, from the left or the right.
/// The first from the top is the top one.
fn counts_first(phrase: &Phrase) -> bool {
    let is_upright = matches!(phrase.means, Means::Order(Order::Top | Order::Bottom, _));
    !is_upright && phrase.pattern.text.contains("{nth} {noun}")
}

/// Whether a place repeats an adjective of a name: the kitchen drawer under the kitchen
/// counter.
fn repeats(place: &str, name: &str) -> bool {
    let complements = [" of ", " with ", " without ", " made "];
    let ends = complements.iter().filter_map(|word| name.find(word));
    let noun = name.get(..ends.min().unwrap_or(name.len())).unwrap_or(name);
    let adjectives = noun.rsplit_once(' ').map_or("", |(before, _)| before);
    let mut adjectives = adjectives.split(' ').filter(|word| !word.is_empty());
    adjectives.any(|adjective| place.split(' ').any(|word| word == adjective))
}

/// A name with its color; `None` when it cannot have the color.
fn name(grammar: &Grammar, named: Named) -> Option<String> {
    let noun: &Noun = &grammar.nouns[named.noun];
    match named.colour {
        None => Some(noun.text.clone()),
        Some(_) if !noun.takes_colour => None,
        Some(colour) => Some(format!("{} {}", grammar.colours[colour].text, noun.text)),
    }
}

/// Inserts a place into a text; `None` when its preposition does not fit.
fn with_place(
    text: &str,
    pattern: &Pattern,
    grammar: &Grammar,
    at: Option<At<'_>>,
) -> Option<String> {
    let slots = [
        ("{at}", Slot::At),
        ("{on}", Slot::On),
        ("{from}", Slot::From),
    ];
    let Some((key, slot)) = slots.into_iter().find(|(_, slot)| pattern.has(*slot)) else {
        return Some(text.to_owned());
    };
    let (place, preposition) = at?;
    let place = &grammar.places[place];
    if !spoken(place, slot).iter().any(|p| p == preposition) {
        return None;
    }
    Some(text.replace(key, &format!("{preposition} {}", place.text)))
}

/// Prepositions of a place in a slot.
pub(crate) fn spoken(place: &crate::grammar::PlaceName, slot: Slot) -> &[String] {
    match slot {
        Slot::From => &place.from,
        _ => &place.on,
    }
}

/// Whether a template accepts an object with this phrase and these words.
fn takes_object(template: &Template, phrase: &Phrase, words: &str) -> bool {
    let pattern = &phrase.pattern;
    let has_place = pattern.has_any(&Slot::PLACES);
    let says_place = template.pattern.has(Slot::Place) || template.pattern.has_any(&Slot::PLACES);
    if has_place && says_place {
        return false;
    }
    if pattern.has(Slot::From) && !template.removes {
        return false;
    }
    let Some((before, behind)) = template.pattern.text.split_once("{object}") else {
        return false;
    };
    // "Put the knife left of the bowl on the mat" could mean two places, so an object
    // between other words ends with its noun.
    let is_free = before.is_empty()
        || behind.is_empty()
        || behind.starts_with(',')
        || behind.starts_with(" and ");
    let next = behind.split_whitespace().next().unwrap_or_default();
    let is_short = words.split(' ').count() <= SHORT;
    if phrase.pattern.text.contains(',') && !behind.is_empty() {
        return false;
    }
    is_free || (ends_with_noun(pattern) && (is_short || !PARTICLES.contains(&next)))
}

fn ends_with_noun(pattern: &Pattern) -> bool {
    pattern.pieces.last() == Some(&Piece::Slot(Slot::Noun))
}

/// The text with each `{one/several}` in the form of this number.
fn inflected(text: &str, number: Number) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, behind)) = rest.split_once('{') {
        out.push_str(before);
        let (slot, after) = behind.split_once('}').unwrap_or((behind, ""));
        match (slot.split_once('/'), number) {
            (Some((_, several)), Number::Plural) => out.push_str(several),
            (Some((one, _)), _) => out.push_str(one),
            (None, _) => {
                out.push('{');
                out.push_str(slot);
                out.push('}');
            }
        }
        rest = after;
    }
    out.push_str(rest);
    out
}
