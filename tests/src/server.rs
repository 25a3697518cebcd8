//! A server process of a test.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use anyhow::{Context, bail};
use wheelarm_sdk::{Client, Connect};

use crate::{program, root};

/// A server process; killed when dropped.
#[derive(Debug)]
pub struct Server {
    child: Child,
    /// Endpoint to connect to.
    pub endpoint: String,
    /// Name of the server.
    pub sim: String,
    /// Keys of the connecting user, for a server with keys.
    pub identity: Option<wheelarm_proto::bundle::Identity>,
}

impl Server {
    /// Starts a server on a free loopback port and waits until it serves.
    ///
    /// # Errors
    /// When it ends early; the error holds what it printed.
    pub fn start(sim: &str, args: &[&str]) -> anyhow::Result<Self> {
        Self::start_at("tcp/127.0.0.1:0", sim, args)
    }

    /// As [`Server::start`] on a given endpoint.
    ///
    /// # Errors
    /// As [`Server::start`].
    pub fn start_at(listen: &str, sim: &str, args: &[&str]) -> anyhow::Result<Self> {
        Self::start_with(&root().join("assets"), listen, sim, args)
    }

    /// As [`Server::start_at`] with another folder of assets.
    ///
    /// # Errors
    /// As [`Server::start`].
    pub fn start_with(
        assets: &Path,
        listen: &str,
        sim: &str,
        args: &[&str],
    ) -> anyhow::Result<Self> {
        let mut child = Command::new(program("wheelarm-server")?)
            .args(["--sim", sim, "--listen", listen])
            .arg("--assets")
            .arg(assets)
            .args(args)
            // With `--end-with-stdin` it ends with this process.
            .stdin(Stdio::piped())
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
            identity: None,
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

    /// Kills the process (SIGKILL).
    ///
    /// # Errors
    /// When it cannot be killed.
    pub fn kill(&mut self) -> anyhow::Result<()> {
        self.child.kill()?;
        self.child.wait()?;
        Ok(())
    }

    /// Process id.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Connection settings for it.
    #[must_use]
    pub fn connect(&self) -> Connect {
        self.connect_through(&self.endpoint)
    }

    /// Connection settings through another endpoint.
    #[must_use]
    pub fn connect_through(&self, endpoint: &str) -> Connect {
        Connect {
            endpoint: endpoint.to_owned(),
            sim: self.sim.clone(),
            timeout_secs: 20.0,
            identity: self.identity.clone(),
        }
    }

    /// Opens a client connection to it.
    ///
    /// # Panics
    /// When it does not reply.
    #[must_use]
    pub fn client(&self) -> Client {
        Client::open(&self.connect()).expect("a connection to the server")
    }

    /// Whether the process still runs.
    pub fn alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Runs `wheelarm` with this server's endpoint and name.
    ///
    /// # Errors
    /// When the program cannot be started.
    pub fn run_client(&self, args: &[&str]) -> anyhow::Result<Output> {
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
