//! Loads the files of a grammar and reports errors with file, line, key, value found
//! and allowed values.

use std::collections::BTreeSet;
use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::Spanned;

use crate::entries::{NounsFile, PhrasesFile, PlacesFile, PolitenessFile, ReasonsFile, VerbFile};
use crate::grammar::{
    Colour, FILES, Form, Frame, GoalKind, Grammar, GrammarError, Means, NTH, Names, Noun, Pattern,
    Phrase, Piece, PlaceName, Posture, Preamble, Reason, Slot, Template, Use, Verb,
};
use crate::space::{Order, Side};
use crate::words::words;

/// A file during loading.
struct File<'a> {
    name: &'a str,
    text: &'a str,
}

impl File<'_> {
    fn line(&self, span: &Range<usize>) -> usize {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        before.matches('\n').count() + 1
    }

    fn wrong(
        &self,
        at: &Range<usize>,
        key: &str,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> GrammarError {
        GrammarError {
            file: self.name.to_owned(),
            line: self.line(at),
            key: key.to_owned(),
            found: found.into(),
            allowed: allowed.into(),
        }
    }

    fn parse<T: DeserializeOwned>(&self) -> Result<T, GrammarError> {
        toml::from_str(self.text).map_err(|e| {
            let at = e.span().unwrap_or(0..0);
            let found = self.text.get(at.clone()).unwrap_or_default();
            let found = found.lines().next().unwrap_or_default();
            self.wrong(
                &at,
                found.split('=').next().unwrap_or_default().trim(),
                format!("{found:?}"),
                e.message().trim().replace('\n', " "),
            )
        })
    }

    fn provenance(&self, texts: [(&str, &Spanned<String>); 2]) -> Result<(), GrammarError> {
        for (key, text) in texts {
            if text.get_ref().trim().is_empty() {
                return Err(self.wrong(&text.span(), key, "empty", "its origin and its licence"));
            }
        }
        Ok(())
    }

    fn use_of(
        &self,
        split: Option<&Spanned<String>>,
        generated: Option<bool>,
    ) -> Result<Use, GrammarError> {
        let held_out = match split.map(|s| s.get_ref().as_str()) {
            None | Some("train") => false,
            Some("held_out") => true,
            Some(other) => {
                let at = split.map_or(0..0, Spanned::span);
                return Err(self.wrong(
                    &at,
                    "split",
                    format!("{other:?}"),
                    "\"train\" or \"held_out\"",
                ));
            }
        };
        Ok(Use {
            held_out,
            is_generated: generated.unwrap_or(true),
        })
    }

    /// The words of a text without slots.
    fn plain(&self, text: &Spanned<String>) -> Result<Vec<String>, GrammarError> {
        let found = words(text.get_ref());
        if found.is_empty() || text.get_ref().contains(['{', '}']) {
            let what = format!("{:?}", text.get_ref());
            return Err(self.wrong(&text.span(), "texts", what, "words without { }"));
        }
        Ok(found)
    }

    /// A text with slots of these.
    fn pattern(&self, text: &Spanned<String>, allowed: &[Slot]) -> Result<Pattern, GrammarError> {
        let listed: Vec<String> = Slot::ALL
            .iter()
            .filter(|(_, slot)| allowed.contains(slot))
            .map(|(name, _)| format!("{{{name}}}"))
            .collect();
        let wrong = || {
            let allowed = format!(
                "words, {{one/several}} and each at most once of {}",
                listed.join(", ")
            );
            self.wrong(
                &text.span(),
                "texts",
                format!("{:?}", text.get_ref()),
                allowed,
            )
        };
        let mut pieces = Vec::new();
        for part in text.get_ref().split_inclusive('}') {
            let (before, slot) = match part.split_once('{') {
                Some((before, slot)) => (before, Some(slot.strip_suffix('}').ok_or_else(wrong)?)),
                None if part.ends_with('}') => return Err(wrong()),
                None => (part, None),
            };
            pieces.extend(words(before).into_iter().map(Piece::Word));
            if let Some((one, many)) = slot.and_then(|slot| slot.split_once('/')) {
                let forms = [one, many].map(words);
                let [[one], [many]] = [&forms[0][..], &forms[1][..]] else {
                    return Err(wrong());
                };
                pieces.push(Piece::Agreement([one.clone(), many.clone()]));
            } else if let Some(name) = slot {
                let known = Slot::ALL.iter().find(|(known, _)| *known == name);
                let (_, slot) = known
                    .filter(|(_, s)| allowed.contains(s))
                    .ok_or_else(wrong)?;
                if pieces.contains(&Piece::Slot(*slot)) {
                    return Err(wrong());
                }
                pieces.push(Piece::Slot(*slot));
            }
        }
        if pieces.is_empty() {
            return Err(wrong());
        }
        Ok(Pattern {
            text: text.get_ref().clone(),
            pieces,
        })
    }

    /// Rejects kinds that no noun refers to.
    fn kinds(
        &self,
        key: &str,
        given: &Spanned<Vec<String>>,
        known: &BTreeSet<String>,
    ) -> Result<(), GrammarError> {
        match given.get_ref().iter().find(|kind| !known.contains(*kind)) {
            None => Ok(()),
            Some(kind) => {
                let known: Vec<&str> = known.iter().map(String::as_str).collect();
                Err(self.wrong(
                    &given.span(),
                    key,
                    format!("{kind:?}"),
                    format!("kinds of nouns.toml: {}", known.join(", ")),
                ))
            }
        }
    }
}

