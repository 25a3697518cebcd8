//! A server of a command's own: `wheelarm-server` with a scenario, waited for
//! until it serves, and known how it died.

use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, anyhow};
use wheelarm_proto::program::{EXIT_SCENARIO, Ready};
use wheelarm_proto::v1;
use wheelarm_sdk::{Client, Connect};

use super::process::{Input, Launch, Process, Program};
use super::socket::socket_folder;
use crate::limits;

/// Settings of the start of a server.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServerOptions {
    /// The scenario; without cameras no image is rendered and no graphics
    /// driver is needed.
    pub scenario: v1::Scenario,
    /// Assets folder; found by the server when absent.
    pub assets: Option<PathBuf>,
    /// Folders of world packs; those of the environment or the user when empty.
    pub packs: Vec<PathBuf>,
    /// Graphics adapter by a part of its name; the server's choice when absent.
    pub adapter: Option<String>,
    /// Working folder, which gets its messages as `server.log`; the server
    /// listens on a private socket then, else on a free port of the loopback
    /// interface.
    pub folder: Option<PathBuf>,
}

/// One setting for all of the robot's cameras: images of `width` and `height`
/// pixels, `rate_hz` per simulated second.
#[must_use]
pub fn all_cameras(width: u32, height: u32, rate_hz: f64) -> v1::CameraSetting {
    v1::CameraSetting {
        name: "*".to_owned(),
        width,
        height,
        rate_hz: Some(rate_hz),
        ..v1::CameraSetting::default()
    }
}

/// Why the server did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The caller no longer waits for the server.
    #[error("the start was called off")]
    CalledOff,
    /// The scenario cannot be simulated; its words.
    #[error("{0}")]
    Scenario(String),
    /// Anything else; it may be the host's fault.
    #[error("{0:#}")]
    Broke(anyhow::Error),
}

/// A server; killed when dropped.
#[derive(Debug)]
pub struct Server {
    /// The process.
    pub process: Process,
    connect: Connect,
    _socket: Option<tempfile::TempDir>,
}

impl Server {
    /// Starts `wheelarm-server` and waits until it serves.
    ///
    /// # Errors
    /// [`StartError`], with the server's own words when it ends instead.
    pub fn start(options: &ServerOptions) -> Result<Self, StartError> {
        Self::start_unless(options, || false)
    }

    /// As [`Server::start`], unless it is `called_off` meanwhile.
    ///
    /// # Errors
    /// As [`Server::start`].
    pub fn start_unless(
        options: &ServerOptions,
        called_off: impl Fn() -> bool,
    ) -> Result<Self, StartError> {
        let mut server = Self::launch(options).map_err(StartError::Broke)?;
        server.wait_until_ready(called_off)?;
        Ok(server)
    }

    fn launch(options: &ServerOptions) -> anyhow::Result<Self> {
        let socket = options.folder.as_deref().map(socket_folder).transpose()?;
        let listen = match &socket {
            Some(socket) => format!("unixsock-stream/{}/server", socket.path().display()),
            None => "tcp/127.0.0.1:0".to_owned(),
        };
        // Several may run on one host, so the name is the process's own.
        let sim = format!("local-{}", std::process::id());
        let scenario =
            toml::to_string(&options.scenario).context("writing the scenario as TOML")?;
        let process = Process::start(Launch {
            name: "server",
            program: Program::Own("wheelarm-server"),
            environment: Vec::new(),
            arguments: arguments(options, &sim, &listen),
            input: Input::Text(scenario),
            folder: options.folder.clone(),
        })?;
        Ok(Self {
            process,
            connect: Connect {
                endpoint: listen,
                sim,
                timeout_secs: limits::CONNECT.as_secs_f64(),
                identity: None,
            },
            _socket: socket,
        })
    }

