//! Names of tasks on the command line.

use anyhow::bail;
use wheelarm_options::choice::did_you_mean;
use wheelarm_proto::v1::TaskInfo;
use wheelarm_rollout::launcher::{TaskSources, refusal_of_program};

/// Checks that a task is among those that the server lists for a scene.
///
/// # Errors
/// With the nearest name, or the server's reason when the task exists in other scenes only.
pub fn check_task(sources: TaskSources<'_>, listed: &[TaskInfo], name: &str) -> anyhow::Result<()> {
    let names = || listed.iter().map(|task| task.name.as_str());
    if names().any(|listed| listed == name) {
        return Ok(());
    }
    let scene = sources.scene;
    let available: Vec<&str> = names().collect();
    let available = available.join(", ");
    match did_you_mean(name, names()).as_str() {
        "" => {
            let reason = refusal_of_program(sources, name)?.unwrap_or_default();
            bail!("no task named {name:?} in {scene}: {reason}; available: {available}")
        }
        meant => bail!("no task named {name:?} in {scene}; available: {available}{meant}"),
    }
}
