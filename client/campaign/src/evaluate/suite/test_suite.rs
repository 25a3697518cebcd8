//! A small suite and rows for the tests.

use wheelarm_proto::PHYSICS_VERSION;

use super::figures::Row;
use super::file::Suite;
use super::report::{FORMAT, Identity, PolicyId};
use crate::frozen::hash;

/// Two tasks, two seeds; base, starts anywhere, two homes.
pub const SMALL: &str = r#"
purpose = "policy-claim"
seeds = [600, 602]
tasks = ["pick_bowl", "pick_mustard"]
unseen = ["seeds"]
[scenario]
starts = "near"
[[cell]]
name = "base"
[[cell]]
name = "start-2"
axis = "start"
strength = 2
scenario.starts = "anywhere"
[[cell]]
name = "home-1"
axis = "home"
strength = 1
scenes = ["a", "b"]
tasks = ["pick_bowl"]
unseen = ["homes"]
"#;

/// `text` with its hash.
pub fn frozen(text: &str) -> String {
    format!("frozen = \"{}\"\n{text}", hash(text).unwrap())
}

/// The suite of [`SMALL`].
pub fn suite() -> Suite {
    Suite::parse("small", &frozen(SMALL)).unwrap()
}

/// A row.
pub fn row(cell: &str, task: &str, seed: u64, success: bool) -> Row {
    Row {
        cell: cell.to_owned(),
        task: task.to_owned(),
        seed,
        success,
        cause: if success { "success" } else { "timeout" }.to_owned(),
        broken: false,
        progress: Some(if success { 100 } else { 40 }),
        milliseconds: 12_345,
        instruction: "take it & go".to_owned(),
        state: format!("{seed:016x}"),
    }
}

/// A row for every episode of the cells `base` and `start-2`, which succeed in turn.
pub fn rows(suite: &Suite) -> Vec<Row> {
    let cells = suite.cells.iter().take(2);
    let all = cells.flat_map(|cell| suite.episodes(cell).map(move |(t, s)| (cell, t, s)));
    all.enumerate()
        .map(|(i, (cell, task, seed))| row(&cell.name, task, seed, i % 3 != 1))
        .collect()
}

/// What identifies a run of `hold`.
pub fn identity(suite: &Suite) -> Identity {
    Identity {
        format: FORMAT.to_owned(),
        suite: suite.id(),
        policy: PolicyId {
            kind: "hold".to_owned(),
            name: "hold".to_owned(),
            weights: String::new(),
            files: String::new(),
            ledger: Some("0".to_owned()),
            undeclared: Vec::new(),
            deterministic: true,
        },
        physics_version: PHYSICS_VERSION,
    }
}
