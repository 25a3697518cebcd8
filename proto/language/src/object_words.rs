//! Words for objects of packs, whose kinds have no entry in `nouns.toml`: their own nouns and the
//! names of their categories (`categories.toml`). A category without an entry is its own word.

use std::collections::{BTreeMap, BTreeSet};

use crate::entries::CategoriesFile;
use crate::file::File;
use crate::grammar::{Grammar, GrammarError, Names, Noun};
use crate::home_words::noun;
use crate::scene::{Entity, Role, Scene};
use crate::words::words;

impl Grammar {
    /// Reads `categories.toml`.
    pub(crate) fn read_categories(&mut self, file: &File<'_>) -> Result<(), GrammarError> {
        let read: CategoriesFile = file.parse()?;
        file.provenance([("origin", &read.origin), ("license", &read.license)])?;
        for entry in &read.noun {
            let of = file.use_of(entry.split.as_ref(), entry.generated)?;
            let category = match (&entry.category, &entry.of, &entry.goal) {
                (Some(category), None, None) => category.clone(),
                _ => {
                    let at = entry.texts.span();
                    return Err(file.wrong(&at, "noun", "of or goal", "category alone"));
                }
            };
            let nouns = file.nouns(entry, &Names::Category(category), of)?;
            self.homes.categories.extend(nouns);
        }
        Ok(())
    }

    /// Adds names of the objects of a scene whose kinds have none.
    pub(crate) fn add_objects(&mut self, scene: &Scene) {
        let is_named = |entity: &Entity| {
            let names = |noun: &Noun| matches!(&noun.names, Names::Kinds(kinds) if kinds.contains(&entity.kind));
            self.nouns.iter().any(names)
        };
        let unnamed = scene.entities.iter().filter(|entity| {
            entity.role == Role::Object && !entity.category.is_empty() && !is_named(entity)
        });
        let unnamed: Vec<&Entity> = unnamed.collect();
        let mut by_noun: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        let mut categories = BTreeSet::new();
        for entity in &unnamed {
            categories.insert(entity.category.as_str());
            if is_plain(&entity.noun) {
                let kinds = by_noun.entry(entity.noun.as_str()).or_default();
                kinds.push(entity.kind.clone());
            }
        }
        for category in categories {
            let mut added = self.names_of_category(category);
            // Its own word, when it has none.
            let names = Names::Category(category.to_owned());
            if added.is_empty() && self.nouns.iter().all(|noun| noun.names != names) {
                let text = category.replace(['_', '-'], " ");
                added.push(noun(&text, words(&text), names));
            }
            added.retain(|noun| {
                let mut known = self.nouns.iter().filter(|known| known.names == noun.names);
                known.all(|known| known.words != noun.words)
            });
            for noun in added {
                by_noun.remove(noun.text.as_str());
                self.know(&noun.words);
                self.nouns.push(noun);
            }
        }
        for (text, mut kinds) in by_noun {
            kinds.sort();
            kinds.dedup();
            let words = words(text);
            self.know(&words);
            self.nouns.push(Noun {
                takes_colour: true,
                ..noun(text, words, Names::Kinds(kinds))
            });
        }
    }

    /// The entries of a category in `categories.toml`.
    fn names_of_category(&self, category: &str) -> Vec<Noun> {
        let all = self.homes.categories.iter();
        let own = all.filter(|noun| matches!(&noun.names, Names::Category(own) if own == category));
        own.cloned().collect()
    }

    /// Number of names of a category in `categories.toml` that training generates, and of those
    /// that are held out.
    #[must_use]
    pub fn category_name_count(&self, category: &str) -> (usize, usize) {
        let names = self.names_of_category(category);
        let generated = names.iter().filter(|noun| noun.of.is_generated);
        let (held_out, train): (Vec<_>, Vec<_>) = generated.partition(|noun| noun.of.held_out);
        (train.len(), held_out.len())
    }
}

/// Whether a noun of a pack can be a part of sentences.
fn is_plain(noun: &str) -> bool {
    !noun.is_empty()
        && noun
            .chars()
            .all(|c| c.is_alphanumeric() || " -'".contains(c))
}
