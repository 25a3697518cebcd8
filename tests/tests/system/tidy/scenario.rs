//! The message `Scenario`: every field is in the guide, and has the same name in TOML, Python, the
//! page and the options of the server.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use wheelarm_tests::program;

use super::{list, root};

const GUIDE: &str = "docs/drive-and-record/scenario.md";

/// Names of the fields of a message of the contract.
fn fields(message: &str) -> Vec<String> {
    let contract = fs::read_to_string(root().join("proto/contract.txt")).expect("the contract");
    let lines = contract.lines().filter_map(|line| {
        let mut words = line.split(' ');
        let is_field = words.next() == Some(message) && words.next()?.parse::<u32>().is_ok();
        is_field.then(|| words.next().unwrap_or_default().to_owned())
    });
    lines.collect()
}

#[test]
fn every_field_of_the_scenario_has_a_row_in_the_guide() {
    let guide = fs::read_to_string(root().join(GUIDE)).expect("the guide");
    let fields = fields("Scenario");
    assert!(fields.len() > 30, "{fields:?}");
    for field in fields {
        assert!(
            guide.contains(&format!("\n| `{field}` |")),
            "{GUIDE} has no row for the field `{field}` of Scenario; add one"
        );
    }
}

#[test]
fn the_complete_toml_file_of_the_guide_sets_every_field() {
    let guide = fs::read_to_string(root().join(GUIDE)).expect("the guide");
    let text = guide.split("```toml\n").nth(1).expect("an example");
    let text = text.split("```").next().expect("its end");
    wheelarm_server::service::startup::read(text).expect("a scenario of the contract");
    let table: toml::Table = text.parse().expect("TOML");
    for field in fields("Scenario") {
        assert!(
            table.contains_key(&field),
            "the complete file in {GUIDE} does not set `{field}`; add it"
        );
    }
}

#[test]
fn options_of_the_server_have_the_names_of_the_fields() {
    let guide = fs::read_to_string(root().join(GUIDE)).expect("the guide");
    let mut server = Command::new(program("wheelarm-server").expect("the server"));
    let help = server.arg("--help").output().expect("the server's help");
    let help = String::from_utf8_lossy(&help.stdout);
    let rows = guide.lines().filter(|line| line.starts_with("| `"));
    let mut with_option = 0;
    for row in rows {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let field = cells[1].trim_matches('`');
        let Some(option) = cells[3].strip_prefix("`--") else {
            continue;
        };
        let option = option.split(['`', ' ']).next().unwrap_or_default();
        let spelled = field.replace('_', "-");
        // A list is given by its singular, once for each entry.
        let singular = spelled.trim_end_matches('s');
        let is_list = ["cameras", "sensors"].contains(&field);
        assert_eq!(
            option,
            if is_list { singular } else { &spelled },
            "{GUIDE}: {row}"
        );
        assert!(help.contains(&format!("--{option} ")) || help.contains(&format!("--{option}\n")));
        with_option += 1;
    }
    assert!(with_option > 12, "{with_option} options");
}

#[test]
fn python_knows_every_field_of_the_scenario() {
    let path = "client/python/src/wheelarm/v1.pyi";
    let text = fs::read_to_string(root().join(path)).expect("the stubs");
    let class = text.split("class Scenario(").nth(1).expect("a class");
    let class = class.split("\nclass ").next().expect("its end");
    for field in fields("Scenario") {
        assert!(
            class.contains(&format!("\n    {field}: ")),
            "{path} lacks `{field}`; run make contract-python"
        );
    }
}

#[test]
fn the_page_names_only_fields_of_the_scenario() {
    let known: BTreeSet<String> = fields("Scenario").into_iter().collect();
    let mut found = 0;
    for path in list("client/teleop/web/page", ".js") {
        let text = fs::read_to_string(&path).expect("a script");
        for part in text.split("scenario").skip(1) {
            let Some(rest) = part.strip_prefix("?.").or(part.strip_prefix('.')) else {
                continue;
            };
            let word = |c: char| !(c.is_alphanumeric() || c == '_');
            let field = rest.split(word).next().unwrap_or_default();
            assert!(
                known.contains(field),
                "{}: scenario.{field}",
                path.display()
            );
            found += 1;
        }
    }
    assert!(found > 3, "{found} uses");
}

/// Names that changed with contract 3: `tests/data/renames.toml`.
#[test]
fn contract_3_renames_only_the_listed_names() {
    let data = |name: &str| {
        let path = root().join("tests/data").join(name);
        fs::read_to_string(path).expect("test data")
    };
    let renames: toml::Table = data("renames.toml").parse().expect("a table");
    let new_name = |kind: &str, old: &str| {
        let found = renames[kind].as_table().and_then(|table| table.get(old));
        found
            .and_then(toml::Value::as_str)
            .unwrap_or(old)
            .to_owned()
    };
    let contract = fs::read_to_string(root().join("proto/contract.txt")).expect("the contract");
    let now: BTreeSet<&str> = contract.lines().collect();
    let mut used = BTreeSet::new();
    for line in data("contract-2.txt").lines().skip(2) {
        let words: Vec<&str> = line.split(' ').collect();
        let message = words[0];
        let renamed: Vec<String> = words
            .iter()
            .enumerate()
            .map(|(i, word)| {
                let named = match (i, message.strip_prefix("rpc.Simulation.")) {
                    (0, Some(query)) => format!("rpc.Simulation.{}", new_name("queries", query)),
                    (2, None) => {
                        let field = new_name("fields", &format!("{message}.{word}"));
                        let field = field.rsplit('.').next().unwrap_or_default().to_owned();
                        new_name("values", &field)
                    }
                    _ if message.starts_with("topic.") => new_name("values", word),
                    _ => new_name("messages", word),
                };
                if named != *word {
                    used.insert(named.clone());
                }
                named
            })
            .collect();
        let renamed = renamed.join(" ");
        assert!(
            now.contains(renamed.as_str()),
            "{line:?} of contract 2 should be {renamed:?} now; list the new name in tests/data/renames.toml"
        );
    }
    let listed = renames.values().filter_map(toml::Value::as_table);
    for name in listed
        .flat_map(|table| table.values())
        .filter_map(toml::Value::as_str)
    {
        let is_used = used.iter().any(|used| used.ends_with(name));
        assert!(
            is_used,
            "renames.toml lists {name}, which the contract does not use"
        );
    }
}
