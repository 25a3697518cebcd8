//! All predicates of task files, one module per family.
//!
//! To add one, write a struct with its `Predicate` in its family, and a variant with a
//! match arm here: an omission does not compile.

mod lift;
mod mouth;
mod open;
mod others;
mod put;
mod robot;

use serde::Deserialize;

use self::lift::{LiftedAndHeld, LiftedBefore};
use self::mouth::{AtMouth, GentleOnFace, KeptLevel};
use self::open::Opening;
use self::others::{CorrectInstance, NothingKnockedOver};
use self::put::{AtRest, InLap, Inside, Released, Upright};
use self::robot::{ChairStopped, ClearOfPerson, NoHardCollision};
use super::condition::{Name, Predicate};
use super::goal::JointBounds;

/// A predicate of a task file: its name and its thresholds.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum AnyPredicate {
    LiftedAndHeld(LiftedAndHeld),
    LiftedBefore(LiftedBefore),
    Inside(Inside),
    InLap(InLap),
    Upright(Upright),
    AtRest(AtRest),
    Released(Released),
    OpenedBy(#[serde(deserialize_with = "open::opened_by")] Opening),
    ClosedTo(#[serde(deserialize_with = "open::closed_to")] Opening),
    CorrectInstance(CorrectInstance),
    ChairStopped(ChairStopped),
    NothingKnockedOver(NothingKnockedOver),
    NoHardCollision(NoHardCollision),
    ClearOfPerson(ClearOfPerson),
    AtMouth(AtMouth),
    GentleOnFace(GentleOnFace),
    KeptLevel(KeptLevel),
}

impl AnyPredicate {
    /// The implementation.
    pub(super) fn as_dyn(&self) -> &dyn Predicate {
        match self {
            Self::LiftedAndHeld(p) => p,
            Self::LiftedBefore(p) => p,
            Self::Inside(p) => p,
            Self::InLap(p) => p,
            Self::Upright(p) => p,
            Self::AtRest(p) => p,
            Self::Released(p) => p,
            Self::OpenedBy(p) | Self::ClosedTo(p) => p,
            Self::CorrectInstance(p) => p,
            Self::ChairStopped(p) => p,
            Self::NothingKnockedOver(p) => p,
            Self::NoHardCollision(p) => p,
            Self::ClearOfPerson(p) => p,
            Self::AtMouth(p) => p,
            Self::GentleOnFace(p) => p,
            Self::KeptLevel(p) => p,
        }
    }

    /// Where the joint of furniture must be; `None` of a predicate about something else.
    pub(super) fn joint_bounds(&self) -> Option<JointBounds> {
        match self {
            Self::OpenedBy(opening) | Self::ClosedTo(opening) => Some(opening.bounds()),
            _ => None,
        }
    }

    /// Name with subjects, as it is reported: `inside(knife, placemat)`.
    pub(super) fn label(&self) -> String {
        let predicate = self.as_dyn();
        let word = predicate.word();
        let names: Vec<_> = predicate.names().into_iter().map(Name::text).collect();
        if names.is_empty() {
            return word.to_owned();
        }
        format!("{word}({})", names.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each predicate as written in a task file, in the order of the variants.
    const WRITTEN: [&str; 17] = [
        r#"lifted_and_held = { object = "a", height = 0.1, pad_force = 0.5, secs = 1.0 }"#,
        r#"lifted_before = { object = "a", height = 0.1, pad_force = 0.5 }"#,
        r#"inside = { object = "a", on = "b", above = 0.1 }"#,
        r#"in_lap = { object = "a", above = 0.1 }"#,
        r#"upright = { object = "a", tilt_deg = 30 }"#,
        r#"at_rest = { object = "a", speed = 0.1, turn_rate_deg_s = 3.0, secs = 0.5 }"#,
        r#"released = { object = "a", secs = 0.5 }"#,
        r#"opened_by = { joint = "a", travel = 0.2, angle_deg = 45 }"#,
        r#"closed_to = { joint = "a", position = 0.02, angle_deg = 3 }"#,
        "correct_instance = { height = 0.1 }",
        "chair_stopped = { speed = 0.1, turn_rate_deg_s = 1.0 }",
        "nothing_knocked_over = { tilt_deg = 30, drop = 0.1 }",
        "no_hard_collision = { force = 50.0 }",
        "clear_of_person = { force = 5.0, face = 2.0, resting = 3.0 }",
        r#"at_mouth = { object = "a", distance = 0.03, tilt_deg = 15, force = 2.0, secs = 2.5 }"#,
        "gentle_on_face = { force = 2.0 }",
        r#"kept_level = { object = "a", tilt_deg = 30 }"#,
    ];

    /// The names that serde accepts, from its error for another one.
    fn known_names() -> Vec<String> {
        let error = toml::from_str::<AnyPredicate>("no_such_predicate = {}").unwrap_err();
        let text = error.message().to_owned();
        let names = text.split('`').skip(3).step_by(2);
        names.map(str::to_owned).collect()
    }

    #[test]
    fn every_predicate_has_an_example_in_this_test() {
        let names: Vec<&str> = WRITTEN
            .iter()
            .map(|written| written.split(' ').next().unwrap())
            .collect();
        assert_eq!(names, known_names(), "the list WRITTEN of this file");
    }

    #[test]
    fn names_and_threshold_keys_match_the_task_file() {
        for written in WRITTEN {
            let predicate: AnyPredicate = toml::from_str(written).unwrap();
            let label = predicate.label();
            let word = written.split(' ').next().unwrap();
            assert_eq!(predicate.as_dyn().word(), word);
            assert!(label.starts_with(word));
            for threshold in predicate.as_dyn().thresholds() {
                let number = written.split(&format!("{} = ", threshold.key)).nth(1);
                let number = number.unwrap_or_else(|| panic!("{} in {written}", threshold.key));
                let number = number.split([',', ' ']).next().unwrap();
                assert_eq!(number.parse(), Ok(threshold.value), "{written}");
                assert!(threshold.value <= threshold.most);
            }
            let named = written.matches('"').count() / 2;
            assert_eq!(predicate.as_dyn().names().len(), named, "{label}");
        }
        let inside: AnyPredicate = toml::from_str(WRITTEN[2]).unwrap();
        assert_eq!(inside.label(), "inside(a, b)");
    }
}
