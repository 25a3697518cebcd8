//! Sentences as words: lower case, without punctuation; and typing errors.

use std::collections::BTreeSet;

use crate::random::Random;

/// The words of a text: lower case, only letters and digits, hyphens split.
pub(crate) fn words(text: &str) -> Vec<String> {
    let mut out = Vec::new();
    for word in text.split(|c: char| c.is_whitespace() || c == '-') {
        let letters = word.chars().filter(|c| c.is_alphanumeric());
        let word: String = letters.flat_map(char::to_lowercase).collect();
        if !word.is_empty() {
            out.push(word);
        }
    }
    out
}

/// A text in normal form: lower case, without punctuation, single spaces.
#[must_use]
pub fn normalised(text: &str) -> String {
    words(text).join(" ")
}

/// Whether a name is a plural: "crackers", but not "box of crackers".
#[must_use]
pub fn is_plural(name: &str) -> bool {
    let noun = [" of ", " with ", " without ", " made "]
        .iter()
        .filter_map(|word| name.find(word))
        .min()
        .map_or(name, |end| &name[..end]);
    noun.ends_with('s') && !noun.ends_with("ss")
}

/// Shortest word with a typing error or correction, letters.
const LEAST: usize = 4;

/// The text with a typing error in one of its longer words: two letters exchanged, one
/// left out, or one repeated.
pub(crate) fn slip(text: &str, random: &mut Random) -> String {
    let mut parts: Vec<String> = text.split(' ').map(str::to_owned).collect();
    let long = |part: &String| {
        let letters = part.chars().filter(|c| c.is_ascii_lowercase()).count();
        letters >= LEAST && part.is_ascii()
    };
    let able: Vec<usize> = (0..parts.len()).filter(|&i| long(&parts[i])).collect();
    let Some(&chosen) = random.one(&able) else {
        return text.to_owned();
    };
    let mut letters: Vec<char> = parts[chosen].chars().collect();
    // The first letter is kept: people mistype the middle.
    let at = 1 + random.index(letters.len() - 2);
    if letters[at].is_ascii_lowercase() && letters[at + 1].is_ascii_lowercase() {
        match random.index(3) {
            0 => letters.swap(at, at + 1),
            1 => {
                letters.remove(at);
            }
            _ => letters.insert(at, letters[at]),
        }
    }
    parts[chosen] = letters.into_iter().collect();
    parts.join(" ")
}

/// Possible sentences before a typing error: itself when every word is known; otherwise
/// with each unknown word replaced by a known one at distance one, at most `MOST`
/// readings.
pub(crate) fn mended(words: &[String], known: &BTreeSet<String>) -> Vec<Vec<String>> {
    const MOST: usize = 16;
    let mut readings: Vec<Vec<String>> = vec![Vec::new()];
    for word in words {
        let mut choices: Vec<&String> = Vec::new();
        if known.contains(word) || word.len() + 1 < LEAST {
            choices.push(word);
        } else {
            choices.extend(known.iter().filter(|k| is_one_slip(k, word)));
            if choices.is_empty() {
                choices.push(word);
            }
        }
        let longer = readings.iter().flat_map(|reading| {
            choices.iter().map(|choice| {
                let mut reading = reading.clone();
                reading.push((*choice).clone());
                reading
            })
        });
        readings = longer.take(MOST).collect();
    }
    readings
}

/// Whether one insertion, deletion, replacement or exchange of neighbours converts one
/// word to the other (Damerau 1964).
fn is_one_slip(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len().abs_diff(b.len()) > 1 {
        return false;
    }
    let same = a.iter().zip(b).take_while(|(x, y)| x == y).count();
    let (a, b) = (&a[same..], &b[same..]);
    match a.len().cmp(&b.len()) {
        std::cmp::Ordering::Greater => a[1..] == *b,
        std::cmp::Ordering::Less => *a == b[1..],
        std::cmp::Ordering::Equal => {
            let replaced = a.len() <= 1 || a[1..] == b[1..];
            let exchanged = a.len() > 1 && a[0] == b[1] && a[1] == b[0] && a[2..] == b[2..];
            replaced || exchanged
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_typing_error_is_corrected_and_two_are_not() {
        for (a, b, is) in [
            ("mustard", "mustrad", true),
            ("mustard", "mustrd", true),
            ("mustard", "musttard", true),
            ("mustard", "mistard", true),
            ("mustard", "mustard", true),
            ("mustard", "msutrad", false),
            ("mug", "bag", false),
        ] {
            assert_eq!(is_one_slip(a, b), is, "{a} {b}");
            assert_eq!(is_one_slip(b, a), is, "{b} {a}");
        }
    }

    #[test]
    fn plurals_depend_on_the_noun_and_not_on_its_complement() {
        for name in ["crackers", "salty crackers"] {
            assert!(is_plural(name), "{name}");
        }
        for name in [
            "box of crackers",
            "mug",
            "bottle of glass",
            "glass",
            "cup with straight sides",
            "thermos bottle",
        ] {
            assert!(!is_plural(name), "{name}");
        }
    }

    #[test]
    fn typing_errors_change_one_word_and_keep_its_beginning() {
        let mut random = Random::for_purpose(1, "slips");
        for _ in 0..200 {
            let text = "Pick up the mustard bottle";
            let slipped = slip(text, &mut random);
            let pairs = text.split(' ').zip(slipped.split(' '));
            let changed: Vec<_> = pairs.filter(|(a, b)| a != b).collect();
            assert!(changed.len() <= 1, "{slipped}");
            for (a, b) in changed {
                assert!(is_one_slip(a, b) && a[..1] == b[..1], "{slipped}");
            }
        }
    }
}
