//! Sentences as numbers: the share of each word of a vocabulary, or the words in order.

use std::collections::{BTreeSet, HashMap};

/// Replaces every unknown word; the first word of every vocabulary.
pub const UNKNOWN: &str = "<unknown>";

/// Most words of a sentence that a text encoder reads, as in `network.py`: its work grows with
/// their square, and an instruction may have any length.
const MOST_WORDS: usize = 128;

/// Words with their indices.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Vocabulary {
    places: HashMap<String, usize>,
    size: usize,
}

impl Vocabulary {
    /// From a card's words, with the unknown word first; empty: no sentence is read.
    #[must_use]
    pub fn new(words: &[String]) -> Self {
        let places = words.iter().cloned().enumerate();
        Self {
            places: places.map(|(place, word)| (word, place)).collect(),
            size: words.len(),
        }
    }

    /// Share of each word of the vocabulary in a sentence.
    #[must_use]
    pub fn shares(&self, sentence: &str) -> Vec<f32> {
        let mut shares = vec![0.0; self.size];
        if self.size == 0 {
            return shares;
        }
        let words = words_of(sentence);
        for word in &words {
            let place = self.places.get(word).copied().unwrap_or(0);
            shares[place] += 1.0 / words.len() as f32;
        }
        shares
    }

    /// Indices of its words in order, 0 for an unknown word; of a long sentence the first 128.
    #[must_use]
    pub fn in_order(&self, sentence: &str) -> Vec<i32> {
        let words = words_of(sentence);
        let place = |word: &String| self.places.get(word).copied().unwrap_or(0);
        let read = words.iter().take(MOST_WORDS);
        read.map(|word| place(word) as i32).collect()
    }
}

/// All words of sentences, sorted, with the unknown word first.
#[must_use]
pub fn vocabulary<'a>(sentences: impl Iterator<Item = &'a str>) -> Vec<String> {
    let words: BTreeSet<String> = sentences.flat_map(words_of).collect();
    std::iter::once(UNKNOWN.to_owned()).chain(words).collect()
}

/// Words of a sentence, in lower case.
fn words_of(sentence: &str) -> Vec<String> {
    let lower = sentence.to_lowercase();
    let words = lower.split(|c: char| !(c.is_ascii_alphanumeric() || c == '\''));
    words
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_split_as_in_the_python_trainer() {
        let words = words_of("Please, get me the mug that's LEFT of box-2!");
        let wanted = "please get me the mug that's left of box 2";
        assert_eq!(words.join(" "), wanted);
    }

    #[test]
    fn sentence_becomes_shares_or_indices_of_known_words() {
        let all = vocabulary(["the mug", "The can"].into_iter());
        assert_eq!(all, [UNKNOWN, "can", "mug", "the"]);
        let all = Vocabulary::new(&all);
        assert_eq!(all.shares("The red mug, the mug"), [0.2, 0.0, 0.4, 0.4]);
        assert_eq!(all.in_order("The red mug, the mug"), [3, 0, 2, 3, 2]);
        assert_eq!(all.shares(""), [0.0; 4]);
        let long = format!("mug {}", "the can ".repeat(30_000));
        let words = all.in_order(&long);
        assert_eq!((words.len(), &words[..3]), (MOST_WORDS, &[2, 3, 1][..]));
        assert!(Vocabulary::new(&[]).shares("the mug").is_empty());
    }
}
