//! Which tasks there are: asked of the server that runs, else of the program
//! `wheelarm-server`, which reads the assets.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, bail};
use wheelarm_link::{Connect, LinkError};
use wheelarm_proto::{program, v1};
use wheelarm_rollout::launcher::required_program;

use super::{link, print};

/// Prints the tasks that the server knows; without a server those of the program
/// beside this one.
///
/// # Errors
/// When neither can be asked.
pub fn tasks(connect: &Connect) -> anyhow::Result<()> {
    let asked = link(connect).and_then(|link| link.ask(&v1::TasksRequest {}));
    let tasks = match asked {
        Ok(list) => list.tasks,
        Err(LinkError::NoServer { endpoint, .. }) => {
            let tasks = tasks_of_program(None)?;
            eprintln!("no server answers at {endpoint}: these are the tasks of `wheelarm-server`");
            tasks
        }
        Err(other) => return Err(other.into()),
    };
    print!("{}", print::tasks_text(&tasks));
    Ok(())
}

/// The tasks of the assets, told by the program `wheelarm-server` beside this
/// one or on PATH. No server need run.
///
/// # Errors
/// When there is no such program or the assets cannot be used.
pub fn tasks_of_program(assets: Option<&Path>) -> anyhow::Result<Vec<v1::TaskInfo>> {
    let mut command = Command::new(required_program("wheelarm-server")?);
    command.args(["--list-tasks", "--json"]);
    if let Some(assets) = assets {
        command.arg("--assets").arg(assets);
    }
    let output = command
        .output()
        .context("asking wheelarm-server for its tasks")?;
    if !output.status.success() {
        bail!(
            "wheelarm-server cannot list its tasks: {}",
            String::from_utf8_lossy(&output.stderr)
                .trim()
                .trim_start_matches("error: ")
        );
    }
    program::tasks_from_json(&String::from_utf8_lossy(&output.stdout)).context(
        "what wheelarm-server tells of its tasks cannot be read: is it of another version?",
    )
}
