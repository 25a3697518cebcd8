//! Coordination of the processes that execute one command.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail};

/// Paths one behind the other, as a process gets them by its standard input.
pub fn list<'a>(files: impl Iterator<Item = &'a PathBuf>) -> Vec<u8> {
    let mut list = Vec::new();
    for file in files {
        list.extend_from_slice(file.as_os_str().as_encoded_bytes());
        list.push(0);
    }
    list
}

/// The paths of a [`list`].
pub fn paths(list: &[u8]) -> impl Iterator<Item = PathBuf> {
    let all = list.split(|byte| *byte == 0);
    all.filter(|path| !path.is_empty()).map(path_of)
}

/// Lets the kernel kill this process when `parent` is gone, however it went: files that it
/// would still make are of a command that was ended.
///
/// # Errors
/// When it is gone already.
pub fn end_with(parent: usize) -> anyhow::Result<()> {
    #[cfg(target_os = "linux")]
    {
        use rustix::process::{Signal, set_parent_process_death_signal};
        set_parent_process_death_signal(Some(Signal::KILL))?;
    }
    // It may have ended before the kernel call.
    if usize::try_from(std::os::unix::process::parent_id()).ok() != Some(parent) {
        bail!("the parent command of this process has ended: run it again");
    }
    Ok(())
}

fn path_of(bytes: &[u8]) -> PathBuf {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    OsStr::from_bytes(bytes).into()
}

/// This program, even if its file was replaced.
///
/// # Errors
/// When it cannot be found.
pub fn this_program() -> anyhow::Result<Command> {
    let own = Path::new("/proc/self/exe");
    let program = std::env::current_exe().context("finding this program")?;
    let is_there = program.exists() || !own.exists();
    Ok(Command::new(if is_there { &program } else { own }))
}
