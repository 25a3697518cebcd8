//! `wheelarm tasks`: the task list of the running server, or of the program
//! `wheelarm-server`, which reads the assets.

use wheelarm_proto::v1;
use wheelarm_rollout::launcher::{TaskSources, tasks_of_program};
use wheelarm_sdk::{ClientError, Connect};

use super::{open, print};

/// Prints the tasks of the server, or of `wheelarm-server` beside this program when no
/// server replies.
///
/// # Errors
/// When neither returns a list.
pub fn tasks(connect: &Connect) -> anyhow::Result<()> {
    let reply = open(connect).and_then(|client| client.request(&v1::TasksRequest {}));
    let tasks = match reply {
        Ok(list) => list.tasks,
        Err(ClientError::NoServer { endpoint, .. }) => {
            let tasks = tasks_of_program(TaskSources::default())?;
            eprintln!("no server replies at {endpoint}: these are the tasks of `wheelarm-server`");
            tasks
        }
        Err(other) => return Err(other.into()),
    };
    print!("{}", print::tasks_text(&tasks));
    Ok(())
}
