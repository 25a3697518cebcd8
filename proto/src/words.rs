//! Names of enum values, for people and for text columns of files.

use crate::v1;

/// The name of an enum value without the enum's own name, in lower case:
/// `EVENT_KIND_REFUSED` as `refused`.
fn word(name: &str, prefix: &str) -> String {
    let rest = name.strip_prefix(prefix).unwrap_or(name);
    rest.trim_start_matches('_').to_ascii_lowercase()
}

impl v1::EventKind {
    /// For example `refused`.
    #[must_use]
    pub fn word(self) -> String {
        word(self.as_str_name(), "EVENT_KIND")
    }

    /// The kind with that name; files contain the name.
    #[must_use]
    pub fn from_word(text: &str) -> Self {
        let name = format!("EVENT_KIND_{}", text.to_ascii_uppercase());
        Self::from_str_name(&name).unwrap_or_default()
    }

    /// Whether the event needs attention: rejected commands, a collision, an anomaly.
    #[must_use]
    pub fn is_serious(self) -> bool {
        match self {
            Self::Refused | Self::Collision | Self::Anomaly | Self::PersonContact => true,
            Self::Unspecified | Self::Paused | Self::Resumed | Self::Control | Self::Note => false,
        }
    }
}

impl v1::AnomalyKind {
    /// For example `escaped`, or `fault_contact_force`; files contain the name.
    #[must_use]
    pub fn word(self) -> String {
        word(self.as_str_name(), "ANOMALY_KIND")
    }
}

/// As [`word`]; empty for an unspecified value.
fn word_or_empty(name: &str, prefix: &str, number: i32) -> String {
    match number {
        0 => String::new(),
        _ => word(name, prefix),
    }
}

impl v1::FailureReason {
    /// For example `dropped`, `none` without failure; empty when unspecified. Files
    /// contain the name.
    #[must_use]
    pub fn word(self) -> String {
        word_or_empty(self.as_str_name(), "FAILURE_REASON", self.into())
    }

    /// The reason with that name.
    #[must_use]
    pub fn from_word(text: &str) -> Self {
        let name = format!("FAILURE_REASON_{}", text.to_ascii_uppercase());
        Self::from_str_name(&name).unwrap_or_default()
    }
}

impl v1::BodyPart {
    /// For example `legs`; empty for an unspecified part. Files contain the name.
    #[must_use]
    pub fn word(self) -> String {
        word_or_empty(self.as_str_name(), "BODY_PART", self.into())
    }

    /// The part with that name.
    #[must_use]
    pub fn from_word(text: &str) -> Self {
        let name = format!("BODY_PART_{}", text.to_ascii_uppercase());
        Self::from_str_name(&name).unwrap_or_default()
    }
}

impl v1::ArmProblem {
    /// For example `unreachable`; empty when unspecified. Files contain the name.
    #[must_use]
    pub fn word(self) -> String {
        word_or_empty(self.as_str_name(), "ARM_PROBLEM", self.into())
    }
}

impl v1::Incident {
    /// For example `forced_drop`; empty without incident. Files contain the name.
    #[must_use]
    pub fn word(self) -> String {
        word_or_empty(self.as_str_name(), "INCIDENT", self.into())
    }
}

impl v1::Device {
    /// For example `keyboard`; empty when unspecified.
    #[must_use]
    pub fn word(self) -> String {
        word_or_empty(self.as_str_name(), "DEVICE", self.into())
    }
}

impl v1::InputMode {
    /// For example `hold`; empty when unspecified.
    #[must_use]
    pub fn word(self) -> String {
        word_or_empty(self.as_str_name(), "INPUT_MODE", self.into())
    }
}

impl v1::Assistance {
    /// For example `skill`; empty without.
    #[must_use]
    pub fn word(self) -> String {
        word_or_empty(self.as_str_name(), "ASSISTANCE", self.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_parsed_from_its_name() {
        for reason in [
            v1::FailureReason::Dropped,
            v1::FailureReason::HardCollision,
            v1::FailureReason::None,
            v1::FailureReason::Unspecified,
        ] {
            assert_eq!(v1::FailureReason::from_word(&reason.word()), reason);
        }
        assert_eq!(v1::FailureReason::HardCollision.word(), "hard_collision");
        assert_eq!(v1::FailureReason::Unspecified.word(), "");
        assert_eq!(v1::ArmProblem::Unreachable.word(), "unreachable");
    }

    #[test]
    fn kinds_of_events_are_parsed_from_their_names() {
        for kind in [v1::EventKind::Refused, v1::EventKind::Note] {
            assert_eq!(v1::EventKind::from_word(&kind.word()), kind);
        }
        assert_eq!(v1::EventKind::Collision.word(), "collision");
        assert_eq!(v1::InputMode::Latch.word(), "latch");
        assert_eq!(v1::Device::Unspecified.word(), "");
        assert_eq!(
            v1::EventKind::from_word("whistle"),
            v1::EventKind::Unspecified
        );
    }
}