/// Values of `means` of a phrase.
const MEANS: [(&str, Means); 20] = [
    ("plain", Means::Plain),
    ("left_of", Means::Beside(Side::Left)),
    ("right_of", Means::Beside(Side::Right)),
    ("in_front_of", Means::Beside(Side::Front)),
    ("behind", Means::Beside(Side::Behind)),
    ("next_to", Means::Next),
    ("nth_from_left", Means::Order(Order::Left, None)),
    ("nth_from_right", Means::Order(Order::Right, None)),
    ("nth_from_top", Means::Order(Order::Top, None)),
    ("nth_from_bottom", Means::Order(Order::Bottom, None)),
    ("first_from_top", Means::Order(Order::Top, Some(0))),
    ("second_from_top", Means::Order(Order::Top, Some(1))),
    ("first_from_bottom", Means::Order(Order::Bottom, Some(0))),
    ("second_from_bottom", Means::Order(Order::Bottom, Some(1))),
    ("first_from_left", Means::Order(Order::Left, Some(0))),
    ("first_from_right", Means::Order(Order::Right, Some(0))),
    ("nearest_edge", Means::Order(Order::Edge, Some(0))),
    ("nearest_chair", Means::Order(Order::Chair, Some(0))),
    ("nearest_arm", Means::Order(Order::Arm, Some(0))),
    ("farthest_chair", Means::Order(Order::Far, Some(0))),
];

impl Grammar {
    /// Loads a grammar; `text` returns the text of each of [`FILES`].
    ///
    /// # Errors
    /// When one of them is invalid.
    pub fn read(text: &dyn Fn(&str) -> Option<String>) -> Result<Self, GrammarError> {
        let all = FILES.map(|name| (name, text(name)));
        let [nouns, places, phrases, reasons, politeness, verbs @ ..] = &all;
        let mut out = Self {
            colours: Vec::new(),
            nouns: Vec::new(),
            postures: Vec::new(),
            places: Vec::new(),
            goals: Vec::new(),
            phrases: Vec::new(),
            reasons: Vec::new(),
            before: Vec::new(),
            after: Vec::new(),
            understood_after: Vec::new(),
            thanks: Vec::new(),
            frames: Vec::new(),
            templates: Vec::new(),
            verb_words: Vec::new(),
            vocabulary: NTH.iter().map(|word| (*word).to_owned()).collect(),
        };
        let kinds = out.read_nouns(&open(nouns)?)?;
        out.read_places(&open(places)?)?;
        out.read_phrases(&open(phrases)?)?;
        out.read_reasons(&open(reasons)?, &kinds)?;
        out.read_politeness(&open(politeness)?)?;
        for verb in verbs {
            out.read_verb(&open(verb)?, &kinds)?;
        }
        out.vocabulary.insert("the".to_owned());
        Ok(out)
    }

