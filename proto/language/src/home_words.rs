//! Words for the places of homes that list rooms and kinds of furniture, such as imported ones:
//! "the table in the kitchen", "the left door of the cabinet". The words are those of
//! `homes.toml`; a kind or a room without an entry is its own word.

use std::collections::BTreeSet;

use serde::Deserialize;
use toml::Spanned;

use crate::entries::{PhraseEntry, Texts};
use crate::file::File;
use crate::grammar::{
    GoalForm, GoalKind, Grammar, GrammarError, HomeWords, Means, Names, Noun, Number, PlaceName,
    Use,
};
use crate::scene::{Area, Scene};
use crate::words::words;

/// Prepositions of positions, of removal, and those that are only understood.
type Prepositions = [&'static [&'static str]; 3];

/// For objects on furniture.
const ON: Prepositions = [&["on"], &["from"], &["off", "at", "in"]];
/// For leaves of furniture.
const OF: Prepositions = [&["of"], &[], &["in", "on", "at", "from"]];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HomesFile {
    origin: Spanned<String>,
    license: Spanned<String>,
    room: Vec<KindEntry>,
    furniture: Vec<KindEntry>,
    leaf: Vec<LeafEntry>,
    phrase: Vec<PhraseEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KindEntry {
    of: Vec<String>,
    texts: Spanned<Texts>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LeafEntry {
    category: String,
    texts: Texts,
}

impl Grammar {
    /// Reads `homes.toml`.
    pub(crate) fn read_homes(&mut self, file: &File<'_>) -> Result<(), GrammarError> {
        let read: HomesFile = file.parse()?;
        file.provenance([("origin", &read.origin), ("license", &read.license)])?;
        let kinds = |entries: &[KindEntry]| {
            let texts = |entry: &KindEntry| {
                let texts = entry.texts.get_ref();
                if texts.is_empty() {
                    return Err(file.wrong(&entry.texts.span(), "texts", "[]", "a text"));
                }
                for text in texts {
                    file.plain(text)?;
                }
                let texts = texts.iter().map(|text| text.get_ref().clone());
                Ok((entry.of.clone(), texts.collect()))
            };
            entries.iter().map(texts).collect::<Result<Vec<_>, _>>()
        };
        let mut homes = HomeWords {
            rooms: kinds(&read.room)?,
            furniture: kinds(&read.furniture)?,
            ..HomeWords::default()
        };
        for entry in &read.leaf {
            for text in &entry.texts {
                let words = file.plain(text)?;
                homes.leaves.push(noun(
                    text.get_ref(),
                    words,
                    Names::Category(entry.category.clone()),
                ));
            }
        }
        for entry in &read.phrase {
            for phrase in file.phrases(entry)? {
                let is_of_size =
                    matches!(phrase.means, Means::Order(order, _) if order.is_of_size());
                match is_of_size {
                    true => homes.sizes.push(phrase),
                    false => homes.phrases.push(phrase),
                }
            }
        }
        self.homes = homes;
        Ok(())
    }

    /// The grammar with words for the areas of a scene that state their kind.
    #[must_use]
    pub fn for_scene(&self, scene: &Scene) -> Self {
        let mut grammar = self.clone();
        let own: Vec<&Area> = scene.areas.iter().filter(|a| !a.kind.is_empty()).collect();
        for area in &own {
            grammar.add_area(area, &own);
        }
        if own.iter().any(|area| area.has_leaves) {
            let HomeWords {
                leaves, phrases, ..
            } = &self.homes;
            grammar.know(leaves.iter().flat_map(|noun| &noun.words));
            for phrase in phrases {
                grammar.know_pattern(&phrase.pattern);
            }
            grammar.nouns.extend_from_slice(leaves);
            grammar.phrases.extend_from_slice(phrases);
        }
        // Elsewhere sentences of a seed stay those of earlier versions.
        if !own.is_empty() && scene.entities.iter().any(|entity| entity.size > 0.0) {
            for phrase in &self.homes.sizes {
                grammar.know_pattern(&phrase.pattern);
            }
            grammar.phrases.extend_from_slice(&self.homes.sizes);
        }
        grammar.add_objects(scene);
        grammar
    }

    fn add_area(&mut self, area: &Area, all: &[&Area]) {
        let kinds = texts(&self.homes.furniture, &area.kind);
        let rooms = match area.room.is_empty() {
            true => Vec::new(),
            false => texts(&self.homes.rooms, &area.room),
        };
        let like = all
            .iter()
            .filter(|other| other.has_leaves == area.has_leaves);
        let same_kind = |other: &&&Area| texts(&self.homes.furniture, &other.kind) == kinds;
        let is_only = like.filter(same_kind).count() == 1;
        // Words of its own suffice for what is spoken.
        let is_known = self.places.iter().any(|place| place.area == area.name);
        // The first name is that of clarification questions.
        let mut names: Vec<(String, bool)> = Vec::new();
        for (i, kind) in kinds.iter().enumerate() {
            for (j, room) in rooms.iter().enumerate() {
                names.push((format!("{kind} in the {room}"), i == 0 && j == 0));
                names.push((format!("{room} {kind}"), false));
            }
            names.push((kind.clone(), i == 0 && (is_only || rooms.is_empty())));
        }
        let prepositions = if area.has_leaves { OF } else { ON };
        let mut listed = BTreeSet::new();
        for (name, is_generated) in names {
            if !listed.insert(name.clone()) {
                continue;
            }
            let text = format!("the {name}");
            let of = Use {
                held_out: false,
                is_generated,
            };
            let of_place = Use {
                is_generated: is_generated && !is_known,
                ..of
            };
            let place = place(&area.name, &text, prepositions, of_place);
            self.know(&place.words);
            self.know(
                [&place.on, &place.from, &place.understood]
                    .into_iter()
                    .flatten(),
            );
            self.places.push(place);
            if !area.has_leaves && !area.furniture.is_empty() {
                let names = Names::Goal(area.furniture.clone());
                self.nouns.push(Noun {
                    of,
                    takes_colour: false,
                    has_tail: name.contains(' '),
                    ..noun(&name, words(&name), names)
                });
            }
        }
        if !area.has_leaves && self.goal(&area.furniture).is_none() {
            self.goals.push(GoalKind {
                goals: vec![area.furniture.clone()],
                holds: GoalForm::Surface,
                at: "on".to_owned(),
                to: "onto".to_owned(),
            });
            self.know(&["on".to_owned(), "onto".to_owned()]);
        }
    }
}

fn place(area: &str, text: &str, [on, from, understood]: Prepositions, of: Use) -> PlaceName {
    let list = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
    PlaceName {
        area: area.to_owned(),
        text: text.to_owned(),
        words: words(text),
        on: list(on),
        from: list(from),
        understood: list(understood),
        is_drive: true,
        of,
    }
}

pub(crate) fn noun(text: &str, words: Vec<String>, names: Names) -> Noun {
    Noun {
        text: text.to_owned(),
        words,
        names,
        number: Number::Singular,
        is_contents: false,
        takes_colour: false,
        has_tail: false,
        of: Use {
            held_out: false,
            is_generated: true,
        },
    }
}

/// The texts of a kind, or its own words.
fn texts(known: &[(Vec<String>, Vec<String>)], kind: &str) -> Vec<String> {
    let found = known.iter().find(|(of, _)| of.iter().any(|of| of == kind));
    found.map_or_else(
        || vec![kind.replace(['_', '-'], " ")],
        |(_, texts)| texts.clone(),
    )
}
