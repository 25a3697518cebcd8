//! Conversion of language settings between message and scenario.

use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::settings::LanguageSplit;
use wheelarm_proto::v1;

use crate::tasks::{Language, POLITENESS};

/// Converts the language settings of a scenario.
pub(super) fn to_proto(value: &Language) -> v1::Language {
    v1::Language {
        seed: value.seed,
        split: value.split.code().into(),
        typo_share: value.typo_share,
        politeness_share: Some(value.politeness_share),
        ambiguous_share: value.ambiguous_share,
        template: value.template.clone(),
        ambiguous: !value.question.is_empty(),
        question: value.question.clone(),
    }
}

/// Converts requested language settings. The stored question and template are kept with
/// a given sentence, and sampled again otherwise.
///
/// # Errors
/// [`Invalid`] that names the field.
pub(super) fn from_proto(message: &v1::Language) -> Result<Language, Invalid> {
    let share = |what, value| check::within(what, value, 0.0, 1.0);
    check::instruction(&message.template)?;
    check::instruction(&message.question)?;
    Ok(Language {
        seed: message.seed,
        split: LanguageSplit::from_proto(message.split()).unwrap_or_default(),
        typo_share: share("language.typo_share", message.typo_share)?,
        politeness_share: share(
            "language.politeness_share",
            message.politeness_share.unwrap_or(POLITENESS),
        )?,
        ambiguous_share: share("language.ambiguous_share", message.ambiguous_share)?,
        template: message.template.clone(),
        question: message.question.clone(),
    })
}
