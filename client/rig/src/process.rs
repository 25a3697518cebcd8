//! The programs of one attempt: each with its messages in a file, out of reach
//! of the terminal's Ctrl-C, and never outliving this process.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};

use anyhow::Context;

use crate::find_program;
use crate::local::{last_words, without_backtrace};

/// Lines of a program's messages that stand in an error.
const TAIL_LINES: usize = 6;

/// A child process; killed when dropped.
#[derive(Debug)]
pub struct Process {
    name: &'static str,
    child: Child,
    log: PathBuf,
}

impl Process {
    /// Starts `program`, found beside this program or on PATH, as `name`.
    ///
    /// # Errors
    /// When it is not there or does not start.
    pub fn start<S: AsRef<OsStr>>(
        name: &'static str,
        program: &str,
        arguments: impl IntoIterator<Item = S>,
        folder: &Path,
    ) -> anyhow::Result<Self> {
        let path = find_program(program).with_context(|| {
            format!("`{program}` lies neither beside this program nor on PATH; build the workspace first: cargo build --release --workspace")
        })?;
        let log = folder.join(format!("{name}.log"));
        let output = File::create(&log).with_context(|| format!("making {}", log.display()))?;
        let errors = output
            .try_clone()
            .with_context(|| format!("opening {}", log.display()))?;
        let mut command = Command::new(&path);
        command
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(output)
            .stderr(errors)
            .process_group(0);
        without_backtrace(&mut command);
        end_with_parent(&mut command);
        let child = command
            .spawn()
            .with_context(|| format!("starting {}", path.display()))?;
        Ok(Self { name, child, log })
    }

    /// How it ended, if it has.
    ///
    /// # Errors
    /// When the operating system does not tell.
    pub fn ended(&mut self) -> anyhow::Result<Option<ExitStatus>> {
        self.child
            .try_wait()
            .with_context(|| format!("watching the {}", self.name))
    }

    /// Why it ended by its own words: those of a panic, else its error.
    #[must_use]
    pub fn last_words(&self) -> String {
        last_words(self.messages().lines())
    }

    /// Everything it said.
    #[must_use]
    pub fn messages(&self) -> String {
        let bytes = std::fs::read(&self.log).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// The last lines of what it said.
    #[must_use]
    pub fn tail(&self) -> String {
        let text = self.messages();
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(TAIL_LINES)..].join("\n")
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Lets the kernel kill the child when the thread that started it is gone,
/// however it went.
#[cfg(target_os = "linux")]
#[allow(
    unsafe_code,
    reason = "a hook between fork and exec; it makes two system calls and nothing else"
)]
fn end_with_parent(command: &mut Command) {
    let parent = std::process::id();
    let hook = move || {
        // SAFETY: prctl with these arguments touches no memory; both calls are
        // async-signal-safe.
        let (set, now) = unsafe {
            (
                libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL),
                libc::getppid(),
            )
        };
        if set != 0 {
            return Err(std::io::Error::last_os_error());
        }
        // The parent may have gone before the kernel was asked.
        if u32::try_from(now) == Ok(parent) {
            Ok(())
        } else {
            Err(std::io::Error::other("the parent is gone"))
        }
    };
    // SAFETY: the hook allocates nothing and takes no lock on its good way.
    unsafe {
        command.pre_exec(hook);
    }
}

#[cfg(not(target_os = "linux"))]
fn end_with_parent(_command: &mut Command) {}

/// Beginning of the name of a folder for a socket.
const SOCKET: &str = "wheelarm-collect-";
/// Note in a staging folder that says where the socket is.
const SOCKET_NOTE: &str = "socket";

/// A private folder for the socket of an attempt's server: other users of this
/// host do not get in, and no port can be taken by two. It goes when dropped;
/// after a kill, [`remove_socket`] finds it by a note in `staging`.
///
/// # Errors
/// When it cannot be made or its path is too long for a socket.
pub fn socket_folder(staging: &Path) -> anyhow::Result<tempfile::TempDir> {
    let folder = tempfile::Builder::new().prefix(SOCKET).tempdir().context(
        "making a folder for the server's socket; set TMPDIR to a folder that can be written",
    )?;
    let length = folder.path().as_os_str().len();
    if length > 80 {
        anyhow::bail!(
            "{} has {length} bytes, too long for a socket; set TMPDIR to a shorter folder such as /tmp",
            folder.path().display()
        );
    }
    std::fs::write(
        staging.join(SOCKET_NOTE),
        folder.path().as_os_str().as_encoded_bytes(),
    )
    .with_context(|| format!("writing into {}", staging.display()))?;
    Ok(folder)
}

/// Removes the socket's folder that a killed attempt in `staging` left.
pub fn remove_socket(staging: &Path) {
    let Ok(note) = std::fs::read_to_string(staging.join(SOCKET_NOTE)) else {
        return;
    };
    let folder = Path::new(&note);
    let name = folder
        .file_name()
        .and_then(OsStr::to_str)
        .unwrap_or_default();
    // Only what this module can have made.
    if folder.parent() == Some(&std::env::temp_dir()) && name.starts_with(SOCKET) {
        // It may be gone, or lie on another host.
        let _ = std::fs::remove_dir_all(folder);
    }
}

/// Words as arguments.
#[must_use]
pub fn words<const N: usize>(words: [&str; N]) -> Vec<OsString> {
    words.map(OsString::from).to_vec()
}
