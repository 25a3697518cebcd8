//! Reads a password, typed without echo or from a pipe.

use std::io::{BufRead, IsTerminal, Read, Write};

use anyhow::{Context, bail};
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcsetattr};

/// Longest accepted line, bytes.
const MAX_LINE: u64 = 4096;

/// Terminal without echo; dropping it restores the previous mode.
struct HiddenInput(Termios);

impl HiddenInput {
    fn new() -> anyhow::Result<Self> {
        let before = tcgetattr(std::io::stdin()).context("cannot read the terminal mode")?;
        let mut hidden = before.clone();
        hidden.local_modes.remove(LocalModes::ECHO);
        tcsetattr(std::io::stdin(), OptionalActions::Now, &hidden)
            .context("cannot switch off the echo of the terminal")?;
        Ok(Self(before))
    }
}

impl Drop for HiddenInput {
    fn drop(&mut self) {
        // A closed terminal has no echo to restore.
        let _ = tcsetattr(std::io::stdin(), OptionalActions::Now, &self.0);
        eprintln!();
    }
}

fn read_line() -> anyhow::Result<String> {
    let mut text = String::new();
    std::io::stdin()
        .lock()
        .take(MAX_LINE)
        .read_line(&mut text)
        .context("cannot read the password")?;
    Ok(text.trim_end_matches(['\n', '\r']).to_owned())
}

fn read_hidden(question: &str) -> anyhow::Result<String> {
    eprint!("{question}: ");
    std::io::stderr()
        .flush()
        .context("cannot write to standard error")?;
    let _hidden = HiddenInput::new()?;
    read_line()
}

/// Reads a new password: the first line of standard input, or typed twice.
///
/// # Errors
/// When the two differ, or standard input or the terminal fails.
pub fn new_password(name: &str) -> anyhow::Result<String> {
    if !std::io::stdin().is_terminal() {
        return read_line();
    }
    let first = read_hidden(&format!("password of {name}"))?;
    if read_hidden("repeat the password")? != first {
        bail!("the two passwords differ: nothing was changed");
    }
    Ok(first)
}
