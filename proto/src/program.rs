//! Machine-readable output of programs: the line that announces a ready server, the
//! list of tasks, and exit codes.

use std::error::Error;
use std::fmt;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use crate::v1;

/// Output of `--version`: the version, the contract and physics versions, and the
/// commit. The Makefile sets the commit through the build variable `WHEELARM_COMMIT`.
#[must_use]
pub fn version() -> &'static str {
    static LINE: LazyLock<String> = LazyLock::new(|| {
        format!(
            "{} (contract {}, physics {}, {})",
            env!("CARGO_PKG_VERSION"),
            crate::CONTRACT_VERSION,
            crate::PHYSICS_VERSION,
            option_env!("WHEELARM_COMMIT")
                .filter(|commit| !commit.is_empty())
                .unwrap_or("commit unknown")
        )
    });
    &LINE
}

/// Reports a test that cannot run here. With `WHEELARM_NO_SKIPS`, which `make test`
/// sets, that is a failure: a skipped test has not passed.
///
/// # Panics
/// With `WHEELARM_NO_SKIPS`.
#[track_caller]
pub fn skipped(reason: &str) {
    assert!(
        std::env::var_os("WHEELARM_NO_SKIPS").is_none(),
        "this test cannot run here: {reason}"
    );
    eprintln!("skipped: {reason}");
}

/// An error with its causes in one line. A cause that its error already quotes is not
/// repeated.
#[must_use]
pub fn error_chain(error: &dyn Error) -> String {
    let mut text = error.to_string().trim_end().to_owned();
    let mut cause = error.source();
    while let Some(error) = cause {
        let words = error.to_string();
        let words = words.trim_end();
        if !text.contains(words) {
            text = format!("{text}: {words}");
        }
        cause = error.source();
    }
    text
}

/// The text of an error without the source locations that the transport adds (` at
/// /cargo/registry/...rs:12.`).
#[must_use]
pub fn without_source_places(text: &str) -> String {
    let mut parts = text.split(" at /");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let line = part.split_once(".rs:").map(|(_, line)| line);
        let rest = line.map(|line| line.trim_start_matches(|c: char| c.is_ascii_digit()));
        match rest {
            Some(rest) => out.push_str(rest),
            // A path in the user's text.
            None => out.extend([" at /", part]),
        }
    }
    out.trim_end_matches(['.', ' ']).to_owned()
}

/// The first line of a server's standard output, printed when it is ready.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ready {
    /// Endpoint that it listens on.
    pub endpoint: String,
    /// Its name.
    pub sim: String,
}

impl fmt::Display for Ready {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ready {} sim={}", self.endpoint, self.sim)
    }
}

impl Ready {
    /// Parses the line.
    #[must_use]
    pub fn parse(line: &str) -> Option<Self> {
        let mut words = line.strip_prefix("ready ")?.split_whitespace();
        let endpoint = words.next()?.to_owned();
        let sim = words.next()?.strip_prefix("sim=")?.to_owned();
        Some(Self { endpoint, sim })
    }
}

/// One task in the output of `wheelarm-server --list-tasks --json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListedTask {
    /// File below `assets/tasks`, without extension.
    pub name: String,
    /// Activity of daily living: `serve` or `organize`.
    pub activity: String,
    /// Area of the home.
    pub area: String,
    /// `lift`, `put` or `open`.
    pub goal: String,
    /// Possible targets; the seed selects one.
    pub targets: Vec<String>,
    /// Possible instructions; the seed selects one.
    pub instructions: Vec<String>,
    /// Its conditions: predicates with their subjects.
    pub predicates: Vec<String>,
    /// Variants of its area in which it is possible; the first has no name.
    #[serde(default)]
    pub variants: Vec<String>,
}

/// Names of the goals, by their codes.
const GOALS: [(v1::GoalKind, &str); 4] = [
    (v1::GoalKind::Lift, "lift"),
    (v1::GoalKind::Put, "put"),
    (v1::GoalKind::Open, "open"),
    (v1::GoalKind::Close, "close"),
];

/// The name of a goal; empty for none.
#[must_use]
pub fn goal_word(goal: v1::GoalKind) -> &'static str {
    let word = GOALS.iter().find(|(kind, _)| *kind == goal);
    word.map_or("", |(_, word)| word)
}

