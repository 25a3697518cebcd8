//! Which tasks there are: asked of the server that runs, else of the program
//! `wheelarm-server`, which reads the assets.

use wheelarm_proto::v1;
use wheelarm_rollout::launcher::tasks_of_program;
use wheelarm_sdk::{ClientError, Connect};

use super::{link, print};

/// Prints the tasks that the server knows; without a server those of the program
/// beside this one.
///
/// # Errors
/// When neither can be asked.
pub fn tasks(connect: &Connect) -> anyhow::Result<()> {
    let asked = link(connect).and_then(|link| link.request(&v1::TasksRequest {}));
    let tasks = match asked {
        Ok(list) => list.tasks,
        Err(ClientError::NoServer { endpoint, .. }) => {
            let tasks = tasks_of_program(None)?;
            eprintln!("no server answers at {endpoint}: these are the tasks of `wheelarm-server`");
            tasks
        }
        Err(other) => return Err(other.into()),
    };
    print!("{}", print::tasks_text(&tasks));
    Ok(())
}
