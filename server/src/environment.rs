//! What graphics drivers and the transport read from the environment of a program
//! that serves.

use std::ffi::OsString;

/// Starts this program again with what graphics drivers and the transport read
/// from the environment, unless it is set already; where that fails, they do
/// without.
pub fn complete() {
    use std::os::unix::process::CommandExt;
    let wanted = [
        (
            "XDG_RUNTIME_DIR",
            runtime_folder as fn() -> Option<OsString>,
        ),
        ("LP_NUM_THREADS", drawing_threads),
        ("ZENOH_RUNTIME", sending_threads),
    ];
    let missing: Vec<(&str, OsString)> = wanted
        .iter()
        .filter(|(name, _)| std::env::var_os(name).is_none())
        .filter_map(|(name, value)| Some((*name, value()?)))
        .collect();
    if let (false, Ok(program)) = (missing.is_empty(), std::env::current_exe()) {
        let _ = std::process::Command::new(program)
            .args(std::env::args_os().skip(1))
            .envs(missing)
            .exec();
    }
}

/// A private folder: without one, as in containers and batch jobs, drivers
/// complain on stderr.
fn runtime_folder() -> Option<OsString> {
    use std::os::unix::fs::{DirBuilderExt, MetadataExt};
    let user = std::fs::metadata("/proc/self").map(|m| m.uid()).ok()?;
    let folder = std::env::temp_dir().join(format!("wheelarm-runtime-{user}"));
    let _ = std::fs::DirBuilder::new().mode(0o700).create(&folder);
    let ours = std::fs::metadata(&folder).is_ok_and(|m| m.is_dir() && m.uid() == user);
    ours.then(|| folder.into())
}

/// Threads of Mesa's lavapipe: one more than there are cores. With as many as
/// cores the kernel now and then leaves two of them on one and the other idle
/// (measured on two cores).
fn drawing_threads() -> Option<OsString> {
    let cores = std::thread::available_parallelism().ok()?.get();
    (cores > 1).then(|| (cores + 1).to_string().into())
}

/// Threads with which the transport sends to all peers, one unless said. The end
/// of a connection whose peer does not read keeps one busy for as long as
/// somebody waits to send to it, and with one alone nobody would hear anything.
fn sending_threads() -> Option<OsString> {
    Some("(tx: (worker_threads: 4))".into())
}
