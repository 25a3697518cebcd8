//! How long what a rig does may take, wall time.

use std::time::Duration;

/// Until a server serves: it may build its pipelines on a CPU.
pub const READY: Duration = Duration::from_secs(300);
/// From the end of an episode to its finished file.
pub const FINISH: Duration = Duration::from_secs(900);
/// For each way of ending a program, before the next harder one: it is asked,
/// it is terminated, it is killed.
pub const END: Duration = Duration::from_secs(20);
/// Between two looks at a program.
pub const LOOK: Duration = Duration::from_millis(20);
/// For the connection to a server that serves.
pub const CONNECT: Duration = Duration::from_secs(10);
