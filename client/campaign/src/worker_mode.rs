//! Processes of the workers of `collect` and `evaluate`.

use wheelarm_proto::settings::Named;

/// Processes of a worker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WorkerMode {
    /// Server, recorder and expert in one process.
    #[default]
    Process,
    /// Each in a separate process, over a socket.
    Socket,
}

impl Named for WorkerMode {
    const WHAT: &'static str = "kind of worker";
    const ALL: &'static [Self] = &[Self::Process, Self::Socket];

    fn name(self) -> &'static str {
        match self {
            Self::Process => "process",
            Self::Socket => "socket",
        }
    }
}
