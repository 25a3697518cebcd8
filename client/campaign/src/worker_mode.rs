//! How the workers of `collect` and `evaluate` run.

use wheelarm_proto::settings::Named;

/// How a worker runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WorkerMode {
    /// Server, recorder and expert in one process.
    #[default]
    Process,
    /// Each in a process of its own, over a socket.
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
