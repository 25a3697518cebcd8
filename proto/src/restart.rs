//! Programs that start again with what libraries read from the environment.

/// Environment variable by which the transport learns how many threads it has. It
/// reads it once, before a process opens its first session.
pub const TRANSPORT_THREADS: &str = "ZENOH_RUNTIME";

/// Its value for who hands on between many: four threads send to all peers, one unless
/// said. The end of a connection whose peer does not read keeps one busy for as long as
/// somebody waits to send to it, and with one alone nobody would hear anything.
pub const SENDING_THREADS: &str = "(tx: (worker_threads: 4))";

/// Starts this program again, with the same words, in the same process, with those
/// variables that are not set already. Returns where nothing is missing, where the
/// system cannot do that, and where it fails: then the program goes on without.
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
