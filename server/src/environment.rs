//! Environment variables of a server that graphics drivers and the transport read.

use std::ffi::OsString;

use wheelarm_proto::restart::{self, SENDING_THREADS, TRANSPORT_THREADS};

/// Restarts this program with the variables that graphics drivers and the transport
/// read, unless they are set; if that fails, continues without them.
pub fn complete() {
    let wanted = [
        ("XDG_RUNTIME_DIR", runtime_folder()),
        ("LP_NUM_THREADS", drawing_threads()),
        (TRANSPORT_THREADS, Some(SENDING_THREADS.into())),
    ];
    let known = wanted
        .into_iter()
        .filter_map(|(name, value)| Some((name, value?)));
    restart::with_variables(known);
}

/// A private folder: without one, as in containers and batch jobs, drivers print
/// warnings to stderr.
fn runtime_folder() -> Option<OsString> {
    use std::os::unix::fs::{DirBuilderExt, MetadataExt};
    let user = std::fs::metadata("/proc/self").map(|m| m.uid()).ok()?;
    let folder = std::env::temp_dir().join(format!("wheelarm-runtime-{user}"));
    let _ = std::fs::DirBuilder::new().mode(0o700).create(&folder);
    let ours = std::fs::metadata(&folder).is_ok_and(|m| m.is_dir() && m.uid() == user);
    ours.then(|| folder.into())
}

/// Threads of Mesa's lavapipe: one more than there are cores. With as many as cores the
/// kernel sometimes schedules two on one core and leaves the other idle (measured on
/// two cores).
fn drawing_threads() -> Option<OsString> {
    let cores = std::thread::available_parallelism().ok()?.get();
    (cores > 1).then(|| (cores + 1).to_string().into())
}
