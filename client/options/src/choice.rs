//! Parsers of option values that several commands share, with their errors.

use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use wheelarm_proto::endpoint::check_endpoint;
use wheelarm_proto::keys::check_name;
use wheelarm_proto::settings::Named;
use wheelarm_proto::v1::CameraSetting;

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

/// Similarity (Jaro-Winkler, 0 to 1) from which a name is suggested.
const SUGGESTED_SIMILARITY: f64 = 0.85;

/// The most similar name among `known`, if one is similar enough.
#[must_use]
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let similar = known.into_iter().map(|known| {
        let similarity = strsim::jaro_winkler(name, known);
        (similarity, known)
    });
    let likely = similar.filter(|(similarity, _)| *similarity >= SUGGESTED_SIMILARITY);
    let best = likely.max_by(|(a, _), (b, _)| a.total_cmp(b));
    best.map(|(_, known)| known)
}

/// For an error about an unknown name: `; did you mean NAME?`, or nothing when no known name
/// is similar.
#[must_use]
pub fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let nearest = nearest(name, known);
    nearest.map_or_else(String::new, |nearest| format!("; did you mean {nearest}?"))
}

/// Makes a folder for results, and checks that files can be written into it.
///
/// # Errors
/// With another folder as the fix.
pub fn make_folder(folder: &Path) -> anyhow::Result<()> {
    let probe = folder.join(format!(".wheelarm-{}", std::process::id()));
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&probe, ""))
        .and_then(|()| std::fs::remove_file(&probe))
        .with_context(|| {
            format!(
                "cannot write into the folder {}; name another with --out DIR",
                folder.display()
            )
        })
}

/// Reads a camera as `NAME=WIDTHxHEIGHT@HZ`; without a name, every camera of the robot.
///
/// # Errors
/// When the text has another form.
pub fn camera(text: &str) -> Result<CameraSetting, String> {
    match text.contains('=') {
        true => CameraSetting::from_text(text),
        false => CameraSetting::from_text(&format!("*={text}")),
    }
}

/// Most seeds of one run; each planned episode uses memory.
pub const MOST_SEEDS: u64 = 1_000_000;

/// Reads `FIRST..LAST`, for example `0..10`.
///
/// # Errors
/// When the format differs, or the range is empty or too long.
pub fn seed_range(text: &str) -> Result<(u64, u64), String> {
    let form = |fix: String| format!("{text:?} is not FIRST..LAST without the last, {fix}");
    let Some((first, end)) = text.split_once("..") else {
        return Err(form(match text.parse::<u64>() {
            Ok(count @ 1..) => format!("for example write 0..{count}"),
            _ => "for example 0..10".to_owned(),
        }));
    };
    let both = first.parse::<u64>().ok().zip(end.parse::<u64>().ok());
    let Some((first, end)) = both else {
        return Err(form("for example 0..10".to_owned()));
    };
    if first >= end {
        let (low, high) = (end, first.max(end.saturating_add(1)));
        return Err(form(format!("so it has no seed: write {low}..{high}")));
    }
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
    fn near_miss_suggests_the_most_similar_name() {
        let known = ["evaluate", "episode", "record", "dataset", "drive"];
        for (typed, meant) in [
            ("evalute", Some("evaluate")),
            ("recrod", Some("record")),
            ("datset", Some("dataset")),
            ("episodes", Some("episode")),
            ("fly", None),
        ] {
            assert_eq!(nearest(typed, known), meant, "{typed}");
        }
        assert_eq!(did_you_mean("drvie", known), "; did you mean drive?");
        assert_eq!(did_you_mean("fly", known), "");
    }

    #[test]
    fn a_camera_without_a_name_is_every_camera() {
        assert_eq!(camera("640x360@10"), camera("*=640x360@10"));
        assert_eq!(camera("gen3=640x360@10").unwrap().name, "gen3");
        assert!(camera("640").is_err());
    }

    #[test]
    fn malformed_seed_ranges_are_rejected() {
        assert_eq!(seed_range("0..10"), Ok((0, 10)));
        for bad in ["", "3", "3..3", "4..2", "a..b", "0..99999999999999"] {
            assert!(seed_range(bad).is_err(), "{bad:?} was accepted");
        }
        for (bad, fix) in [
            ("5", "write 0..5"),
            ("5..2", "write 2..5"),
            ("3..3", "write 3..4"),
        ] {
            let error = seed_range(bad).unwrap_err();
            assert!(error.contains(fix), "{error}");
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
