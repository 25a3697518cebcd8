//! Tasks of the assets, listed without a running server.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail};
use wheelarm_proto::{program, v1};

use super::program::required_program;

/// Where tasks are found.
#[derive(Clone, Copy, Debug, Default)]
pub struct TaskSources<'a> {
    /// Assets folder; the program finds its own when absent.
    pub assets: Option<&'a Path>,
    /// Folders of world packs; those of the environment or the user when empty.
    pub packs: &'a [PathBuf],
    /// Scene, whose pack may have tasks; empty for the assets alone.
    pub scene: &'a str,
}

/// Lists the tasks of the assets, and of the pack of a scene, with the program
/// `wheelarm-server`. No server needs to run.
///
/// # Errors
/// When the program is missing or the assets cannot be used.
pub fn tasks_of_program(sources: TaskSources<'_>) -> anyhow::Result<Vec<v1::TaskInfo>> {
    let mut command = Command::new(required_program("wheelarm-server")?);
    command.args(["--list-tasks", "--json"]);
    if let Some(assets) = sources.assets {
        command.arg("--assets").arg(assets);
    }
    for folder in sources.packs {
        command.arg("--packs").arg(folder);
    }
    if !sources.scene.is_empty() {
        command.args(["--scene", sources.scene]);
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
