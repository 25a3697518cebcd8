//! A supervised child process: its output is kept in a file, the terminal's Ctrl-C does not
//! reach it, and it does not outlive this process. It has a separate process group, so its
//! own children end with it.

use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context;
use rustix::process::{Pid, Signal, kill_process_group};

use super::program::required_program;
use crate::limits;

/// Lines of a program's output that an error contains.
const TAIL_LINES: usize = 30;
/// Newest bytes of its output that are read.
const TAIL_BYTES: u64 = 1 << 16;

/// Settings of the start of a program.
#[derive(Debug)]
pub struct Launch {
    /// Name for errors and for the file of its log: `server`.
    pub name: &'static str,
    /// The program.
    pub program: Program,
    /// Its arguments.
    pub arguments: Vec<OsString>,
    /// Additional environment variables.
    pub environment: Vec<(&'static str, OsString)>,
    /// Standard input.
    pub input: Input,
    /// Folder for its output as `NAME.log`; without one the output is kept until the process
    /// is dropped.
    pub folder: Option<PathBuf>,
}

/// The program to start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Program {
    /// A program of WheelArm, found beside this one or on PATH.
    Own(&'static str),
    /// A command line of the user for `sh`; arguments are appended verbatim.
    Shell(String),
}

/// Standard input of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Input {
    /// This text, which may be empty. On Linux the kernel kills the program when the
    /// thread that started it ends: start it on a thread that lives long enough.
    Text(String),
    /// An open pipe without data. The program ends in good order when it is closed, also by
    /// the end of this process.
    Lifeline,
    /// The pipes of [`Process::take_pipes`]: standard input and output. The kernel kills it
    /// as in [`Input::Text`].
    Orders,
}

/// A child process; killed when dropped.
#[derive(Debug)]
pub struct Process {
    name: &'static str,
    child: Child,
    /// Exit status, once known.
    status: Option<ExitStatus>,
    /// Whether this program killed it.
    ended_here: bool,
    log: File,
    /// Offset of its own output; the log may contain that of an earlier process.
    begin: u64,
}

impl Process {
    /// Starts a program.
    ///
    /// # Errors
    /// When the program does not exist or does not start.
    pub fn start(launch: Launch) -> anyhow::Result<Self> {
        let mut command = match &launch.program {
            Program::Own(name) => Command::new(required_program(name)?),
            Program::Shell(line) => {
                let mut shell = Command::new("sh");
                // `exec` replaces the shell, so that a signal reaches the program.
                shell.args(["-c", &format!("exec {line} \"$@\""), "sh"]);
                shell
            }
        };
        let log = match &launch.folder {
            Some(folder) => {
                let file = folder.join(format!("{}.log", launch.name));
                let options = File::options().create(true).read(true).append(true).clone();
                options
                    .open(&file)
                    .with_context(|| format!("making {}", file.display()))?
            }
            None => tempfile::tempfile().context(
                "keeping the messages of a program; set TMPDIR to a folder that can be written",
            )?,
        };
        let begin = log.metadata().map_or(0, |file| file.len());
        let another = || log.try_clone().context("keeping the messages of a program");
        let output = match launch.input {
            Input::Orders => Stdio::piped(),
            Input::Text(_) | Input::Lifeline => another()?.into(),
        };
        command
            .args(&launch.arguments)
            .envs(launch.environment)
            .stdin(Stdio::piped())
            .stdout(output)
            .stderr(another()?)
            .process_group(0);
        // Its last message is shown, and a backtrace after it would hide it;
        // panics still show theirs.
        const BACKTRACE: &str = "RUST_LIB_BACKTRACE";
        if std::env::var_os(BACKTRACE).is_none() {
            command.env(BACKTRACE, "0");
        }
        if let Input::Text(_) | Input::Orders = launch.input {
            end_with_parent(&mut command);
        }
        let child = command
            .spawn()
            .with_context(|| format!("starting the {}", launch.name))?;
        let mut process = Self {
            name: launch.name,
            child,
            status: None,
            ended_here: false,
            log,
            begin,
        };
        if let Input::Text(text) = launch.input
            && let Some(mut input) = process.child.stdin.take()
        {
            // A program that ends before it has read everything prints its reason.
            let _ = input.write_all(text.as_bytes());
        }
        Ok(process)
    }

    /// Standard input and output of [`Input::Orders`]; only the first call returns them.
    #[must_use]
    pub fn take_pipes(&mut self) -> Option<(ChildStdin, ChildStdout)> {
        self.child.stdin.take().zip(self.child.stdout.take())
    }

