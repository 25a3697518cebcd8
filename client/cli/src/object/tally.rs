//! Results of trials of an object.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use wheelarm_expert::shake::still_after;
use wheelarm_rollout::RolloutResult;

/// Trials of ten that have to succeed.
const NEEDED: u32 = 9;
/// Longest reason of a failure in the output, characters.
const LONGEST: usize = 60;

/// Results of trials: successes, and failures by their reason.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    pub of: u32,
    pub lifted: u32,
    pub failures: BTreeMap<String, u32>,
    /// Seconds of motion after each release.
    pub still_after: Vec<f64>,
    /// Of these, the objects that rest.
    pub rested: u32,
}

impl Tally {
    pub fn add(&mut self, result: &RolloutResult) {
        self.of += 1;
        let notes = result.iter().flat_map(|finished| &finished.notes);
        let still: Vec<f64> = notes.filter_map(|note| still_after(note)).collect();
        let (lifted, reason) = match result {
            Ok(finished) if finished.succeeded() => (true, String::new()),
            Ok(finished) => match finished.end() {
                end if end == "gave up" => (false, finished.why().unwrap_or(end)),
                end => (false, end),
            },
            Err(failure) => (false, failure.to_string()),
        };
        let rests = lifted && !still.is_empty();
        self.still_after.extend(still);
        self.rested += u32::from(rests);
        self.lifted += u32::from(lifted);
        if !lifted {
            *self.failures.entry(short(&reason)).or_default() += 1;
        }
    }

    pub fn is_enough(&self) -> bool {
        10 * self.lifted >= NEEDED * self.of
    }

    /// Whether a grasp with these trials is kept.
    pub fn is_half(&self) -> bool {
        2 * self.lifted >= self.of
    }

    /// For example `6 of 20 trials (4 slipped, 10 gave up)`.
    pub fn words(&self) -> String {
        let mut text = format!("{} of {} trials", self.lifted, self.of);
        if !self.failures.is_empty() {
            let failures = self.failures.iter().map(|(why, n)| format!("{n} {why}"));
            text += &format!(" ({})", failures.collect::<Vec<_>>().join(", "));
        }
        text
    }

    /// The same for programs.
    pub fn json(&self) -> Value {
        let last = self.still_after.iter().copied().fold(0.0, f64::max);
        json!({
            "of": self.of,
            "lifted": self.lifted,
            "failures": self.failures,
            "put_down": self.still_after.len(),
            "rested": self.rested,
            "still_after_s": (last * 100.0).round() / 100.0,
        })
    }
}

/// A reason without numbers, which would make each one different.
fn short(reason: &str) -> String {
    let first = reason.split([':', ';', '\n']).next().unwrap_or_default();
    let kept = first.chars().filter(|c| !c.is_ascii_digit());
    let kept: String = kept.take(LONGEST).collect();
    kept.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nine_of_ten_trials_are_needed() {
        let tally = |lifted| Tally {
            of: 20,
            lifted,
            failures: BTreeMap::from([("dropped".to_owned(), 20 - lifted)]),
            ..Tally::default()
        };
        assert!(tally(18).is_enough() && !tally(17).is_enough());
        assert!(tally(10).is_half() && !tally(9).is_half());
        assert_eq!(tally(6).words(), "6 of 20 trials (14 dropped)");
    }

    #[test]
    fn reasons_that_differ_in_numbers_are_one() {
        assert_eq!(short("slipped: 23 mm in the hand"), "slipped");
        assert_eq!(short("no stop within 12 places"), "no stop within  places");
    }
}
