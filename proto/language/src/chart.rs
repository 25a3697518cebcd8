//! Chart of a sentence: positions of names, places and phrases, and matching of
//! patterns.

use crate::grammar::{Grammar, Means, NTH, Names, Pattern, Piece, Slot};
use crate::meaning::{Named, Node};

/// Content of the slots of a pattern: nodes by their index in the chart, others by
/// theirs in the grammar.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bound {
    pub object: Option<usize>,
    pub goal: Option<usize>,
    pub place: Option<usize>,
    /// A place with a preposition.
    pub at: Option<usize>,
    noun: Option<Named>,
    other: Option<Named>,
    nth: Option<usize>,
}

/// All constituents of a sentence: by their first word, with their end and content.
pub(crate) struct Chart<'a> {
    words: &'a [String],
    pub nodes: Vec<Node>,
    pub objects: Vec<Vec<(usize, usize)>>,
    pub goals: Vec<Vec<(usize, usize)>>,
    /// Goals with a preposition.
    at_goals: Vec<Vec<(usize, usize)>>,
    /// Words for postures, by their end.
    participles: Vec<bool>,
    posture_verbs: Vec<bool>,
    pub places: Vec<Vec<(usize, usize)>>,
    ats: Vec<Vec<(usize, usize)>>,
    named: Vec<Vec<(usize, Named)>>,
    others: Vec<Vec<(usize, Named)>>,
}

impl<'a> Chart<'a> {
    pub fn new(grammar: &Grammar, words: &'a [String]) -> Self {
        let count = words.len();
        let starts_with = |at: usize, part: &[String]| words[at..].starts_with(part);
        let each = |f: &dyn Fn(usize) -> Vec<(usize, usize)>| (0..count).map(f).collect::<Vec<_>>();
        let places = each(&|at| {
            let all = grammar.places.iter().enumerate();
            let found = all.filter(|(_, place)| starts_with(at, &place.words));
            found
                .map(|(i, place)| (at + place.words.len(), i))
                .collect()
        });
        let ats = each(&|at| {
            let begun = places.get(at + 1).map_or(&[][..], Vec::as_slice);
            let fits = |(_, i): &&(usize, usize)| {
                let place = &grammar.places[*i];
                let lists = [&place.on, &place.from, &place.understood];
                lists.iter().any(|list| list.contains(&words[at]))
            };
            begun.iter().filter(fits).copied().collect()
        });
        let nouns = each(&|at| {
            let all = grammar.nouns.iter().enumerate();
            let found = all.filter(|(_, noun)| starts_with(at, &noun.words));
            found.map(|(i, noun)| (at + noun.words.len(), i)).collect()
        });
        let named: Vec<Vec<(usize, Named)>> = (0..count)
            .map(|at| {
                let bare = nouns[at]
                    .iter()
                    .map(|&(end, noun)| (end, Named { colour: None, noun }));
                let colours = grammar.colours.iter().enumerate();
                let coloured = colours.filter(|(_, colour)| starts_with(at, &colour.words));
                let coloured = coloured.flat_map(|(i, colour)| {
                    let nouns = nouns
                        .get(at + colour.words.len())
                        .map_or(&[][..], Vec::as_slice);
                    nouns.iter().map(move |&(end, noun)| {
                        (
                            end,
                            Named {
                                colour: Some(i),
                                noun,
                            },
                        )
                    })
                });
                bare.chain(coloured).collect()
            })
            .collect();
        let others: Vec<Vec<(usize, Named)>> = (0..count)
            .map(|at| match words[at].as_str() {
                "the" => named.get(at + 1).cloned().unwrap_or_default(),
                _ => named[at].clone(),
            })
            .collect();
        let is_goal = |noun: usize| matches!(grammar.nouns[noun].names, Names::Goal(_));
        let goals: Vec<Vec<(usize, usize)>> = others
            .iter()
            .map(|found| {
                let goals = found
                    .iter()
                    .filter(|(_, n)| is_goal(n.noun) && n.colour.is_none());
                goals.map(|(end, n)| (*end, n.noun)).collect()
            })
            .collect();
        // People confuse the prepositions of goals: any of them is understood.
        let of_goals = |at: usize| {
            let kinds = grammar.goals.iter();
            kinds.flat_map(|g| [&g.at, &g.to]).any(|p| *p == words[at])
        };
        let at_goals = each(&|at| match of_goals(at) {
            true => goals.get(at + 1).cloned().unwrap_or_default(),
            false => Vec::new(),
        });
        let postures = &grammar.postures;
        let participles = words
            .iter()
            .map(|word| postures.iter().any(|p| p.participle == *word));
        let posture_verbs = words
            .iter()
            .map(|word| postures.iter().any(|p| p.verbs.contains(word)));
        let mut chart = Self {
            words,
            nodes: Vec::new(),
            objects: Vec::new(),
            goals,
            at_goals,
            participles: participles.collect(),
            posture_verbs: posture_verbs.collect(),
            places,
            ats,
            named,
            others,
        };
        for at in 0..count {
            let mut found = Vec::new();
            for phrase in &grammar.phrases {
                for (end, bound) in chart.matches(&phrase.pattern, at) {
                    let Some(noun) = bound.noun else { continue };
                    let means = match phrase.means {
                        Means::Order(order, None) => Means::Order(order, bound.nth),
                        means => means,
                    };
                    let node = Node {
                        means,
                        noun,
                        other: bound.other,
                        at: bound.at,
                    };
                    found.push((end, chart.nodes.len()));
                    chart.nodes.push(node);
                }
            }
            chart.objects.push(found);
        }
        chart
    }

