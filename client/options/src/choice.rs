//! Parsers of option values that several commands share, with their errors.

use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use wheelarm_proto::endpoint::check_endpoint;
use wheelarm_proto::keys::check_name;
use wheelarm_proto::settings::Named;

/// Reads an endpoint.
///
/// # Errors
/// When the text is not an endpoint.
pub fn endpoint(text: &str) -> Result<String, String> {
    let checked = check_endpoint(text).map_err(|bad| bad.to_string());
    checked.map(|()| text.to_owned())
}

/// Reads the name of a commander or a recorder, which is part of a key expression.
///
/// # Errors
/// When the text cannot be part of a key expression.
pub fn name(text: &str) -> Result<String, String> {
    let checked = check_name(text).map_err(|bad| bad.to_string());
    checked.map(|()| text.to_owned())
}

/// Accepts the names that the contract defines for a choice.
pub fn named<T: Named + Send + Sync>() -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(T::ALL.iter().map(|value| value.name()))
        .try_map(|name| T::from_name(&name))
}

/// Most seeds of one run; each planned episode uses memory.
pub const MOST_SEEDS: u64 = 1_000_000;

/// Reads `FIRST..LAST`, for example `0..10`.
///
/// # Errors
/// When the format differs, or the range is empty or too long.
pub fn seed_range(text: &str) -> Result<(u64, u64), String> {
    let (first, end): (u64, u64) = text
        .split_once("..")
        .and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)))
        .filter(|(a, b)| a < b)
        .ok_or_else(|| format!("{text:?} is not FIRST..LAST, for example 0..10"))?;
    if end - first > MOST_SEEDS {
        return Err(format!(
            "{text:?} has {} seeds; the limit is {MOST_SEEDS}",
            end - first
        ));
    }
    Ok((first, end))
}

/// Longest wait for a server, s: one day.
const MOST_PATIENCE: f64 = 86_400.0;

/// Reads how long a server may be silent, at least `LEAST` seconds.
///
/// # Errors
/// When the text is not a number in that range.
pub fn patience<const LEAST: u32>(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok();
    let seconds = seconds.filter(|s| (f64::from(LEAST)..=MOST_PATIENCE).contains(s));
    seconds.map(Duration::from_secs_f64).ok_or_else(|| {
        format!("{text:?} is not a number of seconds from {LEAST} to {MOST_PATIENCE}")
    })
}

/// User and host name, with characters that key expressions allow; `fallback` when both
/// are empty.
#[must_use]
pub fn own_name(fallback: &str) -> String {
    let user = std::env::var("USER").unwrap_or_default();
    let host = rustix::system::uname();
    let host = host.nodename().to_string_lossy().into_owned();
    let host = host.split('.').next().unwrap_or_default().to_owned();
    let words = [user, host].map(|word| {
        word.chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
            .take(30)
            .collect::<String>()
    });
    let name = words
        .iter()
        .filter(|w| !w.is_empty())
        .cloned()
        .collect::<Vec<_>>()
        .join("-");
    if name.is_empty() {
        fallback.to_owned()
    } else {
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejected_names_and_endpoints_explain_their_form() {
        assert_eq!(name("anna-2"), Ok("anna-2".to_owned()));
        for bad in ["", "a/b", "*"] {
            assert!(name(bad).unwrap_err().contains("1 to 64 letters"));
        }
        assert!(endpoint("nonsense").unwrap_err().contains("tcp/HOST:PORT"));
    }

    #[test]
    fn malformed_seed_ranges_are_rejected() {
        assert_eq!(seed_range("0..10"), Ok((0, 10)));
        for bad in ["", "3", "3..3", "4..2", "a..b", "0..99999999999999"] {
            assert!(seed_range(bad).is_err(), "{bad:?} was accepted");
        }
    }

    #[test]
    fn patience_outside_its_range_is_rejected() {
        assert_eq!(patience::<5>("5"), Ok(Duration::from_secs(5)));
        assert_eq!(patience::<1>("1.5"), Ok(Duration::from_millis(1500)));
        for bad in ["0", "4.9", "-7", "NaN", "inf", "86401", "soon"] {
            assert!(patience::<5>(bad).is_err(), "{bad:?} was accepted");
        }
    }
}
