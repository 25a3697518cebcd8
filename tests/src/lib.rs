//! Shared parts of the system tests: servers, recorders and commanders that end with the
//! test, and a network that can be slow, frozen or cut.

pub mod adversary;
pub mod cpu;
pub mod decoders;
pub mod exported;
pub mod mutate;
mod operator;
mod proxy;
mod recorder;
mod router;
pub mod rows;
mod server;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};

pub use operator::IdleCommander;
pub use proxy::{Line, Proxy};
pub use recorder::Recorder;
pub use router::Router;
pub use server::Server;

/// Longest wait in a test, far beyond the expected time.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Waits until `done` returns true; panics with `what` after [`PATIENCE`].
pub fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let since = Instant::now();
    while !done() {
        assert!(
            since.elapsed() < PATIENCE,
            "timeout while waiting until {what}"
        );
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Names of all tasks, sorted.
pub const TASKS: [&str; 19] = [
    "close_drawer",
    "open_drawer",
    "pick_blue_mug",
    "pick_bowl",
    "pick_crackers",
    "pick_glass_bottle",
    "pick_grey_cup",
    "pick_meat_can",
    "pick_mustard",
    "pick_silver_bottle",
    "pick_tomato_soup",
    "place_knife",
    "place_teddy_bear",
    "select_coke",
    "serve_drink",
    "serve_remote",
    "serve_spoonful",
    "take_floor_crackers",
    "throw_meat_can",
];

/// Root of the workspace.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(1)
        .unwrap_or(Path::new("."))
        .to_owned()
}

/// A program of the workspace, built with the same profile as this test.
///
/// # Errors
/// When it has not been built; `make test` builds it first.
pub fn program(name: &str) -> anyhow::Result<PathBuf> {
    let test = std::env::current_exe()?;
    let folder = test.ancestors().nth(2).context("a folder above the test")?;
    let path = folder.join(name);
    if path.is_file() {
        Ok(path)
    } else {
        bail!(
            "{} is missing; run `make test`, which builds the programs first",
            path.display()
        )
    }
}

/// Runs `wheelarm` with these arguments and the workspace's assets, to its end.
///
/// # Panics
/// When it was not built or does not start.
#[must_use]
pub fn wheelarm(args: &[&str]) -> Output {
    Command::new(program("wheelarm").expect("the client"))
        .args(args)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process")
}

/// Output of a program, for the message of an assertion.
#[must_use]
pub fn printed(output: &Output) -> String {
    format!(
        "exit {:?}\n{}\n{}",
        output.status.code(),
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}