    /// Ends of a pattern that begins at a word, with the content of its slots.
    pub fn matches(&self, pattern: &Pattern, at: usize) -> Vec<(usize, Bound)> {
        let mut out = Vec::new();
        self.go_on(&pattern.pieces, at, Bound::default(), &mut out);
        out
    }

    fn go_on(&self, pieces: &[Piece], at: usize, bound: Bound, out: &mut Vec<(usize, Bound)>) {
        let Some((piece, rest)) = pieces.split_first() else {
            out.push((at, bound));
            return;
        };
        let Some(here) = self.words.get(at) else {
            return;
        };
        let list = |lists: &[Vec<(usize, usize)>]| lists.get(at).cloned().unwrap_or_default();
        match piece {
            Piece::Word(word) if word == here => self.go_on(rest, at + 1, bound, out),
            Piece::Word(_) => {}
            // Agreement is not checked when parsing.
            Piece::Agreement(forms) if forms.contains(here) => {
                self.go_on(rest, at + 1, bound, out);
            }
            Piece::Agreement(_) => {}
            Piece::Slot(Slot::Standing) if self.participles[at] => {
                self.go_on(rest, at + 1, bound, out);
            }
            Piece::Slot(Slot::Stands) if self.posture_verbs[at] => {
                self.go_on(rest, at + 1, bound, out)
            }
            Piece::Slot(Slot::Standing | Slot::Stands) => {}
            Piece::Slot(Slot::AtGoal | Slot::ToGoal) => {
                for (end, i) in list(&self.at_goals) {
                    self.go_on(
                        rest,
                        end,
                        Bound {
                            goal: Some(i),
                            ..bound
                        },
                        out,
                    );
                }
            }
            Piece::Slot(Slot::Object) => {
                for (end, i) in list(&self.objects) {
                    self.go_on(
                        rest,
                        end,
                        Bound {
                            object: Some(i),
                            ..bound
                        },
                        out,
                    );
                }
            }
            Piece::Slot(Slot::Goal) => {
                for (end, i) in list(&self.goals) {
                    self.go_on(
                        rest,
                        end,
                        Bound {
                            goal: Some(i),
                            ..bound
                        },
                        out,
                    );
                }
            }
            Piece::Slot(Slot::Place) => {
                for (end, i) in list(&self.places) {
                    self.go_on(
                        rest,
                        end,
                        Bound {
                            place: Some(i),
                            ..bound
                        },
                        out,
                    );
                }
            }
            Piece::Slot(Slot::At | Slot::On | Slot::From) => {
                for (end, i) in list(&self.ats) {
                    self.go_on(
                        rest,
                        end,
                        Bound {
                            at: Some(i),
                            ..bound
                        },
                        out,
                    );
                }
            }
            Piece::Slot(Slot::Noun) => {
                for &(end, named) in &self.named[at] {
                    self.go_on(
                        rest,
                        end,
                        Bound {
                            noun: Some(named),
                            ..bound
                        },
                        out,
                    );
                }
            }
            Piece::Slot(Slot::Other) => {
                for &(end, named) in &self.others[at] {
                    self.go_on(
                        rest,
                        end,
                        Bound {
                            other: Some(named),
                            ..bound
                        },
                        out,
                    );
                }
            }
            Piece::Slot(Slot::Nth) => {
                if let Some(nth) = NTH.iter().position(|word| word == here) {
                    self.go_on(
                        rest,
                        at + 1,
                        Bound {
                            nth: Some(nth),
                            ..bound
                        },
                        out,
                    );
                }
            }
        }
    }
}
