//! Examples in the help of the commands.

use clap::Command;

/// An example of each command.
const EXAMPLES: [(&str, &str); 13] = [
    (
        "info",
        "wheelarm dataset info data/demo/pick_mustard-seed0.h5",
    ),
    (
        "recover",
        "wheelarm dataset recover data/session/take-3.h5.wal",
    ),
    (
        "sheet",
        "wheelarm dataset sheet data/demo/pick_mustard-seed0.h5 --out demo.png",
    ),
    (
        "align",
        "wheelarm dataset align data/session --out data/aligned",
    ),
    (
        "label",
        "wheelarm dataset label data/session --out labels.csv",
    ),
    (
        "annotate",
        "wheelarm dataset annotate data/session --out data/labels",
    ),
    (
        "export",
        "wheelarm dataset export --format lerobot data/session --out data/lerobot
  wheelarm dataset export --format robomimic data/session --out data/rows.h5 --size 320x180",
    ),
    ("validate", "wheelarm dataset validate data/session"),
    (
        "stats",
        "wheelarm dataset stats data/session --plot stats.png --csv stats.csv",
    ),
    ("plot", "wheelarm dataset plot data/session --out plots"),
    ("view", "wheelarm dataset view data/session --out pages"),
    (
        "ledger",
        "wheelarm dataset ledger data/session --out data/session.ledger.json",
    ),
    (
        "video",
        "wheelarm dataset video data/demo/pick_mustard-seed0.h5 --out demo.mp4",
    ),
];

/// Gives every command its example.
pub(super) fn added(command: Command) -> Command {
    EXAMPLES.iter().fold(command, |command, (name, example)| {
        let text = format!("Examples:\n  {example}");
        command.mut_subcommand(name, |one| one.after_long_help(text))
    })
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;
    use crate::commands::Cli;

    #[test]
    fn every_command_has_an_example_that_it_accepts() {
        for command in Cli::command().get_subcommands() {
            let name = command.get_name();
            let found = EXAMPLES.iter().find(|(of, _)| *of == name);
            let (_, text) = found.unwrap_or_else(|| panic!("no example of {name}"));
            for line in text.lines() {
                let words = line.split_whitespace().skip(1);
                Cli::try_parse_from(words).unwrap_or_else(|error| panic!("{line}: {error}"));
            }
        }
    }
}