    /// Exit status, if it has ended. Its remaining child processes are killed then.
    ///
    /// # Errors
    /// When the operating system does not report it.
    pub fn ended(&mut self) -> anyhow::Result<Option<ExitStatus>> {
        if self.status.is_none() {
            let status = self.child.try_wait();
            self.status = status.with_context(|| format!("watching the {}", self.name))?;
            if self.status.is_some() {
                self.signal(Signal::KILL);
            }
        }
        Ok(self.status)
    }

    /// Signals the whole group. The group may have ended; its number is not reused while a
    /// member lives, or its leader was not waited for.
    fn signal(&self, signal: Signal) {
        if let Some(group) = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process_group(group, signal);
        }
    }

    /// Exit status, if it ends within `patience`.
    ///
    /// # Errors
    /// When the operating system does not report it.
    pub fn ended_within(&mut self, patience: Duration) -> anyhow::Result<Option<ExitStatus>> {
        let deadline = Instant::now() + patience;
        loop {
            match self.ended()? {
                None if Instant::now() < deadline => std::thread::sleep(limits::LOOK),
                ended => return Ok(ended),
            }
        }
    }

    /// Ends the program and returns its exit status: closes its standard input, after
    /// [`limits::END`] terminates its group, then kills it.
    ///
    /// # Errors
    /// When the operating system does not report it.
    pub fn end(&mut self) -> anyhow::Result<ExitStatus> {
        if let Some(lifeline) = self.child.stdin.take() {
            drop(lifeline);
            if let Some(status) = self.ended_within(limits::END)? {
                return Ok(status);
            }
        }
        if self.ended()?.is_none() {
            self.signal(Signal::TERM);
        }
        if let Some(status) = self.ended_within(limits::END)? {
            return Ok(status);
        }
        self.kill();
        let status = self.child.wait();
        status.with_context(|| format!("watching the {}", self.name))
    }

    /// Kills its process group, even if it is stopped.
    pub fn kill(&mut self) {
        if self.status.is_none() {
            self.ended_here = true;
            self.signal(Signal::KILL);
            self.status = self.child.wait().ok();
        }
    }

    /// Description of its end with its last message, if it has ended.
    ///
    /// # Errors
    /// When the operating system cannot report it.
    pub fn death(&mut self) -> anyhow::Result<Option<String>> {
        let Some(status) = self.ended()? else {
            return Ok(None);
        };
        let died = format!("the {} died ({status})", self.name);
        Ok(Some(match self.last_words().as_str() {
            "" => died,
            words => format!("{died}: {words}"),
        }))
    }

    /// Name for messages, as in [`Launch::name`].
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Whether a foreign SIGKILL ended it, which nearly always is from a kernel or a job
    /// scheduler without free memory.
    #[must_use]
    pub fn was_killed(&self) -> bool {
        let signal = self.status.and_then(|status| status.signal());
        !self.ended_here && signal == Some(Signal::KILL.as_raw())
    }

    /// Its newest output, at most 64 KiB.
    #[must_use]
    pub fn messages(&self) -> String {
        let length = self.log.metadata().map_or(0, |file| file.len());
        let from = length.saturating_sub(TAIL_BYTES).max(self.begin);
        let length = length.max(from);
        let mut bytes = vec![0; usize::try_from(length - from).unwrap_or_default()];
        match self.log.read_exact_at(&mut bytes, from) {
            Ok(()) => String::from_utf8_lossy(&bytes).into_owned(),
            Err(_) => String::new(),
        }
    }

    /// The last lines of its output, indented, each with its line end.
    #[must_use]
    pub fn tail(&self) -> String {
        let text = self.messages();
        let lines: Vec<&str> = text.lines().collect();
        let tail = lines[lines.len().saturating_sub(TAIL_LINES)..].iter();
        tail.map(|line| format!("  {line}\n")).collect()
    }

    /// Reason of its end from its output: a panic message, else its error; empty
    /// without either.
    #[must_use]
    pub fn last_words(&self) -> String {
        last_words(&self.messages())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Makes the kernel kill the child when the thread that started it ends.
#[cfg(target_os = "linux")]
#[expect(
    unsafe_code,
    reason = "a hook between fork and exec; it makes two system calls and nothing else"
)]
pub fn end_with_parent(command: &mut Command) {
    let parent = std::process::id();
    let hook = move || {
        rustix::process::set_parent_process_death_signal(Some(Signal::KILL))?;
        // The parent may have ended before this request to the kernel.
        if std::os::unix::process::parent_id() == parent {
            Ok(())
        } else {
            Err(std::io::Error::from(std::io::ErrorKind::NotFound))
        }
    };
    // SAFETY: the hook makes two system calls that are async-signal-safe; it
    // allocates nothing and takes no lock.
    unsafe {
        command.pre_exec(hook);
    }
}