/// Tasks as one line of JSON: a list of [`ListedTask`].
///
/// # Errors
/// The encoder's, which does not happen for texts.
pub fn tasks_to_json(tasks: &[v1::TaskInfo]) -> serde_json::Result<String> {
    let listed: Vec<_> = tasks
        .iter()
        .map(|task| ListedTask {
            name: task.name.clone(),
            activity: task.activity.clone(),
            area: task.area.clone(),
            goal: goal_word(task.goal()).to_owned(),
            targets: task.targets.clone(),
            instructions: task.instructions.clone(),
            predicates: task.predicates.clone(),
            variants: task.variants.clone(),
        })
        .collect();
    serde_json::to_string(&listed)
}

/// Parses the output of [`tasks_to_json`].
///
/// # Errors
/// When the text has another form.
pub fn tasks_from_json(text: &str) -> serde_json::Result<Vec<v1::TaskInfo>> {
    let listed: Vec<ListedTask> = serde_json::from_str(text)?;
    let listed = listed.into_iter();
    Ok(listed
        .map(|task| {
            let goal = GOALS.iter().find(|(_, word)| *word == task.goal);
            v1::TaskInfo {
                name: task.name,
                activity: task.activity,
                area: task.area,
                instructions: task.instructions,
                predicates: task.predicates,
                goal: goal
                    .map_or(v1::GoalKind::Unspecified, |(kind, _)| *kind)
                    .into(),
                targets: task.targets,
                variants: task.variants,
            }
        })
        .collect())
}

/// Exit code of a server whose scenario cannot be simulated.
pub const EXIT_SCENARIO: u8 = 4;

/// Exit code of an operator that failed at its task. Other failures are not the task's.
pub const EXIT_NOT_DONE: u8 = 5;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_of_the_transport_names_no_source_file() {
        let text = "Can not create a new TCP listener bound to tcp/[::1]:7447: [Address already \
                    in use (os error 98) at /cargo/registry/src/z/src/unicast.rs:372.] at \
                    /cargo/registry/src/z/src/mod.rs:31. - no file at /data/x";
        assert_eq!(
            without_source_places(text),
            "Can not create a new TCP listener bound to tcp/[::1]:7447: [Address already in use \
             (os error 98).]. - no file at /data/x"
        );
    }

    #[test]
    fn a_ready_line_survives_a_round_trip() {
        let ready = Ready {
            endpoint: "tcp/127.0.0.1:7447".to_owned(),
            sim: "sim".to_owned(),
        };
        assert_eq!(Ready::parse(&ready.to_string()), Some(ready));
        assert_eq!(Ready::parse("ready"), None);
    }

    #[test]
    fn tasks_survive_a_round_trip() {
        let tasks = [v1::TaskInfo {
            name: "open_drawer".to_owned(),
            activity: "organize".to_owned(),
            area: "workstation".to_owned(),
            instructions: vec!["Open \"it\"".to_owned()],
            predicates: vec!["opened_by(drawer_1_joint)".to_owned()],
            goal: v1::GoalKind::Open.into(),
            targets: vec!["drawer_1".to_owned()],
            variants: vec![String::new()],
        }];
        let text = tasks_to_json(&tasks).unwrap();
        assert!(text.contains("\"goal\":\"open\""), "{text}");
        assert_eq!(tasks_from_json(&text).unwrap(), tasks);
        assert!(tasks_from_json("{}").is_err());
    }

    #[test]
    fn a_quoted_cause_is_not_repeated() {
        #[derive(Debug, thiserror::Error)]
        #[error("scene.toml: {0}")]
        struct Outer(#[source] std::fmt::Error);
        let repeated = Outer(std::fmt::Error);
        assert_eq!(
            error_chain(&repeated),
            format!("scene.toml: {}", std::fmt::Error)
        );
        #[derive(Debug, thiserror::Error)]
        #[error("no scene")]
        struct Silent(#[source] std::fmt::Error);
        let silent = Silent(std::fmt::Error);
        assert_eq!(
            error_chain(&silent),
            format!("no scene: {}", std::fmt::Error)
        );
    }
}
