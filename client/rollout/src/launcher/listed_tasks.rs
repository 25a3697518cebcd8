//! Tasks of the assets, listed without a running server.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

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
    /// Packs whose objects tasks may place.
    pub objects: &'a [String],
}

/// Lists the tasks of the assets, and of the pack of a scene, with the program
/// `wheelarm-server`. No server needs to run.
///
/// # Errors
/// When the program is missing or the assets cannot be used.
pub fn tasks_of_program(sources: TaskSources<'_>) -> anyhow::Result<Vec<v1::TaskInfo>> {
    let output = output(sources, &["--list-tasks", "--json"])?;
    if !output.status.success() {
        bail!(
            "wheelarm-server cannot list its tasks: {}",
            error_of(&output)
        );
    }
    program::tasks_from_json(&String::from_utf8_lossy(&output.stdout)).context(
        "cannot read the tasks that wheelarm-server lists; install one version of all programs",
    )
}

/// Why a task that is not listed cannot be used, as the server says it; `None` when it can.
///
/// # Errors
/// When the program is missing.
pub fn refusal_of_program(sources: TaskSources<'_>, task: &str) -> anyhow::Result<Option<String>> {
    let output = output(sources, &["--draws", "0..1", "--task", task])?;
    Ok((!output.status.success()).then(|| error_of(&output)))
}

fn output(sources: TaskSources<'_>, args: &[&str]) -> anyhow::Result<Output> {
    let mut command = Command::new(required_program("wheelarm-server")?);
    command.args(args);
    if let Some(assets) = sources.assets {
        command.arg("--assets").arg(assets);
    }
    for folder in sources.packs {
        command.arg("--packs").arg(folder);
    }
    if !sources.scene.is_empty() {
        command.args(["--scene", sources.scene]);
    }
    if !sources.objects.is_empty() {
        command.arg("--objects").arg(sources.objects.join(","));
    }
    let output = command.output();
    output.with_context(|| format!("running wheelarm-server {}", args.join(" ")))
}

fn error_of(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    text.trim().trim_start_matches("error: ").to_owned()
}
