//! A private folder for a server's socket: other users of this host do not get
//! in, and no port can be taken by two.

use std::ffi::OsStr;
use std::path::Path;

use anyhow::{Context, bail};

/// Beginning of the name of a folder for a socket.
const SOCKET: &str = "wheelarm-socket-";
/// Note in a working folder with the path of the socket.
const SOCKET_NOTE: &str = "socket";
/// Longest path of such a folder, bytes: the operating system's limit for a
/// socket is 108, and the socket's own name and the transport's lock follow.
const LONGEST: usize = 80;

/// Makes a folder for a socket. It goes when dropped; after a kill,
/// [`remove_socket`] finds it by a note in the working folder `work`.
///
/// # Errors
/// When it cannot be made or its path is too long for a socket.
pub(crate) fn socket_folder(work: &Path) -> anyhow::Result<tempfile::TempDir> {
    let folder = tempfile::Builder::new().prefix(SOCKET).tempdir().context(
        "making a folder for the server's socket; set TMPDIR to a folder that can be written",
    )?;
    let length = folder.path().as_os_str().len();
    if length > LONGEST {
        bail!(
            "{} has {length} bytes, too long for a socket; set TMPDIR to a shorter folder such as /tmp",
            folder.path().display()
        );
    }
    std::fs::write(
        work.join(SOCKET_NOTE),
        folder.path().as_os_str().as_encoded_bytes(),
    )
    .with_context(|| format!("writing into {}", work.display()))?;
    Ok(folder)
}

/// Removes the socket's folder that a killed server with the working folder
/// `work` left.
pub fn remove_socket(work: &Path) {
    let Ok(note) = std::fs::read_to_string(work.join(SOCKET_NOTE)) else {
        return;
    };
    let folder = Path::new(&note);
    let name = folder
        .file_name()
        .and_then(OsStr::to_str)
        .unwrap_or_default();
    // Only what this module can have made.
    if folder.parent() == Some(&std::env::temp_dir()) && name.starts_with(SOCKET) {
        // It may have ended, or run on another host.
        let _ = std::fs::remove_dir_all(folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_leftover_socket_is_removed() {
        let work = tempfile::tempdir().unwrap();
        let socket = socket_folder(work.path()).unwrap().keep();
        assert!(socket.is_dir());
        remove_socket(work.path());
        assert!(!socket.exists());
        let other = tempfile::tempdir().unwrap();
        let note = other.path().as_os_str().as_encoded_bytes();
        std::fs::write(work.path().join(SOCKET_NOTE), note).unwrap();
        remove_socket(work.path());
        assert!(other.path().is_dir(), "a folder of another process");
    }
}
