//! Labels of episodes, which name their files: `STEM-NUMBER`.

use crate::v1;

/// Longest label, bytes.
pub const LONGEST: usize = 100;

/// Most digits of the number: a longer one is part of the stem.
const DIGITS: usize = 9;

/// The label of a scenario's first episode.
#[must_use]
pub fn for_scenario(scenario: &v1::Scenario) -> String {
    let task = match scenario.task() {
        "" => "episode",
        task => task,
    };
    numbered(&format!("{task}-seed{}", scenario.seed()), 1)
}

/// Stem and number of a label; number 1 without one.
#[must_use]
pub fn split(label: &str) -> (&str, u64) {
    label
        .rsplit_once('-')
        .filter(|(stem, digits)| !stem.is_empty() && is_number(digits))
        .and_then(|(stem, digits)| Some((stem, digits.parse().ok()?)))
        .unwrap_or((label, 1))
}

/// Whether a text is a label's number.
fn is_number(digits: &str) -> bool {
    (1..=DIGITS).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit())
}

/// The label of a stem and a number; a stem that is too long is cut.
#[must_use]
pub fn numbered(stem: &str, number: u64) -> String {
    let number = format!("-{number}");
    let mut end = stem.len().min(LONGEST.saturating_sub(number.len()));
    while !stem.is_char_boundary(end) {
        end -= 1;
    }
    format!("{}{number}", &stem[..end])
}

/// The label with its number incremented; an empty one stays empty.
#[must_use]
pub fn next(label: &str) -> String {
    if label.is_empty() {
        return String::new();
    }
    let (stem, number) = split(label);
    numbered(stem, number.saturating_add(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check;

    #[test]
    fn labels_count_up_and_keep_the_seed() {
        assert_eq!(next("try-9"), "try-10");
        assert_eq!(next("demo"), "demo-2");
        assert_eq!(next("pick_mustard-seed3"), "pick_mustard-seed3-2");
        assert_eq!(next(""), "");
        assert_eq!(split("-7"), ("-7", 1));
        for long in ["9".repeat(100), format!("{}-9", "a".repeat(98))] {
            let next = next(&long);
            assert!(next.len() <= LONGEST && next != long, "{next}");
            check::label(&next).unwrap();
        }
        let scenario = v1::Scenario {
            seed: Some(7),
            ..v1::Scenario::default()
        };
        assert_eq!(for_scenario(&scenario), "episode-seed7-1");
    }
}
