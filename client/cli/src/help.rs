//! Form of the help: groups of commands, connection options listed once, a short `-h`, and an
//! example for every command.

use std::fmt::Write;

use clap::{Arg, Command};

use crate::control::SERVER;

/// Groups of commands in the order in which `wheelarm --help` lists them.
pub const GROUPS: [(&str, &[&str]); 8] = [
    (
        "Run a simulation",
        &[
            "server", "demo", "doctor", "status", "tasks", "map", "reset", "pause", "resume",
            "shutdown",
        ],
    ),
    (
        "Drive",
        &["teleop", "drive", "operate", "lease", "preview", "watch"],
    ),
    ("Record", &["record", "episode", "replay"]),
    ("Data", &["dataset"]),
    (
        "Make homes, objects and episodes",
        &["collect", "multiply", "home", "object", "pack", "new"],
    ),
    ("Evaluate", &["evaluate"]),
    ("Access", &["keys", "users", "router"]),
    ("This installation", &["cache", "completions", "man"]),
];

/// Global options that select a server.
const CONNECTION: [&str; 5] = ["connect", "sim", "connect_timeout", "keys", "user"];

/// Commands whose folder of keys is an option of their own, not part of a connection.
const WITH_KEYS: [&str; 3] = ["keys", "users", "router"];

/// Commands that connect to a running server.
const CONNECTED: [&str; 15] = [
    "status", "tasks", "map", "reset", "pause", "resume", "shutdown", "teleop", "drive", "operate",
    "lease", "preview", "watch", "record", "episode",
];

/// Line under the help of a command that connects.
const CONNECTION_NOTE: &str =
    "Connection: --connect, --sim, --connect-timeout, --keys, --user (see `wheelarm --help`)";

/// First line of the command `server`, which runs the program of that name.
const SERVER_ABOUT: &str = "Starts a server: the program wheelarm-server, with its options";

/// Width of the list of commands, columns: that of a terminal without settings.
const WIDTH: usize = 80;
/// Width of the column of commands.
const COLUMN: usize = 12;

/// Gives the command line of `wheelarm` its help.
#[must_use]
pub fn shaped(command: Command) -> Command {
    let names: Vec<String> = command
        .get_subcommands()
        .map(|one| one.get_name().to_owned())
        .collect();
    let options: Vec<Arg> = CONNECTION
        .iter()
        .filter_map(|id| command.get_arguments().find(|arg| arg.get_id() == *id))
        .cloned()
        .collect();
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{}Options of every command:\n\
         {{options}}{{after-help}}",
        groups_text(&command)
    );
    let mut command = command.help_template(template).mut_args(shortened);
    for name in names {
        command = command.mut_subcommand(&name, |one| {
            let one = without_connection(one, &name, &options);
            let one = match CONNECTED.contains(&name.as_str()) {
                true => with_connection_note(one),
                false => one,
            };
            with_examples(one.mut_args(shortened))
        });
    }
    command
}

/// The commands of each group with their first lines.
fn groups_text(command: &Command) -> String {
    let about = |name: &str| {
        if name == SERVER {
            return Some(SERVER_ABOUT.to_owned());
        }
        let found = command.find_subcommand(name)?;
        found.get_about().map(ToString::to_string)
    };
    let mut text = String::new();
    for (title, names) in GROUPS {
        let lines: Vec<String> = names
            .iter()
            .copied()
            .filter_map(|name| Some(entry(name, &about(name)?)))
            .collect();
        if !lines.is_empty() {
            let _ = write!(text, "{title}:\n{}\n", lines.concat());
        }
    }
    text
}

/// The entry of a command, its first line wrapped beside its name.
fn entry(name: &str, about: &str) -> String {
    let indent = COLUMN + 4;
    let mut text = format!("  {name:<COLUMN$}  ");
    let mut column = indent;
    for (index, word) in about.split_whitespace().enumerate() {
        let width = word.chars().count();
        if index > 0 && column + 1 + width > WIDTH {
            let _ = write!(text, "\n{:indent$}", "");
            column = indent;
        } else if index > 0 {
            text.push(' ');
            column += 1;
        }
        text.push_str(word);
        column += width;
    }
    text.push('\n');
    text
}

/// Hides the connection options in the help of a command: `wheelarm --help` lists them.
fn without_connection(command: Command, name: &str, options: &[Arg]) -> Command {
    let own: Vec<String> = command
        .get_arguments()
        .map(|arg| arg.get_id().to_string())
        .collect();
    let keeps = |id: &str| WITH_KEYS.contains(&name) && id == "keys";
    // A command that has an argument of the same name does not get the global one.
    let hidden = options
        .iter()
        .filter(|arg| !own.iter().any(|id| arg.get_id() == id))
        .filter(|arg| !keeps(arg.get_id().as_str()));
    let hidden: Vec<Arg> = hidden.map(|arg| arg.clone().hide(true)).collect();
    command.args(hidden)
}

fn with_connection_note(command: Command) -> Command {
    let long = command.get_after_long_help().map(ToString::to_string);
    let long = match long {
        Some(long) => format!("{CONNECTION_NOTE}\n\n{long}"),
        None => CONNECTION_NOTE.to_owned(),
    };
    command
        .after_help(CONNECTION_NOTE)
        .after_long_help(long)
        .mut_subcommands(|child| child.after_help(CONNECTION_NOTE))
}

/// Gives each command below `command` the examples of its parent that call it.
fn with_examples(command: Command) -> Command {
    let of_parent = command.get_after_long_help().map(ToString::to_string);
    let parent = command.get_name().to_owned();
    command.mut_subcommands(|child| {
        let child = child.mut_args(shortened);
        if child.get_after_long_help().is_some() {
            return child;
        }
        let call = format!("{parent} {}", child.get_name());
        let lines = of_parent.as_deref().unwrap_or_default().lines();
        let lines: Vec<&str> = lines.filter(|line| calls(line, &call)).collect();
        match lines.is_empty() {
            true => child,
            false => child.after_long_help(format!("Examples:\n{}", lines.join("\n"))),
        }
    })
}

/// Whether a line is an example that calls a command.
fn calls(line: &str, call: &str) -> bool {
    let is_example = line.trim_start().starts_with("wheelarm");
    is_example && format!("{line} ").contains(&format!(" {call} "))
}

/// Gives an argument the first sentence of its help for `-h`, and all of it for `--help`.
fn shortened(arg: Arg) -> Arg {
    let Some(help) = arg.get_help().map(ToString::to_string) else {
        return arg;
    };
    let long = arg
        .get_long_help()
        .map_or(help.clone(), ToString::to_string);
    match help.split_once(". ") {
        Some((first, _)) => arg.help(first.to_owned()).long_help(long),
        None => arg,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_first_lines_are_wrapped_beside_the_name() {
        let about = "word ".repeat(30);
        let text = entry("demo", &about);
        assert!(text.starts_with("  demo          word word"), "{text}");
        assert!(text.lines().count() > 1);
        for line in text.lines().skip(1) {
            assert!(line.starts_with("                word"), "{text}");
        }
        assert!(text.lines().all(|line| line.len() <= WIDTH), "{text}");
    }
}
