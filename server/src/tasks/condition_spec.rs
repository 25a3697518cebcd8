//! A condition of a task, as its template states it.

use super::predicates::AnyPredicate;

/// A condition of the task.
#[derive(Clone, Debug, PartialEq)]
pub struct ConditionSpec {
    /// What must hold.
    pub(super) predicate: AnyPredicate,
    /// Required for success, or only reported.
    pub required: bool,
    /// Only with a person in the chair.
    pub with_person: bool,
}

impl ConditionSpec {
    /// The predicate with its subjects, for example `inside(knife, placemat)`.
    #[must_use]
    pub fn label(&self) -> String {
        self.predicate.label()
    }
}
