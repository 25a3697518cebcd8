//! Queries that take time: control, episodes, scenarios. Each runs on a thread of
//! its own, and what came of it goes back to whoever decides.

use wheelarm_proto::v1;

use super::send::Commands;
use wheelarm_link::{Commander, Link, LinkError};

/// A query that takes time; its result comes back as [`Done`].
#[derive(Clone, Debug, PartialEq)]
pub enum Errand {
    /// Ask for control; `take` takes it from whoever holds it.
    Lease {
        /// Take it over.
        take: bool,
    },
    /// Start an episode.
    Start(Start),
    /// End the running episode.
    Stop {
        /// Throw it away.
        discard: bool,
    },
    /// Throw the running episode away, set the scene up again, start again.
    Redo(Start),
    /// Set up a scenario.
    Reset {
        /// Task.
        task: String,
        /// Seed.
        seed: u64,
    },
    /// Stop time, or let it go on.
    Pause(bool),
    /// List the tasks.
    Tasks,
    /// Read the scene, for the target hint.
    Scene,
}

/// How an episode is started.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Start {
    /// File label.
    pub label: String,
    /// Instruction sentence.
    pub instruction: String,
    /// Recorders that must be ready.
    pub recorders: u32,
}

/// What came of an errand; the error in words.
#[derive(Clone, Debug, PartialEq)]
pub enum Done {
    /// Control is ours, or why not.
    Lease(Result<(), String>),
    /// An episode began.
    Started(Result<Box<v1::EpisodeStarted>, String>),
    /// An episode ended.
    Stopped(Result<Box<v1::EpisodeStopped>, String>),
    /// A scenario is set up.
    Reset(Result<Box<v1::Scenario>, String>),
    /// Time is paused, or resumes.
    Paused(Result<bool, String>),
    /// The tasks.
    Tasks(Result<Vec<v1::TaskInfo>, String>),
    /// The scene.
    Scene(Result<Box<v1::SceneReply>, String>),
}

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
                let result = pause_time(&link, pause);
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

fn pause_time(link: &Link, pause: bool) -> Result<(), LinkError> {
    let done = match pause {
        true => link.ask(&v1::PauseRequest {}),
        false => link.ask(&v1::ResumeRequest {}),
    };
    done.map(|_| ())
}

/// The label that a scenario suggests.
#[must_use]
pub fn label_of(scenario: &v1::Scenario) -> String {
    let task = if scenario.task().is_empty() {
        "episode"
    } else {
        scenario.task()
    };
    format!("{task}-seed{}-1", scenario.seed())
}

/// The label with its last number counted up: a recorder refuses a taken name.
#[must_use]
pub fn next_label(label: &str) -> String {
    let digits = label
        .bytes()
        .rev()
        .take_while(u8::is_ascii_digit)
        .count()
        .min(9);
    let (stem, number) = label.split_at(label.len() - digits);
    match number.parse::<u64>() {
        Ok(number) => format!("{stem}{}", number + 1),
        Err(_) if label.is_empty() => String::new(),
        Err(_) => format!("{label}-2"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_count_up() {
        assert_eq!(next_label("try-9"), "try-10");
        assert_eq!(next_label("demo"), "demo-2");
        assert_eq!(next_label(""), "");
        assert!(next_label(&"9".repeat(100)).ends_with("1000000000"));
    }
}
