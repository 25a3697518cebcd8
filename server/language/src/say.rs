//! The speaker: a sentence that asks for something in a scene. What it says is
//! parsed before it is said, and must mean the same or be marked ambiguous.

use crate::grammar::{Grammar, Means, NTH, Phrase, Slot, Split, Template, Verb};
use crate::meaning::{Meaning, Named, Node, denotes, is_called};
use crate::parse::{Answer, Parser, role};
use crate::random::Random;
use crate::scene::Scene;
use crate::space::at_place;
use crate::words::slip;

/// What is asked for: that which the parser must find.
pub type Wish = Meaning;

/// How it is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Which templates and names are said.
    pub split: Split,
    /// Share of sentences with a typing error, 0 to 1.
    pub typos: f64,
    /// Share of sentences with politeness, 0 to 1.
    pub politeness: f64,
    /// Share of sentences that may mean several things, 0 to 1, where there is such
    /// a sentence.
    pub ambiguous: f64,
}

impl Default for Options {
    /// All templates and names, half of the sentences polite, no typing errors,
    /// nothing ambiguous.
    fn default() -> Self {
        Self {
            split: Split::Any,
            typos: 0.0,
            politeness: 0.5,
            ambiguous: 0.0,
        }
    }
}

/// A sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Said {
    /// As it is written.
    pub text: String,
    /// Template: the verb and the words of its text.
    pub template: String,
    /// Question that must be asked back; empty where the sentence is clear.
    pub question: String,
}

impl Said {
    /// Whether it may mean several things.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        !self.question.is_empty()
    }
}

/// Sentences that are tried before none is said.
const TRIES: usize = 600;
/// Of these the first many look for an ambiguous one, where one is asked for.
const TRIES_AMBIGUOUS: usize = 200;
/// Words with which a question begins.
const ASKS: [&str; 4] = ["could you", "can you", "would you", "may I"];
/// Words of politeness that a comma sets apart.
const APART: [&str; 5] = ["if", "when", "hey", "robot", "okay"];
/// Words behind an object that is kept short, so that they are not lost.
const PARTICLES: [&str; 8] = ["up", "open", "out", "shut", "closed", "in", "back", "a"];
/// Most words of such an object.
const SHORT: usize = 4;
/// Share of requests with a reason.
const REASONS: f64 = 0.4;
/// Share of phrases that try the bare name first.
const PLAIN: f64 = 0.4;
/// Share of names with a colour.
const COLOURS: f64 = 0.35;

/// Says what is asked for. The same seed and purpose give the same sentence on any
/// machine. `None` where the grammar has no words for it.
#[must_use]
pub fn say(
    grammar: &Grammar,
    scene: &Scene,
    wish: &Wish,
    options: &Options,
    seed: u64,
    purpose: &str,
) -> Option<Said> {
    let mut random = Random::of(seed, purpose);
    let wants_ambiguous = random.happens(options.ambiguous);
    let parser = Parser::new(grammar, scene);
    let speaker = Speaker {
        grammar,
        scene,
        wish,
        options,
    };
    for turn in 0..TRIES {
        let seeks_ambiguous = wants_ambiguous && turn < TRIES_AMBIGUOUS;
        let Some((text, template)) = speaker.attempt(seeks_ambiguous, &mut random) else {
            continue;
        };
        let question = match parser.parse(&text) {
            Answer::Clear(meaning) if meaning == *wish && !seeks_ambiguous => String::new(),
            Answer::Ambiguous { meanings, question }
                if seeks_ambiguous && meanings.contains(wish) =>
            {
                question
            }
            _ => continue,
        };
        return Some(Said {
            text,
            template: template.id.clone(),
            question,
        });
    }
    None
}

struct Speaker<'a> {
    grammar: &'a Grammar,
    scene: &'a Scene,
    wish: &'a Wish,
    options: &'a Options,
}

