//! A password, typed unseen or piped in.

use std::io::{BufRead, IsTerminal, Read, Write};

use anyhow::{Context, bail};
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcsetattr};

/// Longest line that is read, bytes.
const LONGEST: u64 = 4096;

/// Shows what is typed again when it is dropped.
struct Unseen(Termios);

impl Unseen {
    fn new() -> anyhow::Result<Self> {
        let before = tcgetattr(std::io::stdin()).context("asking the terminal")?;
        let mut unseen = before.clone();
        unseen.local_modes.remove(LocalModes::ECHO);
        tcsetattr(std::io::stdin(), OptionalActions::Now, &unseen)
            .context("telling the terminal to hide what is typed")?;
        Ok(Self(before))
    }
}

impl Drop for Unseen {
    fn drop(&mut self) {
        // A terminal that is gone shows nothing anyway.
        let _ = tcsetattr(std::io::stdin(), OptionalActions::Now, &self.0);
        eprintln!();
    }
}

fn line() -> anyhow::Result<String> {
    let mut text = String::new();
    std::io::stdin()
        .lock()
        .take(LONGEST)
        .read_line(&mut text)
        .context("reading the password")?;
    Ok(text.trim_end_matches(['\n', '\r']).to_owned())
}

fn typed(question: &str) -> anyhow::Result<String> {
    eprint!("{question}: ");
    std::io::stderr().flush().context("asking")?;
    let _unseen = Unseen::new()?;
    line()
}

/// A new password: the first line of standard input, or typed twice.
///
/// # Errors
/// When both differ, or nothing can be read.
pub fn new_password(name: &str) -> anyhow::Result<String> {
    if !std::io::stdin().is_terminal() {
        return line();
    }
    let first = typed(&format!("password of {name}"))?;
    if typed("once more")? != first {
        bail!("the two passwords differ: nothing was changed");
    }
    Ok(first)
}
