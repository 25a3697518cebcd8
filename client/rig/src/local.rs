//! Programs that a command starts beside itself: a server on a free loopback
//! port, a recorder, the dataset tools. They end with the command.

use std::collections::VecDeque;
use std::ffi::{OsStr, OsString};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use wheelarm_proto::program::Ready;
use wheelarm_proto::settings::{Named, Pacing, Quality};
use wheelarm_proto::v1;

use crate::find_program;
use wheelarm_link::{Connect, Link};

/// Lines of a program's messages that are kept for an error.
const KEPT_LINES: usize = 30;

/// What to simulate, in words that `wheelarm-server` takes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ServerOptions {
    /// Scene below assets/scenes.
    pub scene: String,
    /// Task below assets/tasks; empty for none.
    pub task: String,
    /// Robot below assets/robots.
    pub robot: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// How time passes.
    pub pacing: Pacing,
    /// Cameras as `NAME=WIDTHxHEIGHT@HZ`; none: physics only.
    pub cameras: Vec<String>,
    /// Work per picture.
    pub quality: Quality,
    /// Assets folder; the server looks for it when absent.
    pub assets: Option<PathBuf>,
}

/// For programs that are started here: their last words are shown, and a
/// backtrace behind them would hide them. Panics still show theirs.
pub fn without_backtrace(command: &mut Command) {
    const NAME: &str = "RUST_LIB_BACKTRACE";
    if std::env::var_os(NAME).is_none() {
        command.env(NAME, "0");
    }
}

/// A child process whose messages are kept; it is killed when dropped.
pub struct Program {
    name: String,
    child: Child,
    lines: Arc<Mutex<VecDeque<String>>>,
}

impl Program {
    /// Starts `name`, found beside this program or on PATH.
    ///
    /// # Errors
    /// When it is not there or does not start.
    pub fn start<S: AsRef<OsStr>>(
        name: &str,
        arguments: impl IntoIterator<Item = S>,
    ) -> anyhow::Result<Self> {
        Self::start_with(name, arguments, Stdio::null())
    }

    /// As [`Program::start`] for a program that ends with its standard input:
    /// also when this process is killed.
    ///
    /// # Errors
    /// As [`Program::start`].
    fn start_bound<S: AsRef<OsStr>>(
        name: &str,
        arguments: impl IntoIterator<Item = S>,
    ) -> anyhow::Result<Self> {
        Self::start_with(name, arguments, Stdio::piped())
    }