impl<'a> Speaker<'a> {
    /// One sentence, which need not be understood.
    fn attempt(&self, ambiguous: bool, random: &mut Random) -> Option<(String, &'a Template)> {
        let template = self.template(random)?;
        let mut text = template.pattern.text.clone();
        if template.pattern.has(Slot::Object) {
            let object = self.object(template, ambiguous, random)?;
            let behind = template.pattern.text.split("{object} ").nth(1);
            let next = behind.and_then(|words| words.split(' ').next());
            let is_split = next.is_some_and(|word| PARTICLES.contains(&word));
            if is_split && object.split(' ').count() > SHORT {
                return None;
            }
            text = text.replace("{object}", &object);
        }
        if let Some(goal) = self.wish.goal {
            text = text.replace(
                "{goal}",
                &format!("the {}", self.noun(goal, Split::Any, random)?.0),
            );
        }
        if template.pattern.has(Slot::Place) {
            text = text.replace("{place}", self.place(random)?.0);
        }
        if template.pattern.has(Slot::At) {
            text = text.replace("{at}", &self.at(random)?);
        }
        let mut ending = ".";
        if random.happens(self.options.politeness) {
            (text, ending) = self.politely(&text, template.is_request, random)?;
        }
        if template.is_request && random.happens(REASONS) {
            text = self.with_reason(&text, ending, random).unwrap_or(text);
        }
        let mut text = capitals(&text);
        if random.happens(self.options.typos) {
            text = slip(&text, random);
        }
        Some((format!("{text}{ending}"), template))
    }

    /// The text with politeness before or behind it, and how it ends then.
    fn politely(
        &self,
        text: &str,
        is_request: bool,
        random: &mut Random,
    ) -> Option<(String, &'static str)> {
        if is_request && random.happens(0.6) {
            let (words, _) = random.one(&self.grammar.before)?;
            let last = words.rsplit(", ").next().unwrap_or(words);
            let is_question = ASKS.iter().any(|ask| last.starts_with(ask));
            let is_apart = APART.iter().any(|begin| words.starts_with(begin));
            let apart = if is_apart { "," } else { "" };
            return Some((
                format!("{words}{apart} {text}"),
                if is_question { "?" } else { "." },
            ));
        }
        if is_request && random.happens(0.5) {
            let (words, _) = random.one(&self.grammar.after)?;
            return Some((format!("{text} {words}"), "."));
        }
        let (words, _) = random.one(&self.grammar.thanks)?;
        Some((format!("{text}, {words}"), "."))
    }

    fn with_reason(&self, text: &str, ending: &str, random: &mut Random) -> Option<String> {
        let kind = &self.scene.things[self.wish.target].kind;
        let fits = |verb: Option<Verb>| verb.is_none_or(|verb| verb == self.wish.verb);
        let all = self.grammar.reasons.iter();
        let able: Vec<_> = all
            .filter(|r| r.kinds.contains(kind) && fits(r.verb))
            .collect();
        let reason = random.one(&able)?;
        let frame = random.one(&self.grammar.frames)?;
        // A question ends with its own mark.
        if ending == "?" && !frame.reason_first {
            return None;
        }
        Some(
            frame
                .text
                .replace("{request}", text)
                .replace("{reason}", &reason.text),
        )
    }

