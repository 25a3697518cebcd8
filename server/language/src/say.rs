//! The speaker: a sentence that asks for something in a scene. What it says is
//! parsed before it is said, and must mean the same or be marked ambiguous.

use crate::grammar::{Form, Grammar, Means, Pattern, Phrase, Slot, Split, Template};
use crate::meaning::{Meaning, Named, Node, denotes, fits, is_called};
use crate::parse::{Answer, Parser, role};
use crate::random::Random;
use crate::scene::Scene;
use crate::space::at_place;
use crate::wording::{At, ObjectWords, RequestWords, spoken};
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
/// Words of a template behind which no adverb follows.
const ADVERBS: [&str; 5] = ["gently", "completely", "all the way", "a little", "wide"];
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

/// A request with politeness.
struct Polite {
    text: String,
    is_question: bool,
    /// It begins a sentence.
    opens: bool,
    /// Politeness ends it.
    is_behind: bool,
}

impl Polite {
    fn none(text: String) -> Self {
        Self {
            text,
            is_question: false,
            opens: false,
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
    /// One sentence, which need not be understood.
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
            at: self.at(&template.pattern, random)?,
        };
        let text = words.text(self.grammar, self.scene, self.wish)?;
        let mut polite = Polite::none(text);
        if random.happens(self.options.politeness) {
            polite = self.politely(polite.text, &words, random)?;
        }
        let mut text = polite.text.clone();
        // A template that says what the object is for has its reason in it.
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

    /// The text with politeness before or behind it. A wish takes "please" alone, and
    /// a statement nothing: thanks answer a request.
    fn politely(
        &self,
        text: String,
        words: &RequestWords<'_>,
        random: &mut Random,
    ) -> Option<Polite> {
        let template = words.template;
        match template.form {
            Form::Statement => return Some(Polite::none(text)),
            Form::Wish => {
                let text = format!("{text}, please");
                return Some(Polite {
                    is_behind: true,
                    ..Polite::none(text)
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
            let comma = if before.has_comma { "," } else { "" };
            return Some(Polite {
                text: format!("{}{comma} {text}", before.text),
                is_question: before.is_question,
                opens: before.opens,
                is_behind: false,
            });
        }
        // An adverb would belong to a clause before it: "the knife that lies there now".
        let has_clause = words.object.is_some_and(|object| {
            let pattern = &object.phrase.pattern;
            let clause = [" that ", " which "]
                .iter()
                .any(|w| pattern.text.contains(w));
            clause || pattern.has(Slot::Standing)
        });
        let has_purpose = !template.wants.is_empty();
        let has_adverb = ADVERBS.iter().any(|a| template.pattern.text.contains(a));
        let text = if random.happens(0.5) && !has_clause && !has_adverb && !has_purpose {
            let (words, _) = random.one(&self.grammar.after)?;
            format!("{text} {words}")
        } else {
            let (words, _) = random.one(&self.grammar.thanks)?;
            format!("{text}, {words}")
        };
        Some(Polite {
            is_behind: true,
            ..Polite::none(text)
        })
    }

    fn with_reason(&self, polite: &Polite, random: &mut Random) -> Option<String> {
        let kind = &self.scene.things[self.wish.target].kind;
        let all = self.grammar.reasons.iter();
        let able: Vec<_> = all
            .filter(|r| r.kinds.contains(kind) && r.verbs.contains(&self.wish.verb))
            .collect();
        let reason = random.one(&able)?;
        let frames = self.grammar.frames.iter().filter(|frame| {
            let joins = !frame.between.is_empty();
            // A question ends with its own mark; a greeting begins a sentence; thanks
            // end one.
            (frame.reason_first || !polite.is_question)
                && !(joins && frame.reason_first && polite.opens)
                && !(joins && !frame.reason_first && polite.is_behind)
        });
        let frames: Vec<_> = frames.collect();
        let frame = random.one(&frames)?;
        Some(
            frame
                .text
                .replace("{request}", &polite.text)
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

    /// A name of a thing: its index; of the target's where names are held out.
    fn noun(&self, thing: usize, split: Split, random: &mut Random) -> Option<usize> {
        let thing = &self.scene.things[thing];
        let only_held_out = split == Split::HeldOut;
        let all = self.grammar.nouns.iter().enumerate();
        let fits = |n: &crate::grammar::Noun| {
            is_called(n, thing)
                && n.of.is_in(self.options.split)
                && (!only_held_out || n.of.held_out)
        };
        let able: Vec<_> = all.filter(|(_, n)| fits(n)).map(|(i, _)| i).collect();
        random.one(&able).copied()
    }

    fn named(&self, thing: usize, split: Split, random: &mut Random) -> Option<Named> {
        let noun = self.noun(thing, split, random)?;
        let own = &self.scene.things[thing].colour;
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
        let area = self.scene.things[self.wish.target].area?;
        let area = &self.scene.areas[area].name;
        let all = self.grammar.places.iter().enumerate();
        let able: Vec<_> = all
            .filter(|(_, p)| p.area == *area && p.of.is_in(self.options.split))
            .map(|(i, _)| i)
            .collect();
        random.one(&able).copied()
    }

    /// The place that a pattern wants, with its preposition; `None` where it wants one
    /// and there is none.
    fn at(&self, pattern: &Pattern, random: &mut Random) -> Option<Option<At<'a>>> {
        let Some(slot) = Slot::PLACES.into_iter().find(|slot| pattern.has(*slot)) else {
            return Some(None);
        };
        let place = self.place(random)?;
        let preposition = random.one(spoken(&self.grammar.places[place], slot))?;
        Some(Some((place, preposition.as_str())))
    }

    /// Words for the target that tell it from the others, or from all but some.
    fn object(
        &self,
        template: &Template,
        ambiguous: bool,
        random: &mut Random,
    ) -> Option<ObjectWords<'a>> {
        // A place is said once.
        let says_place =
            template.pattern.has(Slot::Place) || template.pattern.has_any(&Slot::PLACES);
        let phrase = self.phrase(says_place, random)?;
        let target = self.wish.target;
        let name = self.named(target, self.options.split, random)?;
        let at = self.at(&phrase.pattern, random)?;
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
            let area = self.scene.things[target].area;
            let beside = (0..self.scene.things.len()).filter(|&i| {
                Some(i) != self.wish.goal
                    && i != target
                    && area.is_some()
                    && self.scene.things[i].area == area
            });
            let beside: Vec<usize> = beside.collect();
            let other = *random.one(&beside)?;
            let named = self.named(other, Split::Any, random)?;
            // "The metal bottle left of the bottle" tells neither from the other.
            let mut called = fits(self.grammar, self.scene, named);
            called.retain(|&i| self.scene.things[i].area == area);
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
            among.retain(|&i| self.scene.things[i].area == self.scene.things[target].area);
            // Of one alone nobody says which.
            if among.len() < 2 {
                return None;
            }
            if place.is_none() {
                let found = |n: &usize| at_place(self.scene, &among, order, *n) == [target];
                let n = (0..among.len()).find(found)?;
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
        let fits = |p: &&Phrase| {
            let has_place = p.pattern.has_any(&Slot::PLACES);
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
