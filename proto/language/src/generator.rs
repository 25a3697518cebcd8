//! The generator: a sentence that requests an action in a scene. Every sentence is
//! parsed before it is returned, and must have the intended meaning or be marked
//! ambiguous.

use crate::grammar::{Form, Grammar, Means, Pattern, Phrase, Slot, Split, Template, opened};
use crate::meaning::{Meaning, Named, Node, denotes, fits, is_called};
use crate::parse::{Answer, Parser, role};
use crate::random::Random;
use crate::scene::{Role, Scene};
use crate::space::{Order, at_place};
use crate::wording::{At, ObjectWords, RequestWords, spoken};
use crate::words::slip;

/// The intended meaning.
pub type Wish = Meaning;

/// Options of the generator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Which templates and names are used.
    pub split: Split,
    /// Share of sentences with a typing error, 0 to 1.
    pub typos: f64,
    /// Share of sentences with politeness, 0 to 1.
    pub politeness: f64,
    /// Share of ambiguous sentences, 0 to 1, where one exists.
    pub ambiguous: f64,
}

impl Default for Options {
    /// All templates and names, half of the sentences polite, no typing errors, no
    /// ambiguity.
    fn default() -> Self {
        Self {
            split: Split::Any,
            typos: 0.0,
            politeness: 0.5,
            ambiguous: 0.0,
        }
    }
}

/// A generated sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sentence {
    /// As it is written.
    pub text: String,
    /// Template: the verb and the words of its text.
    pub template: String,
    /// Clarification question; empty for an unambiguous sentence.
    pub question: String,
}

impl Sentence {
    /// Whether it is ambiguous.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        !self.question.is_empty()
    }
}

/// Attempts before giving up.
const TRIES: usize = 600;
/// Attempts to find an ambiguous sentence, if requested.
const TRIES_AMBIGUOUS: usize = 200;
/// Share of requests with a reason.
const REASONS: f64 = 0.4;
/// Share of phrases that try the plain name first.
const PLAIN: f64 = 0.4;
/// Category of leaves that turn.
const DOOR: &str = "door";
/// Share of names with a colour.
const COLOURS: f64 = 0.35;

/// Generates a sentence. The same seed and purpose give the same sentence on any
/// machine. `None` when the grammar has no words for it.
#[must_use]
pub fn generate(
    grammar: &Grammar,
    scene: &Scene,
    wish: &Wish,
    options: &Options,
    seed: u64,
    purpose: &str,
) -> Option<Sentence> {
    let mut random = Random::for_purpose(seed, purpose);
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
        return Some(Sentence {
            text,
            template: template.id.clone(),
            question,
        });
    }
    None
}

/// A request with politeness.
struct PoliteRequest<'a> {
    text: String,
    is_question: bool,
    /// Form of address, before the request and a reason that precedes it.
    opener: Option<&'a str>,
    /// It ends with politeness.
    is_behind: bool,
}

impl PoliteRequest<'_> {
    fn none(text: String) -> Self {
        Self {
            text,
            is_question: false,
            opener: None,
            is_behind: false,
        }
    }
}

struct Speaker<'a> {
    grammar: &'a Grammar,
    scene: &'a Scene,
    wish: &'a Wish,
    options: &'a Options,
}

impl<'a> Speaker<'a> {
    /// One candidate sentence, which may not be understood.
    fn attempt(&self, ambiguous: bool, random: &mut Random) -> Option<(String, &'a Template)> {
        let template = self.template(random)?;
        let object = match template.pattern.has(Slot::Object) {
            true => Some(self.object(template, ambiguous, random)?),
            false => None,
        };
        let goal = match self.wish.goal {
            Some(goal) => Some(self.noun(goal, Split::Any, random)?),
            None => None,
        };
        let place = match template.pattern.has(Slot::Place) {
            true => Some(self.place(random)?),
            false => None,
        };
        let words = RequestWords {
            template,
            object,
            goal,
            place,
            at: self.choose_place(&template.pattern, random)?,
        };
        let text = words.text(self.grammar, self.scene, self.wish)?;
        let mut polite = PoliteRequest::none(text);
        if random.happens(self.options.politeness) {
            polite = self.politely(polite.text, &words, random)?;
        }
        let mut text = opened(polite.opener, &polite.text);
        // A template with a purpose already contains a reason.
        let takes_reason = template.form == Form::Request && template.wants.is_empty();
        if takes_reason && random.happens(REASONS) {
            text = self.with_reason(&polite, random).unwrap_or(text);
        }
        let mut text = capitals(&text);
        if random.happens(self.options.typos) {
            text = slip(&text, random);
        }
        let ending = if polite.is_question { "?" } else { "." };
        Some((format!("{text}{ending}"), template))
    }

