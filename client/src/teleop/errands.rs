//! Queries that take time, each on a thread of its own.

use wheelarm_proto::v1;

use super::model::{Done, Errand, Start};
use super::send::Commands;
use crate::control;
use wheelarm_link::{Commander, Link, LinkError};

/// What an errand brought.
pub enum Brought {
    /// An answer.
    Done(Done),
    /// Control, with the channel for commands.
    Control(Box<Commander>),
}

/// Runs an errand and hands over what it brought. `former` is a channel that
/// is given back before.
pub fn run(
    link: Link,
    name: String,
    errand: Errand,
    former: Option<Commands>,
    bring: impl Fn(Brought) + Send + 'static,
) {
    std::thread::spawn(move || {
        if let Some(former) = former {
            former.finish();
        }
        let done = match errand {
            Errand::Lease { take } => match link.commander(&name, take) {
                Ok(commander) => {
                    bring(Brought::Control(Box::new(commander)));
                    Done::Lease(Ok(()))
                }
                Err(error) => Done::Lease(Err(words(&error))),
            },
            Errand::Start(args) => Done::Started(start(&link, &name, &args)),
            Errand::Stop { discard } => Done::Stopped(stop(&link, discard)),
            Errand::Redo(args) => {
                let again = stop(&link, true)
                    .and_then(|_| reset(&link, v1::Scenario::default()))
                    .and_then(|_| start(&link, &name, &args));
                Done::Started(again)
            }
            Errand::Reset { task, seed } => {
                let scenario = v1::Scenario {
                    task: Some(task),
                    seed: Some(seed),
                    ..v1::Scenario::default()
                };
                Done::Reset(reset(&link, scenario))
            }
            Errand::Pause(pause) => {
                let result = control::pause(&link, pause);
                Done::Paused(result.map(|()| pause).map_err(|e| words(&e)))
            }
            Errand::Tasks => {
                let list = link.ask(&v1::TasksRequest {});
                Done::Tasks(list.map(|l| l.tasks).map_err(|e| words(&e)))
            }
            Errand::Scene => {
                let scene = link.ask(&v1::SceneRequest {});
                Done::Scene(scene.map(Box::new).map_err(|e| words(&e)))
            }
        };
        bring(Brought::Done(done));
    });
}

/// The server's own words where it refused; else all of it.
fn words(error: &LinkError) -> String {
    match error {
        LinkError::Refused { message, .. } => message.clone(),
        error => error.to_string(),
    }
}

fn start(link: &Link, name: &str, args: &Start) -> Result<Box<v1::EpisodeStarted>, String> {
    let request = v1::EpisodeStartRequest {
        label: args.label.clone(),
        instruction: (!args.instruction.is_empty()).then(|| args.instruction.clone()),
        require_recorders: args.recorders,
        commander: name.to_owned(),
        ..Default::default()
    };
    link.ask(&request).map(Box::new).map_err(|e| words(&e))
}

fn stop(link: &Link, discard: bool) -> Result<Box<v1::EpisodeStopped>, String> {
    link.stop_episode(discard)
        .map(Box::new)
        .map_err(|e| words(&e))
}

/// Sets up again; the instruction of the scenario is kept.
fn reset(link: &Link, scenario: v1::Scenario) -> Result<Box<v1::Scenario>, String> {
    link.reset(scenario, false)
        .map(Box::new)
        .map_err(|e| words(&e))
}
