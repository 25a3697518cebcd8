//! Programs that start again with what libraries read from the environment.

/// Environment variable by which the transport learns how many threads it has. It
/// reads it once, before a process opens its first session.
pub const TRANSPORT_THREADS: &str = "ZENOH_RUNTIME";

/// Its value for a client of a server over TLS: one thread both sends and receives.
///
/// The transport reads and writes the same TLS connection without a lock, from two
/// threads unless told otherwise, and a connection that breaks while something is sent
/// then reads memory that has gone (eclipse-zenoh/zenoh#2557). A server cannot do with
/// one thread: it hands on between clients, and waits for itself when a queue is full.
pub const ONE_TRANSPORT_THREAD: &str = "(rx: (worker_threads: 1), tx: (handover: rx))";

/// Starts this program again, with the same words, in the same process, with those
/// variables that are not set already. Returns where nothing is missing, where the
/// system cannot do that, and where it fails: then the program goes on without. What a
/// client set for itself ([`ONE_TRANSPORT_THREAD`]) does not count in what it starts.
pub fn with_variables<'a>(wanted: impl IntoIterator<Item = (&'a str, std::ffi::OsString)>) {
    let missing: Vec<_> = wanted
        .into_iter()
        .filter(|(name, value)| match std::env::var_os(name) {
            None => true,
            Some(now) => now == ONE_TRANSPORT_THREAD && now != *value,
        })
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

/// [`with_variables`] for a client that opens sessions over TLS.
pub fn for_tls() {
    with_variables([(TRANSPORT_THREADS, ONE_TRANSPORT_THREAD.into())]);
}