#[cfg(not(target_os = "linux"))]
pub fn end_with_parent(_command: &mut Command) {}

/// Location and message of the first panic in a program's output, else its last error.
fn last_words(messages: &str) -> String {
    let lines: Vec<&str> = messages
        .lines()
        .filter(|line| !line.trim().is_empty())
        .collect();
    let panic = lines.iter().position(|line| line.contains("panicked at"));
    if let Some(at) = panic {
        let end = lines.len().min(at + 2);
        return lines[at..end].join(" ").trim().to_owned();
    }
    let mut errors = lines.iter().rev().map(|line| line.trim());
    let error = errors.find(|line| {
        let start = line.get(..6).unwrap_or_default();
        start.eq_ignore_ascii_case("error:")
    });
    error.unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, input: Input, folder: Option<PathBuf>) -> Process {
        let launch = Launch {
            name: "shell",
            program: Program::Shell(format!("sh -c '{}'", script.replace('\'', "'\\''"))),
            arguments: Vec::new(),
            environment: Vec::new(),
            input,
            folder,
        };
        Process::start(launch).expect("a shell")
    }

    #[test]
    fn panic_is_the_last_message_of_a_program() {
        let output = "INFO begins\nthread 'simulation' (7) panicked at src/a.rs:3:4:\n\
                    index out of bounds\nnote: run with RUST_BACKTRACE=1\n\
                    Error: the simulation thread panicked\n";
        let words = last_words(output);
        assert!(
            words.ends_with("src/a.rs:3:4: index out of bounds"),
            "{words}"
        );
        assert_eq!(last_words("a\nError: no disk \n\n"), "Error: no disk");
        assert_eq!(last_words("INFO all is well"), "");
    }

    #[test]
    fn program_reads_its_text_and_its_output_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        for folder in [None, Some(folder.path().to_owned())] {
            let text = Input::Text("a scenario\n".to_owned());
            let mut process = shell("cat; echo error: no disk >&2; exit 3", text, folder);
            let status = process.ended_within(limits::END).unwrap();
            assert_eq!(status.and_then(|status| status.code()), Some(3));
            assert_eq!(process.tail(), "  a scenario\n  error: no disk\n");
            assert_eq!(process.last_words(), "error: no disk");
        }
        let log = std::fs::read_to_string(folder.path().join("shell.log")).unwrap();
        assert_eq!(log, "a scenario\nerror: no disk\n");
    }

    #[test]
    fn child_with_a_lifeline_ends_regularly_and_another_is_terminated() {
        let mut bound = shell("cat; exit 4", Input::Lifeline, None);
        assert_eq!(bound.ended().unwrap(), None);
        assert_eq!(bound.end().unwrap().code(), Some(4));
        let script = "trap 'exit 5' TERM; echo up; while :; do sleep 0.05; done";
        let mut other = shell(script, Input::Text(String::new()), None);
        while other.messages().is_empty() {
            std::thread::sleep(limits::LOOK);
        }
        assert_eq!(other.end().unwrap().code(), Some(5));
    }

    /// Whether a process runs; a zombie does not.
    fn runs(id: &str) -> bool {
        let status = std::fs::read_to_string(format!("/proc/{id}/status"));
        status.is_ok_and(|status| !status.contains("State:\tZ"))
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn children_end_with_their_launcher() {
        // Once by a kill, once by itself.
        for rest in ["wait", "exit 0"] {
            let script = format!("sleep 600 & echo $!; {rest}");
            let mut launcher = shell(&script, Input::Text(String::new()), None);
            while launcher.messages().is_empty() {
                std::thread::sleep(limits::LOOK);
            }
            let id = launcher.messages().trim().to_owned();
            if rest == "wait" {
                assert!(runs(&id));
                launcher.kill();
            } else {
                let status = launcher.ended_within(limits::END).unwrap();
                assert_eq!(status.and_then(|status| status.code()), Some(0));
            }
            let deadline = Instant::now() + limits::END;
            while runs(&id) && Instant::now() < deadline {
                std::thread::sleep(limits::LOOK);
            }
            assert!(!runs(&id), "{rest}");
        }
    }

    #[test]
    fn missing_program_is_an_error_with_its_fix() {
        let launch = Launch {
            name: "ghost",
            program: Program::Own("wheelarm-ghost"),
            arguments: Vec::new(),
            environment: Vec::new(),
            input: Input::Lifeline,
            folder: None,
        };
        let error = Process::start(launch).unwrap_err().to_string();
        assert!(error.contains("cargo build"), "{error}");
    }
}