    /// Waits for its line `ready ENDPOINT sim=NAME`.
    fn wait_until_ready(&mut self, called_off: impl Fn() -> bool) -> Result<(), StartError> {
        let deadline = Instant::now() + limits::READY;
        loop {
            // Before its messages are read, which include the last ones.
            let ended = self.process.ended().map_err(StartError::Broke)?;
            let messages = self.process.messages();
            if let Some(ready) = messages.lines().find_map(Ready::parse) {
                self.connect.endpoint = ready.endpoint;
                return Ok(());
            }
            if let Some(status) = ended {
                let how = format!("the server ended while starting ({status}):");
                return Err(match status.code() == Some(i32::from(EXIT_SCENARIO)) {
                    true => StartError::Scenario(format!("{how} {}", self.process.last_words())),
                    false => StartError::Broke(anyhow!("{how}\n{}", self.process.tail())),
                });
            }
            if Instant::now() > deadline {
                return Err(StartError::Broke(anyhow!(
                    "the server was not ready within {:.0} s:\n{}",
                    limits::READY.as_secs_f64(),
                    self.process.tail()
                )));
            }
            if called_off() {
                return Err(StartError::CalledOff);
            }
            std::thread::sleep(limits::LOOK);
        }
    }

    /// Connection settings.
    #[must_use]
    pub fn connect(&self) -> &Connect {
        &self.connect
    }

    /// Opens a connection to it.
    ///
    /// # Errors
    /// With the server's last messages.
    pub fn client(&self) -> anyhow::Result<Client> {
        Client::open(&self.connect)
            .with_context(|| format!("output of the server:\n{}", self.process.tail()))
    }

    /// Asks it to end; after [`limits::END`] it is terminated, then killed.
    ///
    /// # Errors
    /// When the server does not reply.
    pub fn stop(mut self, client: Client) -> anyhow::Result<()> {
        client.shutdown(true)?;
        // A client that leaves first leaves no half-open connection.
        client.close()?;
        if self.process.ended_within(limits::END)?.is_none() {
            self.process.end()?;
        }
        Ok(())
    }
}

/// What a scenario does not say. The order is that of the tests, which find a
/// server by its command line.
fn arguments(options: &ServerOptions, sim: &str, listen: &str) -> Vec<OsString> {
    let mut arguments: Vec<OsString> = ["--sim", sim, "--listen", listen, "--scenario", "-"]
        .map(OsString::from)
        .to_vec();
    // Absent, they would be those of the server's default scenario.
    if options.scenario.cameras.is_empty() {
        arguments.push("--no-cameras".into());
    }
    if let Some(assets) = &options.assets {
        arguments.extend(["--assets".into(), assets.into()]);
    }
    for folder in &options.packs {
        arguments.extend(["--packs".into(), folder.into()]);
    }
    if let Some(adapter) = &options.adapter {
        arguments.extend(["--adapter".into(), adapter.into()]);
    }
    arguments
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenario_without_cameras_renders_nothing_and_keeps_large_seeds() {
        let mut options = ServerOptions {
            scenario: v1::Scenario {
                task: Some("pick_bowl".into()),
                seed: Some(u64::MAX),
                ..v1::Scenario::default()
            },
            ..ServerOptions::default()
        };
        let flag = OsString::from("--no-cameras");
        let listen = "tcp/127.0.0.1:0";
        assert!(arguments(&options, "local-7", listen).contains(&flag));
        let text = toml::to_string(&options.scenario).unwrap();
        assert!(text.contains("seed = 18446744073709551615"), "{text}");
        let read: v1::Scenario = toml::from_str(&text).unwrap();
        assert_eq!(read, options.scenario);
        let camera = v1::CameraSetting::from_text("*=64x48@7.5").unwrap();
        options.scenario.cameras = vec![camera];
        assert!(!arguments(&options, "local-7", listen).contains(&flag));
        let text = toml::to_string(&options.scenario).unwrap();
        assert_eq!(toml::from_str(&text).ok(), Some(options.scenario));
    }
}