    fn template(&self, random: &mut Random) -> Option<&'a Template> {
        let kind = &self.scene.things[self.wish.target].kind;
        let split = self.options.split;
        let fits = |t: &&Template| {
            let held_out = split != Split::HeldOut || t.of.held_out;
            let wanted = t.wants.is_empty() || t.wants.contains(kind);
            t.verb == self.wish.verb && t.of.is_in(split) && held_out && wanted
        };
        let able: Vec<_> = self.grammar.templates.iter().filter(fits).collect();
        random.one(&able).copied()
    }

    /// A name of a thing, with its index; of the target's where names are held out.
    fn noun(&self, thing: usize, split: Split, random: &mut Random) -> Option<(&'a str, usize)> {
        let thing = &self.scene.things[thing];
        let only_held_out = split == Split::HeldOut;
        let all = self.grammar.nouns.iter().enumerate();
        let fits = |n: &crate::grammar::Noun| {
            is_called(n, thing)
                && n.of.is_in(self.options.split)
                && (!only_held_out || n.of.held_out)
        };
        let able: Vec<_> = all.filter(|(_, n)| fits(n)).collect();
        let (i, noun) = random.one(&able)?;
        Some((noun.text.as_str(), *i))
    }

    fn named(&self, thing: usize, split: Split, random: &mut Random) -> Option<(String, Named)> {
        let (text, noun) = self.noun(thing, split, random)?;
        let own = &self.scene.things[thing].colour;
        let colours = self.grammar.colours.iter().enumerate();
        let able: Vec<_> = colours.filter(|(_, c)| c.name == *own).collect();
        let colour = if random.happens(COLOURS) {
            random.one(&able)
        } else {
            None
        };
        Some(match colour {
            Some((i, colour)) => (
                format!("{} {text}", colour.text),
                Named {
                    colour: Some(*i),
                    noun,
                },
            ),
            None => (text.to_owned(), Named { colour: None, noun }),
        })
    }

    fn place(&self, random: &mut Random) -> Option<(&'a str, usize)> {
        let area = self.scene.things[self.wish.target].area?;
        let area = &self.scene.areas[area].name;
        let all = self.grammar.places.iter().enumerate();
        let able: Vec<_> = all
            .filter(|(_, p)| p.area == *area && p.of.is_in(self.options.split))
            .collect();
        let (i, place) = random.one(&able)?;
        Some((place.text.as_str(), *i))
    }

    fn at(&self, random: &mut Random) -> Option<String> {
        let (text, i) = self.place(random)?;
        let preposition = random.one(&self.grammar.places[i].prepositions)?;
        Some(format!("{preposition} {text}"))
    }

    /// A phrase for the target that tells it from the others, or from all but some.
    fn object(&self, template: &Template, ambiguous: bool, random: &mut Random) -> Option<String> {
        // A place is said once.
        let says_place = template.pattern.has(Slot::Place) || template.pattern.has(Slot::At);
        let phrase = self.phrase(says_place, random)?;
        let target = self.wish.target;
        let (name, noun) = self.named(target, self.options.split, random)?;
        let mut text = phrase.pattern.text.replace("{noun}", &name);
        let mut node = Node {
            means: phrase.means,
            noun,
            other: None,
            at: None,
        };
        for slot in [Slot::At, Slot::On] {
            if phrase.pattern.has(slot) {
                let (place, i) = self.place(random)?;
                let prepositions = &self.grammar.places[i].prepositions;
                let (key, preposition) = match slot {
                    Slot::On => ("{on}", prepositions.first()?),
                    _ => ("{at}", random.one(prepositions)?),
                };
                text = text.replace(key, &format!("{preposition} {place}"));
                node.at = Some(i);
            }
        }
        if phrase.pattern.has(Slot::Other) {
            let area = self.scene.things[target].area;
            let beside = (0..self.scene.things.len()).filter(|&i| {
                Some(i) != self.wish.goal
                    && i != target
                    && area.is_some()
                    && self.scene.things[i].area == area
            });
            let beside: Vec<usize> = beside.collect();
            let other = *random.one(&beside)?;
            let (name, named) = self.named(other, Split::Any, random)?;
            text = text.replace("{other}", &format!("the {name}"));
            node.other = Some(named);
        }
        if let Means::Order(order, place) = phrase.means {
            let like = Node {
                means: Means::Plain,
                ..node
            };
            let mut among = denotes(self.grammar, self.scene, &like, role(self.wish.verb), None);
            among.retain(|&i| self.scene.things[i].area == self.scene.things[target].area);
            // Of one alone nobody says which.
            if among.len() < 2 {
                return None;
            }
            if place.is_none() {
                let found = |n: &usize| at_place(self.scene, &among, order, *n) == [target];
                let n = (0..among.len()).find(found)?;
                text = text.replace("{nth}", NTH.get(n)?);
                node.means = Means::Order(order, Some(n));
            }
        }
        let denoted = denotes(self.grammar, self.scene, &node, role(self.wish.verb), None);
        let good = match ambiguous {
            true => denoted.contains(&target),
            false => denoted == [target],
        };
        good.then_some(text)
    }

    fn phrase(&self, says_place: bool, random: &mut Random) -> Option<&'a Phrase> {
        let plain = random.happens(PLAIN);
        let fits = |p: &&Phrase| {
            let has_place = p.pattern.has(Slot::At) || p.pattern.has(Slot::On);
            p.of.is_in(self.options.split)
                && (!plain || p.means == Means::Plain)
                && (!says_place || !has_place)
        };
        let able: Vec<_> = self.grammar.phrases.iter().filter(fits).collect();
        random.one(&able).copied()
    }
}

/// Sentences begin with a capital.
fn capitals(text: &str) -> String {
    let mut begins = true;
    text.chars()
        .map(|c| match c {
            c if begins && c.is_alphabetic() => {
                begins = false;
                c.to_ascii_uppercase()
            }
            '.' => {
                begins = true;
                c
            }
            c => c,
        })
        .collect()
}