    fn know<'a>(&mut self, words: impl IntoIterator<Item = &'a String>) {
        self.vocabulary.extend(words.into_iter().cloned());
    }

    fn know_pattern(&mut self, pattern: &Pattern) {
        for piece in &pattern.pieces {
            match piece {
                Piece::Word(word) => self.know([word]),
                Piece::Agreement(forms) => self.know(forms),
                Piece::Slot(_) => {}
            }
        }
    }

    fn read_nouns(&mut self, file: &File<'_>) -> Result<BTreeSet<String>, GrammarError> {
        let read: NounsFile = file.parse()?;
        file.provenance([("origin", &read.origin), ("license", &read.license)])?;
        let mut kinds = BTreeSet::new();
        for colour in &read.colour {
            let spoken = colour.texts.iter().map(|text| (text, true));
            let understood = colour.understood.iter().map(|text| (text, false));
            for (text, is_spoken) in spoken.chain(understood) {
                let words = file.plain(text)?;
                self.know(&words);
                self.colours.push(Colour {
                    name: colour.name.clone(),
                    text: text.get_ref().clone(),
                    words,
                    is_spoken,
                });
            }
        }
        for entry in &read.noun {
            let of = file.use_of(entry.split.as_ref(), entry.generated)?;
            let names = match (&entry.of, &entry.category, &entry.goal) {
                (Some(of), None, None) if !of.is_empty() => {
                    kinds.extend(of.iter().cloned());
                    Names::Kinds(of.clone())
                }
                (None, Some(category), None) => Names::Category(category.clone()),
                (None, None, Some(goal)) => Names::Goal(goal.clone()),
                _ => {
                    let at = entry.texts.span();
                    return Err(file.wrong(
                        &at,
                        "noun",
                        "of, category, goal together or none of them",
                        "one of them",
                    ));
                }
            };
            for text in entry.texts.get_ref() {
                let words = file.plain(text)?;
                self.know(&words);
                self.nouns.push(Noun {
                    text: text.get_ref().clone(),
                    words,
                    names: names.clone(),
                    number: entry.number,
                    is_contents: entry.contents,
                    takes_colour: entry.colour.unwrap_or(!entry.contents),
                    has_tail: entry.tail,
                    of,
                });
            }
        }
        for entry in &read.posture {
            file.kinds("of", &entry.of, &kinds)?;
            let texts = [&entry.participle, &entry.verbs[0], &entry.verbs[1]];
            for text in texts {
                let words = file.plain(text)?;
                self.know(&words);
            }
            self.postures.push(Posture {
                participle: entry.participle.get_ref().clone(),
                verbs: entry.verbs.each_ref().map(|verb| verb.get_ref().clone()),
                kinds: entry.of.get_ref().clone(),
            });
        }
        Ok(kinds)
    }

    fn read_places(&mut self, file: &File<'_>) -> Result<(), GrammarError> {
        let read: PlacesFile = file.parse()?;
        file.provenance([("origin", &read.origin), ("license", &read.license)])?;
        for entry in &read.goal {
            let goals = entry.of.get_ref().clone();
            let is_named = |goal: &String| {
                let names = |noun: &Noun| noun.names == Names::Goal(goal.clone());
                self.nouns.iter().any(names)
            };
            if let Some(unknown) = goals.iter().find(|goal| !is_named(goal)) {
                let found = format!("{unknown:?}");
                return Err(file.wrong(&entry.of.span(), "of", found, "goals of nouns.toml"));
            }
            for text in [&entry.at, &entry.to] {
                let words = file.plain(text)?;
                self.know(&words);
            }
            self.goals.push(GoalKind {
                goals,
                holds: entry.holds,
                at: entry.at.get_ref().clone(),
                to: entry.to.get_ref().clone(),
            });
        }
        let named = self.nouns.iter().filter_map(|noun| match &noun.names {
            Names::Goal(goal) => Some(goal),
            Names::Kinds(_) | Names::Category(_) => None,
        });
        if let Some(missing) = named.into_iter().find(|goal| self.goal(goal).is_none()) {
            let found = format!("no entry of {missing:?}");
            return Err(file.wrong(&(0..0), "goal", found, "each goal of nouns.toml once"));
        }
        for entry in &read.place {
            let of = file.use_of(entry.split.as_ref(), entry.generated)?;
            let lists = [
                ("where", Some(&entry.on)),
                ("from", Some(&entry.from)),
                ("understood", entry.understood.as_ref()),
            ];
            for (key, list) in lists {
                let Some(list) = list else { continue };
                let prepositions = list.get_ref();
                let is_missing = key == "where" && prepositions.is_empty();
                if is_missing || prepositions.iter().any(|p| words(p).len() != 1) {
                    return Err(file.wrong(
                        &list.span(),
                        key,
                        format!("{prepositions:?}"),
                        "a list of single words",
                    ));
                }
                self.know(prepositions);
            }
            let understood = entry.understood.as_ref();
            for text in &entry.texts {
                let words = file.plain(text)?;
                self.know(&words);
                self.places.push(PlaceName {
                    area: entry.area.clone(),
                    text: text.get_ref().clone(),
                    words,
                    on: entry.on.get_ref().clone(),
                    from: entry.from.get_ref().clone(),
                    understood: understood.map_or_else(Vec::new, |list| list.get_ref().clone()),
                    is_drive: entry.drive.unwrap_or(true),
                    of,
                });
            }
        }
        Ok(())
    }

    fn read_phrases(&mut self, file: &File<'_>) -> Result<(), GrammarError> {
        let read: PhrasesFile = file.parse()?;
        file.provenance([("origin", &read.origin), ("license", &read.license)])?;
        for entry in &read.phrase {
            let of = file.use_of(entry.split.as_ref(), entry.generated)?;
            let word = entry.means.get_ref().as_str();
            let Some((_, means)) = MEANS.iter().find(|(name, _)| *name == word) else {
                let known = MEANS.map(|(name, _)| name).join(", ");
                return Err(file.wrong(&entry.means.span(), "means", format!("{word:?}"), known));
            };
            for text in &entry.texts {
                let pattern = file.pattern(
                    text,
                    &[
                        Slot::Noun,
                        Slot::Other,
                        Slot::Nth,
                        Slot::At,
                        Slot::On,
                        Slot::From,
                        Slot::Standing,
                        Slot::Stands,
                    ],
                )?;
                let needs = [
                    (Slot::Noun, true),
                    (Slot::Other, matches!(means, Means::Beside(_) | Means::Next)),
                    (Slot::Nth, matches!(means, Means::Order(_, None))),
                ];
                if needs
                    .iter()
                    .any(|(slot, needed)| pattern.has(*slot) != *needed)
                {
                    let allowed = "{noun}; {other} with a relation to another object, {nth} with nth_…, and no other";
                    return Err(file.wrong(
                        &text.span(),
                        "texts",
                        format!("{:?}", text.get_ref()),
                        allowed,
                    ));
                }
                self.know_pattern(&pattern);
                self.phrases.push(Phrase {
                    pattern,
                    means: *means,
                    of,
                });
            }
        }
        Ok(())
    }

    fn read_reasons(
        &mut self,
        file: &File<'_>,
        kinds: &BTreeSet<String>,
    ) -> Result<(), GrammarError> {
        let read: ReasonsFile = file.parse()?;
        file.provenance([("origin", &read.origin), ("license", &read.license)])?;
        for entry in &read.reason {
            file.kinds("of", &entry.of, kinds)?;
            if entry.verbs.get_ref().is_empty() {
                let allowed = "the verbs with which the reasons are spoken";
                return Err(file.wrong(&entry.verbs.span(), "verbs", "[]", allowed));
            }
            for text in &entry.texts {
                let words = file.plain(text)?;
                self.know(&words);
                self.reasons.push(Reason {
                    text: text.get_ref().clone(),
                    words,
                    kinds: entry.of.get_ref().clone(),
                    verbs: entry.verbs.get_ref().clone(),
                });
            }
        }
        Ok(())
    }

    fn read_politeness(&mut self, file: &File<'_>) -> Result<(), GrammarError> {
        let read: PolitenessFile = file.parse()?;
        file.provenance([("origin", &read.origin), ("license", &read.license)])?;
        let lists = [
            (&read.after, &mut self.after),
            (&read.thanks, &mut self.thanks),
        ];
        for (texts, list) in lists {
            for text in texts {
                let words = file.plain(text)?;
                self.vocabulary.extend(words.iter().cloned());
                list.push((text.get_ref().clone(), words));
            }
        }
        for entry in &read.before {
            for text in &entry.texts {
                let words = file.plain(text)?;
                self.know(&words);
                self.before.push(Preamble {
                    text: text.get_ref().clone(),
                    words,
                    is_question: entry.question,
                    has_comma: entry.comma,
                    opens: entry.opens,
                    is_spoken: true,
                });
            }
        }
        for text in &read.understood_before {
            let words = file.plain(text)?;
            self.know(&words);
            self.before.push(Preamble {
                text: text.get_ref().clone(),
                words,
                is_question: false,
                has_comma: false,
                opens: false,
                is_spoken: false,
            });
        }
        for text in &read.understood_after {
            let words = file.plain(text)?;
            self.know(&words);
            self.understood_after.push(words);
        }
        for text in &read.reasons {
            let both = ["{reason}", "{request}"].map(|slot| text.get_ref().find(slot));
            let [Some(reason), Some(request)] = both else {
                let found = format!("{:?}", text.get_ref());
                return Err(file.wrong(
                    &text.span(),
                    "reasons",
                    found,
                    "{reason} and {request} with words between them",
                ));
            };
            let (from, to) = match reason < request {
                true => (reason + "{reason}".len(), request),
                false => (request + "{request}".len(), reason),
            };
            let between = words(text.get_ref().get(from..to).unwrap_or_default());
            self.know(&between);
            self.frames.push(Frame {
                text: text.get_ref().clone(),
                reason_first: reason < request,
                between,
            });
        }
        Ok(())
    }

    fn read_verb(&mut self, file: &File<'_>, kinds: &BTreeSet<String>) -> Result<(), GrammarError> {
        let read: VerbFile = file.parse()?;
        file.provenance([("origin", &read.origin), ("license", &read.license)])?;
        let verb = read.verb;
        self.verb_words
            .extend(read.words.into_iter().map(|word| (word, verb)));
        for entry in &read.template {
            let of = file.use_of(entry.split.as_ref(), entry.generated)?;
            let form = match entry.form.as_ref().map(|f| f.get_ref().as_str()) {
                None | Some("request") => Form::Request,
                Some("wish") => Form::Wish,
                Some("statement") => Form::Statement,
                Some(other) => {
                    let at = entry.form.as_ref().map_or(0..0, Spanned::span);
                    return Err(file.wrong(
                        &at,
                        "form",
                        format!("{other:?}"),
                        "\"request\", \"wish\" or \"statement\"",
                    ));
                }
            };
            let wants = match &entry.wants {
                None => Vec::new(),
                Some(wants) => {
                    file.kinds("wants", wants, kinds)?;
                    wants.get_ref().clone()
                }
            };
            let of_kinds = match &entry.of {
                None => Vec::new(),
                Some(of) => {
                    file.kinds("of", of, kinds)?;
                    of.get_ref().clone()
                }
            };
            let holds = entry.holds.as_ref();
            if let Some(holds) = holds.filter(|_| verb != Verb::Put) {
                let found = format!("{:?}", holds.get_ref());
                return Err(file.wrong(&holds.span(), "holds", found, "only with the verb put"));
            }
            for text in &entry.texts {
                let pattern = file.pattern(
                    text,
                    &[
                        Slot::Object,
                        Slot::Goal,
                        Slot::AtGoal,
                        Slot::ToGoal,
                        Slot::Place,
                        Slot::At,
                        Slot::On,
                        Slot::From,
                    ],
                )?;
                let found = || format!("{:?}", text.get_ref());
                if pattern.has(Slot::Object) != wants.is_empty() {
                    return Err(file.wrong(
                        &text.span(),
                        "texts",
                        found(),
                        "either {object} or a list `wants`",
                    ));
                }
                if pattern.has_any(&Slot::GOALS) != (verb == Verb::Put) {
                    return Err(file.wrong(
                        &text.span(),
                        "texts",
                        found(),
                        "{goal}, {at_goal} or {to_goal} with the verb put, and with no other",
                    ));
                }
                let id = format!("{}/{}", verb.word(), words(text.get_ref()).join("-"));
                if self.templates.iter().any(|t| t.id == id) {
                    return Err(file.wrong(&text.span(), "texts", found(), "each text once"));
                }
                self.know_pattern(&pattern);
                self.templates.push(Template {
                    id,
                    verb,
                    pattern,
                    form,
                    wants: wants.clone(),
                    kinds: of_kinds.clone(),
                    holds: holds.map(|holds| *holds.get_ref()),
                    removes: entry.removes,
                    of,
                });
            }
        }
        Ok(())
    }
}

/// An existing file.
fn open<'a>((name, text): &'a (&'static str, Option<String>)) -> Result<File<'a>, GrammarError> {
    match text {
        Some(text) => Ok(File { name, text }),
        None => Err(GrammarError {
            file: (*name).to_owned(),
            line: 1,
            key: "file".to_owned(),
            found: "absent".to_owned(),
            allowed: format!("{} in assets/language", FILES.join(", ")),
        }),
    }
}
