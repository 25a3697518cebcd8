//! Restarts a program with environment variables that libraries read.

/// Environment variable with the transport's thread counts. It is read once, before a
/// process opens its first session.
pub const TRANSPORT_THREADS: &str = "ZENOH_RUNTIME";

/// Its value for routers: four sending threads instead of one. A closing connection
/// whose peer does not read occupies one thread while messages wait for it; with a
/// single thread no other peer would receive anything.
pub const SENDING_THREADS: &str = "(tx: (worker_threads: 4))";

/// Restarts this program with the same arguments in the same process, with the
/// variables that are not set yet. Returns when none is missing or the restart fails:
/// the program then continues without them.
pub fn with_variables<'a>(wanted: impl IntoIterator<Item = (&'a str, std::ffi::OsString)>) {
    let missing: Vec<_> = wanted
        .into_iter()
        .filter(|(name, _)| std::env::var_os(name).is_none())
        .collect();
    if missing.is_empty() {
        return;
    }
    #[cfg(unix)]
    if let Ok(program) = std::env::current_exe() {
        use std::os::unix::process::CommandExt;
        let _ = std::process::Command::new(program)
            .args(std::env::args_os().skip(1))
            .envs(missing)
            .exec();
    }
}
