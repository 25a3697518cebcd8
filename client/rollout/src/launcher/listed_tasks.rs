//! Tasks of the assets, listed without a running server.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, bail};
use wheelarm_proto::{program, v1};

use super::program::required_program;

/// Lists the tasks of the assets with the program `wheelarm-server`. No server needs to run.
///
/// `assets` is the folder of the assets; the program finds its own when absent.
///
/// # Errors
/// When the program is missing or the assets cannot be used.
pub fn tasks_of_program(assets: Option<&Path>) -> anyhow::Result<Vec<v1::TaskInfo>> {
    let mut command = Command::new(required_program("wheelarm-server")?);
    command.args(["--list-tasks", "--json"]);
    if let Some(assets) = assets {
        command.arg("--assets").arg(assets);
    }
    let output = command
        .output()
        .context("running wheelarm-server --list-tasks")?;
    if !output.status.success() {
        bail!(
            "wheelarm-server cannot list its tasks: {}",
            String::from_utf8_lossy(&output.stderr)
                .trim()
                .trim_start_matches("error: ")
        );
    }
    program::tasks_from_json(&String::from_utf8_lossy(&output.stdout)).context(
        "cannot read the tasks that wheelarm-server lists; install one version of all programs",
    )
}
