//! The parser: the meaning of a sentence in a scene, or a clarification question.
//!
//! It tries all derivations of the sentence by politeness, reasons, templates and
//! phrases of the grammar, and returns the union of their meanings. A sentence without
//! derivation is searched for a verb and for phrases.

use std::collections::BTreeSet;

use crate::chart::Chart;
use crate::grammar::{Grammar, Verb};
use crate::meaning::{Meaning, Named, denotes, fits};
use crate::question::question;
use crate::scene::{Role, Scene};
use crate::words::{mended, words};

/// Result of parsing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// One meaning.
    Clear(Meaning),
    /// Several meanings.
    Ambiguous {
        /// The meanings.
        meanings: Vec<Meaning>,
        /// The clarification question.
        question: String,
    },
    /// Understood, but no entity of the scene matches.
    Nothing,
    /// Not understood.
    Unknown,
}

/// A parser for sentences about one scene.
#[derive(Clone, Copy, Debug)]
pub struct Parser<'a> {
    grammar: &'a Grammar,
    scene: &'a Scene,
}

/// Largest number of words of a parsed sentence.
const LONGEST: usize = 80;

impl<'a> Parser<'a> {
    /// A parser of this grammar about this scene.
    #[must_use]
    pub fn new(grammar: &'a Grammar, scene: &'a Scene) -> Self {
        Self { grammar, scene }
    }

    /// Parses a sentence.
    #[must_use]
    pub fn parse(&self, sentence: &str) -> Answer {
        let words = words(sentence);
        if words.is_empty() || words.len() > LONGEST {
            return Answer::Unknown;
        }
        let readings = mended(&words, &self.grammar.vocabulary);
        let mut is_understood = false;
        let mut meanings = BTreeSet::new();
        for words in &readings {
            is_understood |= self.templates(words, &mut meanings);
        }
        if !is_understood {
            for words in &readings {
                is_understood |= self.search(words, &mut meanings);
            }
        }
        let meanings: Vec<Meaning> = meanings.into_iter().collect();
        match meanings[..] {
            [] if is_understood => Answer::Nothing,
            [] => Answer::Unknown,
            [one] => Answer::Clear(one),
            _ => Answer::Ambiguous {
                question: question(self.grammar, self.scene, &meanings),
                meanings,
            },
        }
    }

    /// Whether templates derive the sentence; adds their meanings.
    fn templates(&self, words: &[String], out: &mut BTreeSet<Meaning>) -> bool {
        let chart = Chart::new(self.grammar, words);
        let mut is_understood = false;
        for (from, to) in self.requests(words) {
            for template in &self.grammar.templates {
                for (end, bound) in chart.matches(&template.pattern, from) {
                    if end != to {
                        continue;
                    }
                    is_understood = true;
                    let role = role(template.verb);
                    let place = bound.place.or(bound.at);
                    let targets = match bound.object {
                        Some(node) => {
                            denotes(self.grammar, self.scene, &chart.nodes[node], role, place)
                        }
                        None => self.wanted(&template.wants, place),
                    };
                    let goals = match bound.goal {
                        Some(noun) => self.goals(noun),
                        None => vec![None],
                    };
                    for &target in &targets {
                        out.extend(goals.iter().map(|&goal| Meaning {
                            verb: template.verb,
                            target,
                            goal,
                        }));
                    }
                }
            }
        }
        is_understood
    }

    /// Entities of the accepted kinds.
    fn wanted(&self, wants: &[String], place: Option<usize>) -> Vec<usize> {
        let area = place.map(|i| self.grammar.places[i].area.as_str());
        let entities = self.scene.entities.iter().enumerate();
        let is_there = |of: Option<usize>| match area {
            None => true,
            Some(area) => of.is_some_and(|i| self.scene.areas[i].name == area),
        };
        entities
            .filter(|(_, t)| t.role == Role::Object && wants.contains(&t.kind) && is_there(t.area))
            .map(|(i, _)| i)
            .collect()
    }

    fn goals(&self, noun: usize) -> Vec<Option<usize>> {
        let named = Named { colour: None, noun };
        fits(self.grammar, self.scene, named)
            .into_iter()
            .map(Some)
            .collect()
    }

