//! A recorder process of a test.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};

use crate::{Server, program, wait_until};

/// A recorder process; killed when dropped.
#[derive(Debug)]
pub struct Recorder {
    child: Child,
}

impl Recorder {
    /// Starts the recorder `name` that writes into `out`.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start(server: &Server, name: &str, out: &Path, more: &[&str]) -> Self {
        Self::start_under(&[], server, name, out, more)
    }

    /// As [`Recorder::start`], through another endpoint of the server.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start_through(endpoint: &str, server: &Server, out: &Path, more: &[&str]) -> Self {
        Self::spawn(&[], endpoint, &server.sim, "through", out, more)
    }

    /// As [`Recorder::start`], run by another program, for example `strace`.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start_under(
        wrapper: &[&str],
        server: &Server,
        name: &str,
        out: &Path,
        more: &[&str],
    ) -> Self {
        Self::spawn(wrapper, &server.endpoint, &server.sim, name, out, more)
    }

    fn spawn(
        wrapper: &[&str],
        endpoint: &str,
        sim: &str,
        name: &str,
        out: &Path,
        more: &[&str],
    ) -> Self {
        let client = program("wheelarm").expect("the client");
        let mut command = match wrapper.split_first() {
            Some((first, rest)) => {
                let mut command = Command::new(first);
                command.args(rest).arg(client);
                command
            }
            None => Command::new(client),
        };
        let child = command
            .args(["--connect", endpoint, "--sim", sim])
            .args(["record", "--name", name, "--out"])
            .arg(out)
            .args(more)
            .stdout(Stdio::piped())
            .spawn()
            .expect("a recorder");
        Self { child }
    }

    /// Kills it (SIGKILL) and waits for its end.
    ///
    /// # Panics
    /// When it cannot be killed.
    pub fn kill(&mut self) {
        self.child.kill().expect("kill -9");
        self.child.wait().expect("its end");
    }

    /// Sends a signal by its name, for example `STOP`.
    ///
    /// # Panics
    /// When it cannot be sent.
    pub fn signal(&self, name: &str) {
        let pid = self.child.id().to_string();
        let sent = Command::new("kill").args(["-s", name, &pid]).status();
        assert!(sent.expect("kill").success(), "SIG{name} to {pid}");
    }

    /// Whether it still runs.
    pub fn alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Waits until it ends by itself; what it printed and its exit status.
    ///
    /// # Panics
    /// When it does not end.
    pub fn end(&mut self) -> (ExitStatus, String) {
        wait_until("the recorder ends", || !self.alive());
        let pipe = self.child.stdout.take().expect("a pipe");
        let lines: Vec<_> = BufReader::new(pipe).lines().map_while(Result::ok).collect();
        let status = self.child.wait().expect("an exit status");
        (status, lines.join("\n"))
    }

    /// Waits for its end, which must be a success; what it printed.
    ///
    /// # Panics
    /// When it fails.
    pub fn finish(mut self) -> String {
        let (status, text) = self.end();
        assert!(status.success(), "{status}: {text}");
        text
    }

    /// The logs of unfinished episodes in a folder.
    ///
    /// # Panics
    /// When the folder cannot be read.
    #[must_use]
    pub fn logs(folder: &Path) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).expect("the folder").flatten();
        let mut logs: Vec<_> = entries
            .map(|entry| entry.path())
            .filter(|p| p.extension().is_some_and(|e| e == "wal"))
            .collect();
        logs.sort();
        logs
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
