//! Words: a unit on every message field, no path of one machine, and no name or size of the
//! default robot outside its folder.

use std::fs;

use super::{files, list, root, run_code};

/// Whether a text contains `word` as a whole word: "Name" does not contain "N".
fn has_word(text: &str, word: &str) -> bool {
    let inside = |c: char| c.is_alphanumeric() || "'_/²".contains(c);
    text.match_indices(word).any(|(at, _)| {
        !text[..at].ends_with(inside) && !text[at + word.len()..].starts_with(inside)
    })
}

#[test]
fn units_are_whole_words() {
    for (text, word, expected) in [
        ("Name of the robot.", "N", false),
        ("Force, N.", "N", true),
        ("Speed, m/s.", "m", false),
        ("Turn acceleration, rad/s².", "rad/s²", true),
        ("Turn acceleration, rad/s².", "s", false),
    ] {
        assert_eq!(has_word(text, word), expected, "{text} {word}");
    }
}

#[test]
fn every_message_field_states_its_unit() {
    let units = [
        "m",
        "metres",
        "millimetres",
        "m/s",
        "m/s²",
        "rad",
        "rad/s",
        "rad/s²",
        "radians",
        "N",
        "N m",
        "kg",
        "Hz",
        "pixels",
        "no unit",
        "ticks",
        "nanoseconds",
        "s",
        "ms",
        "count",
        "bytes",
        "SI",
        "unit of the field",
        "J",
        "0 to 255",
    ];
    let mut bare = Vec::new();
    for path in list("proto/wheelarm", ".proto") {
        let text = fs::read_to_string(&path).expect("a proto file");
        let mut comment = String::new();
        for (i, line) in text.lines().enumerate() {
            let line = line.trim();
            if let Some(words) = line.strip_prefix("//") {
                comment.push_str(words.trim());
                comment.push(' ');
                continue;
            }
            let declares = line.ends_with(';') && line.contains(" = ");
            let value_of_enum = !line.contains(' ')
                || line.chars().next().is_some_and(char::is_uppercase)
                    && line
                        .split(' ')
                        .next()
                        .is_some_and(|w| w.to_uppercase() == w);
            let message = line.split(' ').next().is_some_and(|w| {
                w.chars().next().is_some_and(char::is_uppercase) && w.to_uppercase() != w
            }) || line.starts_with("repeated ")
                && line
                    .split(' ')
                    .nth(1)
                    .is_some_and(|w| w.chars().next().is_some_and(char::is_uppercase));
            let exempt = ["syntax", "package", "option "]
                .iter()
                .any(|start| line.starts_with(start))
                || value_of_enum;
            if declares && !exempt {
                let typed_parts = message && !comment.is_empty();
                if !typed_parts && !units.iter().any(|unit| has_word(&comment, unit)) {
                    bare.push(format!("{}:{} {line}", path.display(), i + 1));
                }
            }
            comment.clear();
        }
    }
    assert!(bare.is_empty(), "fields without unit:\n{}", bare.join("\n"));
}

#[test]
fn no_source_names_a_path_of_one_machine() {
    let mut found = Vec::new();
    for (folder, ending) in [
        ("server", ".rs"),
        ("client", ".rs"),
        ("proto", ".rs"),
        ("assets", ".toml"),
        ("scripts", ".sh"),
        ("tests", ".py"),
    ] {
        let mut paths = Vec::new();
        files(&root().join(folder), ending, &mut paths);
        for path in paths {
            let text = fs::read_to_string(&path).unwrap_or_default();
            for (i, line) in text.lines().enumerate() {
                if ["/home/", "/root/", "/mnt/"]
                    .iter()
                    .any(|p| line.contains(p))
                {
                    found.push(format!("{}:{}", path.display(), i + 1));
                }
            }
        }
    }
    assert!(
        found.is_empty(),
        "paths of one machine:\n{}",
        found.join("\n")
    );
}

/// Words of the contract and of the human body that are also names of the robot's links.
const COMMON: [&str; 6] = [
    "forearm",
    "base_link",
    "wheelchair_root",
    "end_effector_link",
    "end_effector",
    "imu_link",
];

/// Files that may name the default robot: formats of other projects, and the reader of files
/// without a robot description.
const MAY_NAME_THE_ROBOT: [&str; 2] = [
    "client/dataset/src/convert/wheelarm_sim.rs",
    "client/dataset/src/read/robot.rs",
];

/// Everything between two marks in a text.
fn between<'a>(text: &'a str, start: &str, end: &str) -> Vec<&'a str> {
    let parts = text.split(start).skip(1);
    parts.filter_map(|part| part.split(end).next()).collect()
}

/// Decimal numbers in code, without underscores.
fn decimals(text: &str) -> impl Iterator<Item = String> {
    text.split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '_')))
        .filter(|word| word.contains('.') && word.starts_with(|c: char| c.is_ascii_digit()))
        .map(|word| word.replace('_', ""))
}

#[test]
fn no_source_copies_names_or_sizes_of_the_robots() {
    let robots = super::robots();
    let read = |robot: &str, file: &str| {
        let path = root().join("assets/robots").join(robot).join(file);
        fs::read_to_string(path).expect("a file of the robot")
    };
    let text = |robot: &String| {
        let (urdf, toml) = (format!("{robot}.urdf"), "robot.toml");
        (read(robot, &urdf), read(robot, toml))
    };
    let texts: Vec<(String, String)> = robots.iter().map(text).collect();
    let mut known: Vec<&str> = Vec::new();
    for (urdf, toml) in &texts {
        let before = known.len();
        known.extend(between(urdf, "<link name=\"", "\""));
        known.extend(between(urdf, "<joint name=\"", "\""));
        known.extend(between(toml, "name = \"", "\""));
        assert!(known.len() - before > 50, "{} names", known.len() - before);
    }
    known.retain(|name| {
        !COMMON.contains(name) && !robots.iter().any(|robot| robot.as_str() == *name)
    });
    // Unmistakable numbers of the gripper, the chair and the reach, as written in the folder.
    let sizes = [
        "0.085",
        "0.7929",
        "235.0",
        "0.03060114",
        "0.05490452",
        "0.793",
        "0.414",
        "0.496",
        "0.1325",
        "0.2848",
        "0.873",
    ];
    let numbers = texts
        .iter()
        .flat_map(|(urdf, toml)| decimals(urdf).chain(decimals(toml)));
    let numbers: Vec<String> = numbers.collect();
    for size in sizes {
        assert!(
            numbers.iter().any(|number| number == size),
            "{size} is not a number of the robot"
        );
    }
    let mut copied = Vec::new();
    for folder in ["proto", "server/src", "client"] {
        for path in list(folder, ".rs") {
            let path_text = path.strip_prefix(root()).expect("below the root");
            let place = path_text.to_string_lossy().into_owned();
            let exempt = MAY_NAME_THE_ROBOT
                .iter()
                .any(|known| place.starts_with(known));
            let of_tests = ["/tests/", "/examples/"].iter();
            if exempt || of_tests.into_iter().any(|part| place.contains(part)) {
                continue;
            }
            for (line, text) in run_code(&path) {
                let quoted = text.split('"').skip(1).step_by(2);
                let names = quoted
                    .filter(|word| known.contains(word))
                    .map(str::to_owned);
                let numbers = decimals(&text).filter(|number| sizes.contains(&number.as_str()));
                copied.extend(
                    names
                        .chain(numbers)
                        .map(|what| format!("{place}:{line} {what}")),
                );
            }
        }
    }
    assert!(copied.is_empty(), "the robot's own:\n{}", copied.join("\n"));
}
