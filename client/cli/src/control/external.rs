//! `wheelarm X` runs `wheelarm-X` when X is not built in, as cargo does.

use std::ffi::OsString;
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};
use wheelarm_rollout::launcher::{end_with_parent, find_program, programs_named};

/// Similarity (Jaro-Winkler, 0 to 1) from which a name is suggested.
const SUGGESTED_SIMILARITY: f64 = 0.85;

/// Cargo feature of a command that this build lacks.
fn left_out(name: &str) -> Option<&'static str> {
    match name {
        "record" | "replay" | "demo" | "evaluate" | "collect" => Some("hdf5"),
        "teleop" => Some("terminal"),
        _ => None,
    }
}

/// The most similar name among `known`, if one is similar enough.
fn nearest<'a>(name: &str, known: &'a [String]) -> Option<&'a str> {
    let similarity = |known: &String| strsim::jaro_winkler(name, known);
    let likely = known
        .iter()
        .filter(|known| similarity(known) >= SUGGESTED_SIMILARITY);
    let best = likely.max_by(|a, b| similarity(a).total_cmp(&similarity(b)));
    best.map(String::as_str)
}

/// Runs an external subcommand and returns its exit code; `known` are the built-in
/// commands.
///
/// # Errors
/// When the program does not exist or cannot be started.
pub fn run_external(words: &[OsString], known: Vec<String>) -> anyhow::Result<ExitCode> {
    let Some((name, arguments)) = words.split_first() else {
        bail!("no subcommand given");
    };
    let name = name.to_string_lossy();
    let program = format!("wheelarm-{name}");
    let Some(path) = find_program(&program) else {
        if let Some(feature) = left_out(&name) {
            bail!(
                "`wheelarm {name}` is not part of this build: build wheelarm-cli with its feature `{feature}`"
            );
        }
        let mut known = known;
        known.extend(programs_named("wheelarm-"));
        if let Some(nearest) = nearest(&name, &known) {
            bail!("no command `wheelarm {name}`; did you mean `wheelarm {nearest}`?");
        }
        bail!(
            "`wheelarm {name}` is not built in, and `{program}` is neither beside this program nor on PATH; see `wheelarm --help`"
        );
    };
    let mut command = Command::new(&path);
    command.args(arguments);
    // A signal that ends this program also ends the child.
    end_with_parent(&mut command);
    let status = command
        .status()
        .with_context(|| format!("starting {}", path.display()))?;
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        eprintln!(
            "{program} was ended by signal {signal}. If it crashed, one of its input files is \
             damaged in a way that its library cannot report: pass the files one by one to \
             find it"
        );
        return Ok(ExitCode::from(
            u8::try_from(128 + signal).unwrap_or(u8::MAX),
        ));
    }
    Ok(ExitCode::from(
        status
            .code()
            .and_then(|code| u8::try_from(code).ok())
            .unwrap_or(1),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelled_command_suggests_the_nearest_name() {
        let known = ["evaluate", "episode", "record", "dataset", "drive"].map(str::to_owned);
        for (typed, meant) in [
            ("evalute", Some("evaluate")),
            ("recrod", Some("record")),
            ("datset", Some("dataset")),
            ("episodes", Some("episode")),
            ("fly", None),
        ] {
            assert_eq!(nearest(typed, &known), meant, "{typed}");
        }
    }
}
