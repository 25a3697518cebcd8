//! Compares state hashes of the expert's episodes with `tests/data/redesign-hashes.csv`: a
//! refactoring must not change a bit.

use std::collections::BTreeMap;
use std::process::Command;

use serde_json::Value;
use wheelarm_tests::{printed, program, root};

const FILE: &str = "tests/data/redesign-hashes.csv";

/// Episodes by seed and person: the tasks, with the hash of each.
type Groups = BTreeMap<(String, String), BTreeMap<String, String>>;

/// The comment lines of the file, and its rows.
fn stored() -> (String, Vec<[String; 4]>) {
    let text = std::fs::read_to_string(root().join(FILE)).expect("the stored hashes");
    let (head, rows): (Vec<&str>, Vec<&str>) = text
        .lines()
        .partition(|line| line.starts_with('#') || line.starts_with("task,"));
    let rows = rows.iter().map(|row| {
        let cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        <[String; 4]>::try_from(cells).unwrap_or_else(|row| panic!("four cells: {row:?}"))
    });
    (head.join("\n"), rows.collect())
}

fn groups(rows: &[[String; 4]]) -> Groups {
    let mut groups = Groups::new();
    for [task, seed, person, hash] in rows {
        let group = groups.entry((seed.clone(), person.clone())).or_default();
        assert_eq!(
            group.insert(task.clone(), hash.clone()),
            None,
            "{task} {seed} twice"
        );
    }
    groups
}

/// The hashes that `wheelarm evaluate` computes for the episodes of a group.
fn computed(
    (seed, person): &(String, String),
    tasks: &BTreeMap<String, String>,
) -> BTreeMap<String, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let names: Vec<&str> = tasks.keys().map(String::as_str).collect();
    let end = seed.parse::<u64>().expect("a seed") + 1;
    let mut command = Command::new(program("wheelarm").expect("the client"));
    command
        .args(["evaluate", "--no-grid", "--jobs", "2", "--task"])
        .arg(names.join(","))
        .args(["--seeds", &format!("{seed}..{end}")])
        .arg("--out")
        .arg(folder.path())
        .arg("--assets")
        .arg(root().join("assets"));
    if !person.is_empty() {
        command.args(["--person", person]);
    }
    let output = command.output().expect("the client");
    let text = std::fs::read_to_string(folder.path().join("episodes.jsonl"));
    let text = text.unwrap_or_else(|problem| panic!("{problem}\n{}", printed(&output)));
    let entry = |line: &str| {
        let entry: Value = serde_json::from_str(line).expect("JSON");
        let text = |key: &str| entry[key].as_str().expect("text").to_owned();
        (text("task"), text("hash"))
    };
    text.lines().map(entry).collect()
}

fn check(groups: &Groups) {
    for (group, tasks) in groups {
        assert_eq!(computed(group, tasks), *tasks, "seed, person: {group:?}");
    }
}

/// The stored hashes of a seed without a person, by task.
pub fn of_seed(seed: &str) -> BTreeMap<String, String> {
    let (_, rows) = stored();
    let mut groups = groups(&rows);
    groups
        .remove(&(seed.to_owned(), String::new()))
        .expect("stored hashes of the seed")
}

/// The other rows of `make test` are compared where the expert completes every task.
#[test]
fn an_episode_with_a_person_has_the_stored_hash() {
    let (_, mut rows) = stored();
    rows.retain(|[task, _, person, _]| task == "pick_mustard" && person == "any");
    assert_eq!(rows.len(), 1);
    check(&groups(&rows));
}

/// `make test-hashes`; with WHEELARM_WRITE_HASHES=1 it writes the file again.
#[test]
#[ignore = "a minute and a half on two cores: make test-hashes"]
fn state_hashes_of_all_episodes_are_the_stored_ones() {
    let (head, rows) = stored();
    if std::env::var_os("WHEELARM_WRITE_HASHES").is_none() {
        return check(&groups(&rows));
    }
    let groups = groups(&rows);
    let new: BTreeMap<_, _> = groups
        .iter()
        .map(|(group, tasks)| (group.clone(), computed(group, tasks)))
        .collect();
    let mut text = head + "\n";
    for [task, seed, person, _] in rows {
        let hash = &new[&(seed.clone(), person.clone())][&task];
        text += &format!("{task},{seed},{person},{hash}\n");
    }
    std::fs::write(root().join(FILE), text).expect("the stored hashes");
}