    fn start_with<S: AsRef<OsStr>>(
        name: &str,
        arguments: impl IntoIterator<Item = S>,
        stdin: Stdio,
    ) -> anyhow::Result<Self> {
        let path = find_program(name).with_context(|| {
            format!("`{name}` lies neither beside this program nor on PATH; build the workspace first: cargo build --release --workspace")
        })?;
        let mut command = Command::new(&path);
        without_backtrace(&mut command);
        let mut child = command
            .args(arguments)
            .stdin(stdin)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("starting {}", path.display()))?;
        let lines = Arc::default();
        if let Some(stderr) = child.stderr.take() {
            keep_lines(stderr, &lines, None);
        }
        Ok(Self {
            name: name.to_owned(),
            child,
            lines,
        })
    }

    /// Its standard output, line by line; the newest are kept as well.
    fn output(&mut self) -> Receiver<String> {
        let (sender, receiver) = mpsc::channel();
        if let Some(stdout) = self.child.stdout.take() {
            keep_lines(stdout, &self.lines, Some(sender));
        }
        receiver
    }

    /// How it ended, if it has.
    ///
    /// # Errors
    /// When the operating system does not tell.
    pub fn ended(&mut self) -> anyhow::Result<Option<ExitStatus>> {
        self.child
            .try_wait()
            .with_context(|| format!("watching `{}`", self.name))
    }

    /// How it ended, if it does so within `patience`.
    ///
    /// # Errors
    /// When the operating system does not tell.
    pub fn ended_within(&mut self, patience: Duration) -> anyhow::Result<Option<ExitStatus>> {
        let deadline = Instant::now() + patience;
        loop {
            match self.ended()? {
                None if Instant::now() < deadline => {
                    std::thread::sleep(Duration::from_millis(20));
                }
                ended => return Ok(ended),
            }
        }
    }

    /// Waits for its end, at most `patience`.
    ///
    /// # Errors
    /// When it takes longer.
    pub fn wait(&mut self, patience: Duration) -> anyhow::Result<ExitStatus> {
        self.ended_within(patience)?.with_context(|| {
            format!(
                "`{}` did not end within {:.0} s",
                self.name,
                patience.as_secs_f64()
            )
        })
    }

    /// Closes its standard input, with which a program started here ends, and
    /// gives it `patience` to do so by itself.
    pub fn let_end(&mut self, patience: Duration) {
        drop(self.child.stdin.take());
        // One that does not end is killed when dropped.
        let _ = self.wait(patience);
    }

    /// Kills it, also when it stands still.
    pub fn kill(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Why it ended by its own words: those of a panic, else its error.
    #[must_use]
    pub fn last_words(&self) -> String {
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        last_words(lines.iter().map(String::as_str))
    }

    /// Its last messages.
    #[must_use]
    pub fn messages(&self) -> String {
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines
            .iter()
            .map(|line| format!("  {line}\n"))
            .collect::<String>()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Why a program ended, by its own words: the place and words of its first
/// panic, else its error; empty when it said neither.
pub fn last_words<'a>(lines: impl Iterator<Item = &'a str>) -> String {
    let lines: Vec<&str> = lines.filter(|line| !line.trim().is_empty()).collect();
    let panic = lines.iter().position(|line| line.contains("panicked at"));
    match panic {
        Some(at) => {
            let end = lines.len().min(at + 2);
            lines[at..end].join(" ").trim().to_owned()
        }
        None => {
            let errors = lines.iter().rev();
            let error = errors.map(|line| line.trim()).find(|line| {
                let start = line.get(..6).unwrap_or_default();
                start.eq_ignore_ascii_case("error:")
            });
            error.unwrap_or_default().to_owned()
        }
    }
}

fn keep_lines(
    source: impl Read + Send + 'static,
    lines: &Arc<Mutex<VecDeque<String>>>,
    copy: Option<mpsc::Sender<String>>,
) {
    let lines = Arc::clone(lines);
    std::thread::spawn(move || {
        for line in BufReader::new(source).split(b'\n').map_while(Result::ok) {
            let line = String::from_utf8_lossy(&line).into_owned();
            if let Some(copy) = &copy {
                // Nobody may be listening any more.
                let _ = copy.send(line.clone());
            }
            let mut kept = lines.lock().unwrap_or_else(PoisonError::into_inner);
            if kept.len() == KEPT_LINES {
                kept.pop_front();
            }
            kept.push_back(line);
        }
    });
}

/// A server of this command's own.
pub struct LocalServer {
    program: Program,
    connect: Connect,
}

/// Longest time until a server is ready: it may build its pipelines on a CPU.
const READY: Duration = Duration::from_secs(180);

impl LocalServer {
    /// Starts `wheelarm-server` on a free loopback port and waits until it serves.
    ///
    /// # Errors
    /// With the server's own words when it ends instead.
    pub fn start(options: &ServerOptions) -> anyhow::Result<Self> {
        // Several may run on one host, so the name is the process's own.
        let sim = format!("local-{}", std::process::id());
        let mut program = Program::start_bound("wheelarm-server", arguments(options, &sim))?;
        let output = program.output();
        let deadline = Instant::now() + READY;
        let endpoint = loop {
            match output.recv_timeout(Duration::from_millis(100)) {
                Ok(line) => {
                    if let Some(endpoint) = ready_endpoint(&line) {
                        break endpoint;
                    }
                }
                Err(_) => {
                    if let Some(status) = program.ended()? {
                        bail!(
                            "wheelarm-server ended while starting ({status}):\n{}",
                            program.messages()
                        );
                    }
                    if Instant::now() > deadline {
                        bail!(
                            "wheelarm-server was not ready within {:.0} s:\n{}",
                            READY.as_secs_f64(),
                            program.messages()
                        );
                    }
                }
            }
        };
        Ok(Self {
            program,
            connect: Connect {
                endpoint,
                sim,
                timeout_secs: 10.0,
            },
        })
    }

    /// How to reach it.
    #[must_use]
    pub fn connect(&self) -> &Connect {
        &self.connect
    }

    /// Opens a connection to it.
    ///
    /// # Errors
    /// With the server's last messages.
    pub fn link(&self) -> anyhow::Result<Link> {
        Link::open(&self.connect)
            .with_context(|| format!("the server said:\n{}", self.program.messages()))
    }

    /// The server's last messages.
    #[must_use]
    pub fn messages(&self) -> String {
        self.program.messages()
    }

    /// How it ended, if it has.
    ///
    /// # Errors
    /// When the operating system does not tell.
    pub fn ended(&mut self) -> anyhow::Result<Option<ExitStatus>> {
        self.program.ended()
    }

    /// How it ended, if it does so within `patience`.
    ///
    /// # Errors
    /// When the operating system does not tell.
    pub fn ended_within(&mut self, patience: Duration) -> anyhow::Result<Option<ExitStatus>> {
        self.program.ended_within(patience)
    }

    /// Kills it, also when it stands still.
    pub fn kill(&mut self) {
        self.program.kill();
    }

    /// Why it ended by its own words: those of a panic, else its error.
    #[must_use]
    pub fn last_words(&self) -> String {
        self.program.last_words()
    }

    /// Asks it to end and waits for that.
    ///
    /// # Errors
    /// When it does not end.
    pub fn stop(mut self, link: Link) -> anyhow::Result<()> {
        link.shutdown(true)?;
        // A client that goes first leaves no half-open connection behind.
        link.close()?;
        self.program.wait(Duration::from_secs(20)).map(|_| ())
    }
}

fn arguments(options: &ServerOptions, sim: &str) -> Vec<OsString> {
    let mut arguments: Vec<OsString> = [
        "--end-with-stdin",
        "--sim",
        sim,
        "--listen",
        "tcp/127.0.0.1:0",
        "--pacing",
        options.pacing.name(),
        "--scene",
        &options.scene,
        "--task",
        &options.task,
        "--robot",
        &options.robot,
        "--seed",
        &options.seed.to_string(),
        "--quality",
        options.quality.name(),
    ]
    .map(OsString::from)
    .to_vec();
    if options.cameras.is_empty() {
        arguments.push("--no-cameras".into());
    }
    for camera in &options.cameras {
        arguments.extend(["--camera".into(), camera.into()]);
    }
    if let Some(assets) = &options.assets {
        arguments.extend(["--assets".into(), assets.into()]);
    }
    arguments
}

/// Endpoint of the line `ready ENDPOINT sim=NAME`.
fn ready_endpoint(line: &str) -> Option<String> {
    Ready::parse(line).map(|ready| ready.endpoint)
}

/// A label that names no file in `folder` yet: `label`, `label-2`, `label-3` …
#[must_use]
pub fn free_label(folder: &Path, label: &str) -> String {
    let taken = |label: &str| {
        // Any file of that stem counts: an episode, a log, a sheet.
        std::fs::read_dir(folder).is_ok_and(|entries| {
            entries.flatten().any(|entry| {
                let name = entry.file_name();
                let name = name.to_string_lossy();
                name.strip_prefix(label)
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            })
        })
    };
    (1..)
        .map(|number| match number {
            1 => label.to_owned(),
            _ => format!("{label}-{number}"),
        })
        .find(|label| !taken(label))
        .unwrap_or_else(|| label.to_owned())
}

/// Longest time from the end of an episode to its finished file.
const FINISH: Duration = Duration::from_secs(120);

/// Starts a recorder called `name` that writes into `out`.
///
/// # Errors
/// When it cannot be started.
pub fn start_recorder(connect: &Connect, out: &Path, name: &str) -> anyhow::Result<Program> {
    Program::start_bound(
        "wheelarm",
        [
            "--connect".as_ref(),
            connect.endpoint.as_ref(),
            "--sim".as_ref(),
            connect.sim.as_ref(),
            "record".as_ref(),
            "--end-with-stdin".as_ref(),
            "--out".as_ref(),
            out.as_os_str(),
            "--name".as_ref(),
            name.as_ref(),
        ],
    )
}

/// Waits until the recorder `name` has finished the file of an episode.
///
/// # Errors
/// When the recording failed, the recorder ended or takes too long.
pub fn finished(
    link: &Link,
    name: &str,
    episode: u64,
    recorder: &mut Program,
) -> anyhow::Result<v1::RecorderStatus> {
    let deadline = Instant::now() + FINISH;
    loop {
        let status: v1::Status = link.ask(&v1::StatusRequest {})?;
        let ours = status.recorders.into_iter().find(|recorder| {
            let header = recorder.header.as_ref();
            recorder.recorder == name && header.is_some_and(|h| h.episode == episode)
        });
        if let Some(status) = ours {
            match status.state() {
                v1::RecorderState::Finished => return Ok(status),
                v1::RecorderState::Failed => bail!("the recording failed: {}", status.message),
                _ => {}
            }
        }
        if let Some(status) = recorder.ended()? {
            bail!("the recorder ended ({status}):\n{}", recorder.messages());
        }
        if Instant::now() > deadline {
            bail!(
                "the recorder did not finish within {:.0} s:\n{}",
                FINISH.as_secs_f64(),
                recorder.messages()
            );
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taken_name_gets_a_number() {
        let folder = std::env::temp_dir().join(format!("wheelarm-labels-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        assert_eq!(free_label(&folder, "a-seed1"), "a-seed1");
        for name in ["a-seed1.h5", "a-seed1-2.sheet.png", "a-seed10.h5"] {
            std::fs::write(folder.join(name), "").unwrap();
        }
        let free = (free_label(&folder, "a-seed1"), free_label(&folder, "a"));
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(free, ("a-seed1-3".to_owned(), "a".to_owned()));
    }

    #[test]
    fn a_panic_is_the_last_word_of_a_program() {
        let said = [
            "INFO begins",
            "thread 'simulation' (7) panicked at src/a.rs:3:4:",
            "index out of bounds",
            "note: run with RUST_BACKTRACE=1",
            "Error: the simulation thread panicked",
        ];
        let words = last_words(said.into_iter());
        assert!(
            words.ends_with("src/a.rs:3:4: index out of bounds"),
            "{words}"
        );
        assert_eq!(
            last_words(["a", "Error: no disk ", ""].into_iter()),
            "Error: no disk"
        );
        assert_eq!(last_words(["INFO all is well"].into_iter()), "");
    }

    #[test]
    fn the_ready_line_names_the_endpoint() {
        assert_eq!(
            ready_endpoint("ready tcp/127.0.0.1:40123 sim=local-7").as_deref(),
            Some("tcp/127.0.0.1:40123")
        );
        assert_eq!(ready_endpoint("already there"), None);
    }
}
