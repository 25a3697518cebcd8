//! Loads the files of a grammar and reports errors with file, line, key, value found
//! and allowed values.

use std::collections::BTreeSet;

use toml::Spanned;

use crate::entries::{NounsFile, PhrasesFile, PlacesFile, PolitenessFile, ReasonsFile, VerbFile};
use crate::file::File;
use crate::grammar::{
    Colour, FILES, Form, Frame, GoalKind, Grammar, GrammarError, HomeWords, NTH, Names, Noun,
    Pattern, Piece, PlaceName, Posture, Preamble, Reason, Slot, Template, Verb,
};
use crate::words::words;

impl Grammar {
    /// Loads a grammar; `text` returns the text of each of [`FILES`].
    ///
    /// # Errors
    /// When one of them is invalid.
    pub fn read(text: &dyn Fn(&str) -> Option<String>) -> Result<Self, GrammarError> {
        let all = FILES.map(|name| (name, text(name)));
        let [
            nouns,
            places,
            phrases,
            reasons,
            politeness,
            homes,
            categories,
            verbs @ ..,
        ] = &all;
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
            homes: HomeWords::default(),
            vocabulary: NTH.iter().map(|word| (*word).to_owned()).collect(),
        };
        let kinds = out.read_nouns(&open(nouns)?)?;
        out.read_places(&open(places)?)?;
        out.read_phrases(&open(phrases)?)?;
        out.read_reasons(&open(reasons)?, &kinds)?;
        out.read_politeness(&open(politeness)?)?;
        out.read_homes(&open(homes)?)?;
        out.read_categories(&open(categories)?)?;
        for verb in verbs {
            out.read_verb(&open(verb)?, &kinds)?;
        }
        out.vocabulary.insert("the".to_owned());
        Ok(out)
    }

    pub(crate) fn know<'a>(&mut self, words: impl IntoIterator<Item = &'a String>) {
        self.vocabulary.extend(words.into_iter().cloned());
    }

    pub(crate) fn know_pattern(&mut self, pattern: &Pattern) {
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
            for noun in file.nouns(entry, &names, of)? {
                self.know(&noun.words);
                self.nouns.push(noun);
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
            for phrase in file.phrases(entry)? {
                self.know_pattern(&phrase.pattern);
                self.phrases.push(phrase);
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
