//! A file of a grammar during loading: its texts as patterns, and errors with file, line, key,
//! value found and allowed values.

use std::collections::BTreeSet;
use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::Spanned;

use crate::entries::{NounEntry, PhraseEntry};
use crate::grammar::{GrammarError, Means, Names, Noun, Pattern, Phrase, Piece, Slot, Use};
use crate::space::{Order, Side};
use crate::words::words;

/// A file during loading.
pub(crate) struct File<'a> {
    pub name: &'a str,
    pub text: &'a str,
}

impl File<'_> {
    fn line(&self, span: &Range<usize>) -> usize {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        before.matches('\n').count() + 1
    }

    pub(crate) fn wrong(
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

    pub(crate) fn parse<T: DeserializeOwned>(&self) -> Result<T, GrammarError> {
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

    pub(crate) fn provenance(
        &self,
        texts: [(&str, &Spanned<String>); 2],
    ) -> Result<(), GrammarError> {
        for (key, text) in texts {
            if text.get_ref().trim().is_empty() {
                return Err(self.wrong(&text.span(), key, "empty", "its origin and its licence"));
            }
        }
        Ok(())
    }

    pub(crate) fn use_of(
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

    /// The nouns of an entry.
    pub(crate) fn nouns(
        &self,
        entry: &NounEntry,
        names: &Names,
        of: Use,
    ) -> Result<Vec<Noun>, GrammarError> {
        let texts = entry.texts.get_ref().iter();
        let nouns = texts.map(|text| {
            Ok(Noun {
                text: text.get_ref().clone(),
                words: self.plain(text)?,
                names: names.clone(),
                number: entry.number,
                is_contents: entry.contents,
                takes_colour: entry.colour.unwrap_or(!entry.contents),
                has_tail: entry.tail,
                of,
            })
        });
        nouns.collect()
    }

    /// The words of a text without slots.
    pub(crate) fn plain(&self, text: &Spanned<String>) -> Result<Vec<String>, GrammarError> {
        let found = words(text.get_ref());
        if found.is_empty() || text.get_ref().contains(['{', '}']) {
            let what = format!("{:?}", text.get_ref());
            return Err(self.wrong(&text.span(), "texts", what, "words without { }"));
        }
        Ok(found)
    }

    /// A text with slots of these.
    pub(crate) fn pattern(
        &self,
        text: &Spanned<String>,
        allowed: &[Slot],
    ) -> Result<Pattern, GrammarError> {
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

    /// The phrases of an entry.
    pub(crate) fn phrases(&self, entry: &PhraseEntry) -> Result<Vec<Phrase>, GrammarError> {
        let of = self.use_of(entry.split.as_ref(), entry.generated)?;
        let word = entry.means.get_ref().as_str();
        let Some((_, means)) = MEANS.iter().find(|(name, _)| *name == word) else {
            let known = MEANS.map(|(name, _)| name).join(", ");
            return Err(self.wrong(&entry.means.span(), "means", format!("{word:?}"), known));
        };
        let mut phrases = Vec::new();
        for text in &entry.texts {
            let pattern = self.pattern(
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
                return Err(self.wrong(
                    &text.span(),
                    "texts",
                    format!("{:?}", text.get_ref()),
                    allowed,
                ));
            }
            phrases.push(Phrase {
                pattern,
                means: *means,
                of,
            });
        }
        Ok(phrases)
    }

    /// Rejects kinds that no noun refers to.
    pub(crate) fn kinds(
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
const MEANS: [(&str, Means); 22] = [
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
    ("largest", Means::Order(Order::Large, Some(0))),
    ("smallest", Means::Order(Order::Small, Some(0))),
];