    /// Adds politeness before or after the text. A wish takes only "please", a
    /// statement nothing: thanks follow a request.
    fn politely(
        &self,
        text: String,
        words: &RequestWords<'_>,
        random: &mut Random,
    ) -> Option<PoliteRequest<'a>> {
        let template = words.template;
        match template.form {
            Form::Statement => return Some(PoliteRequest::none(text)),
            Form::Wish => {
                let text = format!("{text}, please");
                return Some(PoliteRequest {
                    is_behind: true,
                    ..PoliteRequest::none(text)
                });
            }
            Form::Request => {}
        }
        if random.happens(0.6) {
            // "Go ahead and head to the shelf and take" has one "and" too many.
            let has_and = text.contains(" and ");
            let spoken = self
                .grammar
                .before
                .iter()
                .filter(|b| b.is_spoken && !(has_and && b.text.ends_with(" and")));
            let spoken: Vec<_> = spoken.collect();
            let before = random.one(&spoken)?;
            let opener = before.opens.then_some(before.text.as_str());
            let comma = if before.has_comma { "," } else { "" };
            let text = match opener {
                Some(_) => text,
                None => format!("{}{comma} {text}", before.text),
            };
            return Some(PoliteRequest {
                text,
                is_question: before.is_question,
                opener,
                is_behind: false,
            });
        }
        let text = if random.happens(0.5) && words.takes_adverb(self.grammar) {
            let (words, _) = random.one(&self.grammar.after)?;
            format!("{text} {words}")
        } else {
            let (words, _) = random.one(&self.grammar.thanks)?;
            format!("{text}, {words}")
        };
        Some(PoliteRequest {
            is_behind: true,
            ..PoliteRequest::none(text)
        })
    }

    fn with_reason(&self, polite: &PoliteRequest<'_>, random: &mut Random) -> Option<String> {
        let kind = &self.scene.entities[self.wish.target].kind;
        let all = self.grammar.reasons.iter();
        let able: Vec<_> = all
            .filter(|r| r.kinds.contains(kind) && r.verbs.contains(&self.wish.verb))
            .collect();
        let reason = random.one(&able)?;
        let frames = self.grammar.frames.iter().filter(|frame| {
            let joins = !frame.between.is_empty();
            // A question ends with its own mark, thanks end a sentence.
            (frame.reason_first || !polite.is_question)
                && !(joins && !frame.reason_first && polite.is_behind)
        });
        let frames: Vec<_> = frames.collect();
        let frame = random.one(&frames)?;
        Some(frame.joined(polite.opener, &reason.text, &polite.text))
    }

    fn template(&self, random: &mut Random) -> Option<&'a Template> {
        let kind = &self.scene.entities[self.wish.target].kind;
        let split = self.options.split;
        let fits = |t: &&Template| {
            let held_out = split != Split::HeldOut || t.of.held_out;
            let wanted = t.wants.is_empty() || t.wants.contains(kind);
            t.verb == self.wish.verb && t.of.is_in(split) && held_out && wanted
        };
        let able: Vec<_> = self.grammar.templates.iter().filter(fits).collect();
        random.one(&able).copied()
    }

    /// A name of an entity: its index. Held-out names are used for the target only.
    fn noun(&self, entity: usize, split: Split, random: &mut Random) -> Option<usize> {
        let entity = &self.scene.entities[entity];
        let only_held_out = split == Split::HeldOut;
        let all = self.grammar.nouns.iter().enumerate();
        let fits = |n: &crate::grammar::Noun| {
            is_called(n, entity)
                && n.of.is_in(self.options.split)
                && (!only_held_out || n.of.held_out)
        };
        let able: Vec<_> = all.filter(|(_, n)| fits(n)).map(|(i, _)| i).collect();
        random.one(&able).copied()
    }

    fn named(&self, entity: usize, split: Split, random: &mut Random) -> Option<Named> {
        let noun = self.noun(entity, split, random)?;
        let own = &self.scene.entities[entity].colour;
        let takes_colour = self.grammar.nouns[noun].takes_colour;
        let colours = self.grammar.colours.iter().enumerate();
        let able: Vec<_> = colours
            .filter(|(_, c)| c.name == *own && c.is_spoken && takes_colour)
            .map(|(i, _)| i)
            .collect();
        let colour = match random.happens(COLOURS) {
            true => random.one(&able).copied(),
            false => None,
        };
        Some(Named { colour, noun })
    }

    fn place(&self, random: &mut Random) -> Option<usize> {
        let area = self.scene.entities[self.wish.target].area?;
        let area = &self.scene.areas[area].name;
        let all = self.grammar.places.iter().enumerate();
        let able: Vec<_> = all
            .filter(|(_, p)| p.area == *area && p.of.is_in(self.options.split))
            .map(|(i, _)| i)
            .collect();
        random.one(&able).copied()
    }

    /// The place for a pattern, with its preposition; `None` when the pattern needs one
    /// and none exists.
    fn choose_place(&self, pattern: &Pattern, random: &mut Random) -> Option<Option<At<'a>>> {
        let Some(slot) = Slot::PLACES.into_iter().find(|slot| pattern.has(*slot)) else {
            return Some(None);
        };
        let place = self.place(random)?;
        let preposition = random.one(spoken(&self.grammar.places[place], slot))?;
        Some(Some((place, preposition.as_str())))
    }

    /// A phrase that distinguishes the target from all others, or from all but some.
    fn object(
        &self,
        template: &Template,
        ambiguous: bool,
        random: &mut Random,
    ) -> Option<ObjectWords<'a>> {
        // A place is named once.
        let says_place =
            template.pattern.has(Slot::Place) || template.pattern.has_any(&Slot::PLACES);
        let phrase = self.phrase(says_place, random)?;
        let target = self.wish.target;
        let name = self.named(target, self.options.split, random)?;
        let at = self.choose_place(&phrase.pattern, random)?;
        let mut words = ObjectWords {
            phrase,
            name,
            at,
            other: None,
            nth: None,
        };
        let mut node = Node {
            means: phrase.means,
            noun: name,
            other: None,
            at: at.map(|(place, _)| place),
        };
        if phrase.pattern.has(Slot::Other) {
            let area = self.scene.entities[target].area;
            let beside = (0..self.scene.entities.len()).filter(|&i| {
                Some(i) != self.wish.goal
                    && i != target
                    && area.is_some()
                    && self.scene.entities[i].area == area
            });
            let beside: Vec<usize> = beside.collect();
            let other = *random.one(&beside)?;
            let named = self.named(other, Split::Any, random)?;
            // "The metal bottle left of the bottle" distinguishes neither.
            let mut called = fits(self.grammar, self.scene, named);
            called.retain(|&i| self.scene.entities[i].area == area);
            if called != [other] {
                return None;
            }
            words.other = Some(named);
            node.other = words.other;
        }
        if let Means::Order(order, place) = phrase.means {
            let like = Node {
                means: Means::Plain,
                ..node
            };
            let mut among = denotes(self.grammar, self.scene, &like, role(self.wish.verb), None);
            among.retain(|&i| self.scene.entities[i].area == self.scene.entities[target].area);
            // A single object needs no ordinal.
            if among.len() < 2 {
                return None;
            }
            if place.is_none() {
                let found = |n: &usize| at_place(self.scene, &among, order, *n) == [target];
                let n = (0..among.len()).find(found)?;
                // The last from the top is the bottom one.
                let is_upright = matches!(order, Order::Top | Order::Bottom);
                if is_upright && n + 1 == among.len() {
                    return None;
                }
                words.nth = Some(n);
                node.means = Means::Order(order, Some(n));
            }
        }
        let denoted = denotes(self.grammar, self.scene, &node, role(self.wish.verb), None);
        let good = match ambiguous {
            true => denoted.contains(&target),
            false => denoted == [target],
        };
        good.then_some(words)
    }

    fn phrase(&self, says_place: bool, random: &mut Random) -> Option<&'a Phrase> {
        let plain = random.happens(PLAIN);
        // Heights distinguish drawers and nothing else does; doors have sides too, objects have
        // sides only.
        let target = &self.scene.entities[self.wish.target];
        let (is_slide, is_door) = (target.role == Role::Slide, target.category == DOOR);
        let is_upright =
            |p: &Phrase| matches!(p.means, Means::Order(Order::Top | Order::Bottom, _));
        let same = self.scene.entities.iter();
        let same = same.filter(|e| e.category == target.category && e.area == target.area);
        // Of two doors none is the second from the left.
        let counts = same.count() > 2;
        let is_of_door = |p: &Phrase| match p.means {
            Means::Order(Order::Left | Order::Right, nth) => nth.is_some() || counts,
            _ => false,
        };
        let fits = |p: &&Phrase| {
            let has_place = p.pattern.has_any(&Slot::PLACES);
            p.of.is_in(self.options.split)
                && (!plain || p.means == Means::Plain)
                && (p.means == Means::Plain
                    || is_upright(p) == is_slide
                    || is_door && is_of_door(p))
                && (!says_place || !has_place)
        };
        let able: Vec<_> = self.grammar.phrases.iter().filter(fits).collect();
        random.one(&able).copied()
    }
}

/// Capitalizes the first letter of each sentence.
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
