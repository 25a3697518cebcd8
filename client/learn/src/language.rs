//! Words of a sentence as numbers: the share of each word of a vocabulary.

use std::collections::{BTreeSet, HashMap};

/// Stands for all words that were never seen; the first of every vocabulary.
pub const UNKNOWN: &str = "<unknown>";

/// Words of a sentence that are read in their order, as in `network.py`: the work grows
/// with their square, and an instruction may be of any length.
const READ: usize = 128;

/// Words with their places.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Vocabulary {
    places: HashMap<String, usize>,
    size: usize,
}

impl Vocabulary {
    /// Of a card's words, the unknown one first; none: no sentence is read.
    #[must_use]
    pub fn new(words: &[String]) -> Self {
        let places = words.iter().cloned().enumerate();
        Self {
            places: places.map(|(place, word)| (word, place)).collect(),
            size: words.len(),
        }
    }

    /// Share of each word in a sentence.
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

    /// Places of its words in their order, 0 for one that was never seen; of a long
    /// sentence those of the first 128.
    #[must_use]
    pub fn in_order(&self, sentence: &str) -> Vec<i32> {
        let words = words_of(sentence);
        let place = |word: &String| self.places.get(word).copied().unwrap_or(0);
        let read = words.iter().take(READ);
        read.map(|word| place(word) as i32).collect()
    }
}

/// All words of sentences in order, the unknown one first.
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
    fn words_are_those_of_the_trainer() {
        let told = words_of("Please, get me the mug that's LEFT of box-2!");
        let wanted = "please get me the mug that's left of box 2";
        assert_eq!(told.join(" "), wanted);
    }

    #[test]
    fn a_sentence_is_shares_of_known_words() {
        let all = vocabulary(["the mug", "The can"].into_iter());
        assert_eq!(all, [UNKNOWN, "can", "mug", "the"]);
        let all = Vocabulary::new(&all);
        assert_eq!(all.shares("The red mug, the mug"), [0.2, 0.0, 0.4, 0.4]);
        assert_eq!(all.in_order("The red mug, the mug"), [3, 0, 2, 3, 2]);
        assert_eq!(all.shares(""), [0.0; 4]);
        let long = format!("mug {}", "the can ".repeat(30_000));
        let told = all.in_order(&long);
        assert_eq!((told.len(), &told[..3]), (READ, &[2, 3, 1][..]));
        assert!(Vocabulary::new(&[]).shares("the mug").is_empty());
    }
}
