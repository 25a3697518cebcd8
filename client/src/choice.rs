//! Choices of the contract as words of the command line.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use wheelarm_proto::settings::Named;

/// Takes the names that the contract has for a choice.
pub fn named<T: Named + Send + Sync>() -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(T::ALL.iter().map(|value| value.name()))
        .try_map(|name| T::from_name(&name))
}
