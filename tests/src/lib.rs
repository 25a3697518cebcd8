//! Shared pieces of the system tests: server processes that end with the test,
//! and programs of the workspace run to their end.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use anyhow::{Context, bail};

/// Root of the workspace.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(1)
        .unwrap_or(Path::new("."))
        .to_owned()
}

/// A program of the workspace, built with the same profile as this test.
///
/// # Errors
/// When it has not been built; `make test` builds it first.
pub fn program(name: &str) -> anyhow::Result<PathBuf> {
    let test = std::env::current_exe()?;
    let folder = test.ancestors().nth(2).context("a folder above the test")?;
    let path = folder.join(name);
    if path.is_file() {
        Ok(path)
    } else {
        bail!(
            "{} is missing; run `make test`, which builds the programs first",
            path.display()
        )
    }
}

/// A server process; killed when dropped.
#[derive(Debug)]
pub struct Server {
    child: Child,
    /// Endpoint to connect to.
    pub endpoint: String,
    /// Name of the server.
    pub sim: String,
}

impl Server {
    /// Starts a server on a free loopback port and waits until it serves.
    ///
    /// # Errors
    /// When it ends early; the error holds what it printed.
    pub fn start(sim: &str, args: &[&str]) -> anyhow::Result<Self> {
        let mut child = Command::new(program("wheelarm-server")?)
            .args(["--sim", sim, "--listen", "tcp/127.0.0.1:0"])
            .arg("--assets")
            .arg(root().join("assets"))
            .args(args)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let stdout = child.stdout.take().context("a pipe")?;
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                let _ = sender.send(line);
            }
        });
        let mut server = Self {
            child,
            endpoint: String::new(),
            sim: sim.to_owned(),
        };
        loop {
            match lines.recv_timeout(Duration::from_secs(60)) {
                Ok(line) => {
                    if let Some(rest) = line.strip_prefix("ready ") {
                        rest.split(' ')
                            .next()
                            .unwrap_or_default()
                            .clone_into(&mut server.endpoint);
                        server.drain_errors();
                        return Ok(server);
                    }
                }
                Err(_) => {
                    let _ = server.child.kill();
                    let mut text = String::new();
                    if let Some(mut errors) = server.child.stderr.take() {
                        let _ = errors.read_to_string(&mut text);
                    }
                    bail!("the server did not become ready: {text}");
                }
            }
        }
    }

    /// Keeps the pipe of the log from filling up.
    fn drain_errors(&mut self) {
        if let Some(errors) = self.child.stderr.take() {
            std::thread::spawn(move || {
                for line in BufReader::new(errors).lines().map_while(Result::ok) {
                    eprintln!("server: {line}");
                }
            });
        }
    }

    /// Whether the process still runs.
    pub fn alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Runs `wheelarm` with this server's endpoint and name.
    ///
    /// # Errors
    /// When the program cannot be started.
    pub fn client(&self, args: &[&str]) -> anyhow::Result<Output> {
        Ok(Command::new(program("wheelarm")?)
            .args(["--connect", &self.endpoint, "--sim", &self.sim])
            .args(args)
            .output()?)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What a program printed, for an assertion's message.
#[must_use]
pub fn printed(output: &Output) -> String {
    format!(
        "exit {:?}\n{}\n{}",
        output.status.code(),
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}