    /// Possible positions of a request between politeness and reasons: first word, and
    /// one past the last.
    fn requests(&self, words: &[String]) -> Vec<(usize, usize)> {
        let openers = self.grammar.before.iter().filter(|before| before.opens);
        let opened = openers.filter(|opener| words.starts_with(&opener.words));
        let opened = opened.map(|opener| opener.words.len());
        let begins: Vec<usize> = std::iter::once(0).chain(opened).collect();
        let mut spans: Vec<_> = begins.iter().map(|&begin| (begin, words.len())).collect();
        for &begin in &begins {
            spans.extend(self.beside_reasons(words, begin));
        }
        let mut out = BTreeSet::new();
        for (from, to) in spans {
            let mut starts = vec![from];
            let mut ends = vec![to];
            for before in &self.grammar.before {
                if words[from..to].starts_with(&before.words) {
                    starts.push(from + before.words.len());
                }
            }
            let behind = self.grammar.after.iter().chain(&self.grammar.thanks);
            let behind = behind.map(|(_, words)| words);
            for polite in behind.chain(&self.grammar.understood_after) {
                if words[from..to].ends_with(polite) {
                    ends.push(to - polite.len());
                }
            }
            let pairs = starts
                .iter()
                .flat_map(|&s| ends.iter().map(move |&e| (s, e)));
            out.extend(pairs.filter(|(s, e)| s < e));
        }
        out.into_iter().collect()
    }

    /// Possible positions of a request before or after a reason, from word `begin` on.
    fn beside_reasons(&self, words: &[String], begin: usize) -> Vec<(usize, usize)> {
        let mut spans = Vec::new();
        let all = words.len();
        for frame in &self.grammar.frames {
            for reason in &self.grammar.reasons {
                let count = reason.words.len() + frame.between.len();
                if begin + count >= all {
                    continue;
                }
                let (first, second) = match frame.reason_first {
                    true => (&reason.words, &frame.between),
                    false => (&frame.between, &reason.words),
                };
                let (beside, span) = match frame.reason_first {
                    true => (begin..begin + count, (begin + count, all)),
                    false => (all - count..all, (begin, all - count)),
                };
                if words[beside].iter().eq(first.iter().chain(second)) {
                    spans.push(span);
                }
            }
        }
        spans
    }

    /// Searches for a verb and for the longest phrases when no template matches.
    fn search(&self, words: &[String], out: &mut BTreeSet<Meaning>) -> bool {
        let chart = Chart::new(self.grammar, words);
        let mut verbs: Vec<(usize, Verb)> = Vec::new();
        for (at, word) in words.iter().enumerate() {
            let known = self
                .grammar
                .verb_words
                .iter()
                .filter(|(known, _)| known == word);
            verbs.extend(known.map(|(_, verb)| (at, *verb)));
        }
        let last = |lists: &[Vec<(usize, usize)>]| {
            let found = (0..words.len()).rev().find(|&at| !lists[at].is_empty());
            found.and_then(|at| {
                lists[at]
                    .iter()
                    .max_by_key(|(end, _)| *end)
                    .map(|(_, i)| (at, *i))
            })
        };
        let goal = last(&chart.goals).filter(|(at, _)| *at > 0);
        // An entity to put has a place; one to open or close slides.
        let has = |verb: Verb| verbs.iter().any(|(_, v)| *v == verb);
        let verb = [
            Verb::Bring,
            Verb::Give,
            Verb::Open,
            Verb::Close,
            Verb::Put,
            Verb::Lift,
        ]
        .into_iter()
        .find(|&verb| has(verb) && (verb != Verb::Put || goal.is_some()));
        let Some(verb) = verb else { return false };
        let goal = goal.filter(|_| verb == Verb::Put);
        let place = last(&chart.places).map(|(_, i)| i);
        let targets = (0..words.len()).find_map(|at| {
            let longest = chart.objects[at].iter().map(|(end, _)| *end).max()?;
            let nodes = chart.objects[at].iter().filter(|(end, _)| *end == longest);
            let of = |(_, i): &(usize, usize)| {
                denotes(
                    self.grammar,
                    self.scene,
                    &chart.nodes[*i],
                    role(verb),
                    place,
                )
            };
            let found: Vec<usize> = nodes.flat_map(of).collect();
            (!found.is_empty()).then_some(found)
        });
        let Some(targets) = targets else { return false };
        let goals = goal.map_or(vec![None], |(_, noun)| self.goals(noun));
        for target in targets {
            out.extend(goals.iter().map(|&goal| Meaning { verb, target, goal }));
        }
        true
    }
}

/// Role of a verb's target.
pub(crate) fn role(verb: Verb) -> Role {
    match verb {
        Verb::Lift | Verb::Put | Verb::Bring | Verb::Give => Role::Object,
        Verb::Open | Verb::Close => Role::Slide,
    }
}
