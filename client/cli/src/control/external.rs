//! `wheelarm X` runs `wheelarm-X` when X is not built in, as cargo does.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};
use wheelarm_options::choice::nearest;
use wheelarm_rollout::launcher::{end_with_parent, find_program, programs_named};

/// Words that users type in place of a command, and that command.
const MEANT: [(&str, &str); 15] = [
    ("align", "wheelarm dataset align"),
    ("convert", "wheelarm dataset export"),
    ("export", "wheelarm dataset export"),
    (
        "import",
        "wheelarm home import FILE.sh3d` or `wheelarm object import MESH",
    ),
    ("info", "wheelarm dataset info"),
    ("list", "wheelarm tasks"),
    ("play", "wheelarm replay"),
    ("quit", "wheelarm shutdown"),
    ("run", "wheelarm demo` or `wheelarm server"),
    ("serve", "wheelarm server"),
    ("start", "wheelarm server` or `wheelarm episode start"),
    ("stop", "wheelarm shutdown` or `wheelarm episode stop"),
    (
        "train",
        "wheelarm collect` for episodes, `wheelarm dataset export` for a trainer, and `wheelarm evaluate --policy",
    ),
    ("version", "wheelarm --version"),
    ("view", "wheelarm dataset view"),
];

/// Command that runs the server.
pub const SERVER: &str = "server";

/// Cargo feature of a command that this build lacks.
fn left_out(name: &str) -> Option<&'static str> {
    match name {
        "record" | "replay" | "demo" | "evaluate" | "collect" => Some("hdf5"),
        "teleop" => Some("terminal"),
        _ => None,
    }
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
        if let Some((_, meant)) = MEANT.iter().find(|(word, _)| *word == name) {
            bail!("no command `wheelarm {name}`; use `{meant}`");
        }
        if let Some(nearest) = nearest(&name, known.iter().map(String::as_str)) {
            bail!("no command `wheelarm {name}`; did you mean `wheelarm {nearest}`?");
        }
        bail!(
            "no command `wheelarm {name}`: it is not built in, and no program `{program}` is beside this one or on PATH; `wheelarm --help` lists the commands"
        );
    };
    let mut command = Command::new(&path);
    command.args(arguments);
    if name == SERVER {
        // In place of this program, so that signals reach the server.
        let error = command.exec();
        return Err(error).with_context(|| format!("starting {}", path.display()));
    }
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
