//! How a task is said, between message and scenario.

use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::settings::LanguageSplit;
use wheelarm_proto::v1;

use crate::tasks::{Language, POLITENESS};

/// How the task is said.
pub(super) fn told(of: &Language) -> v1::Language {
    v1::Language {
        seed: of.seed,
        split: of.split.code().into(),
        typo_share: of.typo_share,
        politeness_share: Some(of.politeness_share),
        ambiguous_share: of.ambiguous_share,
        template: of.template.clone(),
        ambiguous: !of.question.is_empty(),
        question: of.question.clone(),
    }
}

/// How a task is to be said. What was said before stays with a sentence that is
/// told, and is drawn anew otherwise.
///
/// # Errors
/// [`Invalid`] that names the field.
pub(super) fn asked(of: &v1::Language) -> Result<Language, Invalid> {
    let share = |what, value| check::within(what, value, 0.0, 1.0);
    check::instruction(&of.template)?;
    check::instruction(&of.question)?;
    Ok(Language {
        seed: of.seed,
        split: LanguageSplit::told(of.split()).unwrap_or_default(),
        typo_share: share("language.typo_share", of.typo_share)?,
        politeness_share: share(
            "language.politeness_share",
            of.politeness_share.unwrap_or(POLITENESS),
        )?,
        ambiguous_share: share("language.ambiguous_share", of.ambiguous_share)?,
        template: of.template.clone(),
        question: of.question.clone(),
    })
}
