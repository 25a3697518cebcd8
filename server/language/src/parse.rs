//! The parser: what a sentence asks for in a scene, or what is to be asked back.
//!
//! It tries every way in which politeness, reasons, templates and phrases of the
//! grammar make the sentence, and takes the union of what they mean. A sentence
//! that no template makes is searched for a verb and for phrases.

use std::collections::BTreeSet;

use crate::chart::Chart;
use crate::grammar::{Grammar, Verb};
use crate::meaning::{Meaning, Named, denotes, fits};
use crate::question::question;
use crate::scene::{Role, Scene};
use crate::words::{mended, words};

/// What the parser says of a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// It means one thing.
    Clear(Meaning),
    /// It may mean several.
    Ambiguous {
        /// Each of them.
        meanings: Vec<Meaning>,
        /// What to ask back.
        question: String,
    },
    /// It is understood, and nothing in the scene fits.
    Nothing,
    /// It is not understood.
    Unknown,
}

/// A parser for sentences about one scene.
#[derive(Clone, Copy, Debug)]
pub struct Parser<'a> {
    grammar: &'a Grammar,
    scene: &'a Scene,
}

/// Most words of a sentence that is parsed.
const LONGEST: usize = 80;

impl<'a> Parser<'a> {
    /// A parser of this grammar about this scene.
    #[must_use]
    pub fn new(grammar: &'a Grammar, scene: &'a Scene) -> Self {
        Self { grammar, scene }
    }

    /// What a sentence asks for.
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

    /// Whether templates make the sentence; adds what they mean.
    fn templates(&self, words: &[String], out: &mut BTreeSet<Meaning>) -> bool {
        let chart = Chart::of(self.grammar, words);
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

    /// Things of kinds of which any is meant.
    fn wanted(&self, wants: &[String], place: Option<usize>) -> Vec<usize> {
        let area = place.map(|i| self.grammar.places[i].area.as_str());
        let things = self.scene.things.iter().enumerate();
        let is_there = |of: Option<usize>| match area {
            None => true,
            Some(area) => of.is_some_and(|i| self.scene.areas[i].name == area),
        };
        things
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

    /// Where a request may stand between politeness and reasons: first word, and
    /// the one behind the last.
    fn requests(&self, words: &[String]) -> Vec<(usize, usize)> {
        let mut spans = vec![(0, words.len())];
        for frame in &self.grammar.frames {
            for reason in &self.grammar.reasons {
                let (n, all) = (reason.words.len(), words.len());
                let m = n + frame.between.len();
                if m >= all {
                    continue;
                }
                let (first, second) = match frame.reason_first {
                    true => (&reason.words, &frame.between),
                    false => (&frame.between, &reason.words),
                };
                let beside = match frame.reason_first {
                    true => &words[..m],
                    false => &words[all - m..],
                };
                if beside.iter().eq(first.iter().chain(second)) {
                    spans.push(match frame.reason_first {
                        true => (m, all),
                        false => (0, all - m),
                    });
                }
            }
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

    /// Looks for a verb and for the longest phrases where no template fits.
    fn search(&self, words: &[String], out: &mut BTreeSet<Meaning>) -> bool {
        let chart = Chart::of(self.grammar, words);
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
        // What is put has a place; what opens or closes slides.
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

/// What a verb is done with.
pub(crate) fn role(verb: Verb) -> Role {
    match verb {
        Verb::Lift | Verb::Put | Verb::Bring | Verb::Give => Role::Object,
        Verb::Open | Verb::Close => Role::Slide,
    }
}
