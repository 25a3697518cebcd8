//! Rules that the compiler cannot see: who may name what, a unit on every
//! message field, no path of one machine.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the workspace")
        .to_owned()
}

fn files(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            files(&path, ending, found);
        } else if path.to_string_lossy().ends_with(ending) {
            found.push(path);
        }
    }
}

fn list(folder: &str, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    files(&root().join(folder), ending, &mut found);
    assert!(!found.is_empty(), "no {ending} below {folder}");
    found
}

/// Lines of a source file that are code, numbered from 1.
fn code(path: &Path) -> Vec<(usize, String)> {
    let text = fs::read_to_string(path).expect("a readable source file");
    let lines = text.lines().enumerate();
    lines
        .map(|(i, line)| {
            (
                i + 1,
                line.split("//").next().unwrap_or_default().to_owned(),
            )
        })
        .collect()
}

fn names(line: &str, crate_name: &str) -> bool {
    line.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'))
        .any(|word| word == crate_name || word.starts_with(&format!("{crate_name}::")))
}

/// `(crate, the only places below server/src that may name it)`.
const WALLS: [(&str, &[&str]); 5] = [
    ("rapier3d", &["world/"]),
    ("wgpu", &["sensors/camera/"]),
    ("zenoh", &["service/", "main.rs"]),
    ("zenoh_ext", &["service/", "main.rs"]),
    ("tokio", &["service/", "main.rs"]),
];

#[test]
fn the_walls_of_the_architecture_stand() {
    let source = root().join("server/src");
    let mut breaches = Vec::new();
    for path in list("server/src", ".rs") {
        let place = path
            .strip_prefix(&source)
            .expect("below src")
            .to_string_lossy()
            .into_owned();
        for (line, text) in code(&path) {
            for (name, allowed) in WALLS {
                let inside = allowed.iter().any(|a| place.starts_with(a));
                if names(&text, name) && !inside {
                    breaches.push(format!("{place}:{line} names {name}"));
                }
            }
            let messages = text.contains("wheelarm_proto::v1") || text.contains("v1::");
            if messages && !place.starts_with("service/") && place != "main.rs" {
                breaches.push(format!("{place}:{line} names messages"));
            }
        }
    }
    assert!(
        breaches.is_empty(),
        "walls are broken:\n{}",
        breaches.join("\n")
    );
}

/// Functions of the C library: other bits on another machine.
const INEXACT: [&str; 22] = [
    "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp",
    "exp2", "exp_m1", "ln", "ln_1p", "log", "log2", "log10", "powf", "cbrt", "hypot",
];

/// Lines of a source file that run in the simulation, not in its tests.
fn run_code(path: &Path) -> Vec<(usize, String)> {
    let name = path.to_string_lossy();
    let test = name.contains("/laws/") || name.ends_with("tests.rs") || name.ends_with("laws.rs");
    let lines = if test { Vec::new() } else { code(path) };
    let run = lines.into_iter();
    run.take_while(|(_, text)| !text.trim().ends_with("mod tests {"))
        .collect()
}

/// Below these paths everything that reaches the state, a draw or a command.
const EXACT: [&str; 12] = [
    "server/src/world",
    "server/src/look",
    "server/src/robot",
    "server/src/sensors",
    "server/src/sim",
    "server/src/tasks",
    "server/src/scene",
    "server/src/geometry",
    "server/src/service",
    "client/operate/src",
    "server/route/src",
    "server/language/src",
    "server/sensor-models/src",
    "client/policy/src",
];

#[test]
fn what_reaches_the_state_computes_the_same_bits_everywhere() {
    let mut found = Vec::new();
    for path in EXACT.iter().flat_map(|folder| list(folder, ".rs")) {
        for (line, text) in run_code(&path) {
            for name in INEXACT {
                let method = text.contains(&format!(".{name}("));
                let called = ["f64", "f32"].iter().any(|number| {
                    let path = format!("{number}::{name}");
                    let after = text.split(&path).nth(1);
                    after.is_some_and(|rest| {
                        !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_')
                    })
                });
                if method || called {
                    found.push(format!("{}:{line} calls {name}", path.display()));
                }
            }
        }
    }
    assert!(
        found.is_empty(),
        "use wheelarm_proto::exact instead:\n{}",
        found.join("\n")
    );
}

/// `clamp` panics when a limit is no number or when limits cross, which a
/// state that went wrong brings about.
#[test]
fn no_clamp_on_limits_that_are_computed() {
    let mut found = Vec::new();
    for path in ["server/src/world", "server/src/robot"]
        .iter()
        .flat_map(|folder| list(folder, ".rs"))
    {
        for (line, text) in run_code(&path) {
            for call in text.split(".clamp(").skip(1) {
                let limits = call.split(')').next().unwrap_or_default();
                let constant = limits.split(',').all(|l| l.trim().parse::<f64>().is_ok());
                // Whoever has a `clamp` of its own takes one thing.
                let own = !limits.is_empty() && !limits.contains(',');
                if !constant && !own {
                    found.push(format!("{}:{line} clamps to {limits:?}", path.display()));
                }
            }
        }
    }
    assert!(
        found.is_empty(),
        "use wheelarm_proto::exact::within instead:\n{}",
        found.join("\n")
    );
}

#[test]
fn no_client_depends_on_the_server() {
    for manifest in list("client", "Cargo.toml") {
        let text = fs::read_to_string(&manifest).expect("a manifest");
        assert!(
            !text.contains("wheelarm-server"),
            "{} names the server",
            manifest.display()
        );
    }
}

/// Packages below `client/` and which of this workspace they may name: no arrow
/// runs up and there is no circle.
const CLIENTS: [(&str, &[&str]); 7] = [
    ("client/link", &["proto"]),
    ("client/policy", &["proto"]),
    ("client/dataset", &["language", "policy", "proto"]),
    ("client/operate", &["link", "proto", "route"]),
    ("client/record", &["dataset", "link", "proto"]),
    ("client/rig", &["link", "proto"]),
    (
        "client",
        &["dataset", "link", "operate", "proto", "record", "rig"],
    ),
];

/// What is pure and computed for the server, or for server and clients alike,
/// names neither, no message, no transport and no renderer.
#[test]
fn the_pure_packages_stand_below_server_and_clients() {
    for folder in ["server/route", "server/language", "server/sensor-models"] {
        for name in dependencies(folder) {
            let ours = name.strip_prefix("wheelarm-");
            let foreign = ["zenoh", "wgpu", "tokio"].contains(&name.as_str());
            assert!(
                ours.is_none_or(|ours| ours == "proto") && !foreign,
                "{folder} names {name}"
            );
        }
        for path in list(&format!("{folder}/src"), ".rs") {
            for (line, text) in code(&path) {
                assert!(
                    !text.contains("v1::"),
                    "{}:{line} names messages",
                    path.display()
                );
            }
        }
    }
}

/// Names of the packages that a manifest depends on.
fn dependencies(folder: &str) -> Vec<String> {
    let manifest = root().join(folder).join("Cargo.toml");
    let text = fs::read_to_string(&manifest).expect("a manifest");
    let lines = text.lines().skip_while(|line| *line != "[dependencies]");
    let lines = lines.skip(1).take_while(|line| !line.starts_with('['));
    lines
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| line.split(['.', ' ']).next().unwrap_or_default().to_owned())
        .collect()
}

#[test]
fn a_client_package_names_only_what_lies_below_it() {
    let found: Vec<String> = list("client", "Cargo.toml")
        .iter()
        .filter_map(|path| path.parent()?.strip_prefix(root()).ok().map(PathBuf::from))
        .map(|folder| folder.to_string_lossy().into_owned())
        .collect();
    for folder in &found {
        let (_, allowed) = CLIENTS
            .iter()
            .find(|(name, _)| name == folder)
            .unwrap_or_else(|| panic!("{folder} is not in the list of client packages"));
        for name in dependencies(folder) {
            let Some(ours) = name.strip_prefix("wheelarm-") else {
                continue;
            };
            assert!(allowed.contains(&ours), "{folder} names wheelarm-{ours}");
        }
    }
    assert_eq!(found.len(), CLIENTS.len(), "{found:?}");
}

/// What `make demo` runs: the programs of a user, and nothing that tests them.
#[test]
fn what_is_built_without_asking_is_what_the_demo_runs() {
    let text = fs::read_to_string(root().join("Cargo.toml")).expect("a manifest");
    let line = text
        .lines()
        .find_map(|l| l.strip_prefix("default-members = "));
    assert_eq!(line, Some(r#"["server", "client", "client/dataset"]"#));
    let make = fs::read_to_string(root().join("Makefile")).expect("a Makefile");
    let build = make.split("\nbuild:\n").nth(1).expect("a target");
    let build = build.split("\n\n").next().unwrap_or_default();
    assert!(!build.contains("--workspace"), "{build}");
    // Each of them has a program, and no other package of a user has one.
    for package in ["server", "client", "client/dataset"] {
        assert!(
            root().join(package).join("src/main.rs").is_file(),
            "{package}"
        );
    }
    for (package, _) in CLIENTS {
        let is_program = root().join(package).join("src/main.rs").is_file();
        assert_eq!(is_program, ["client", "client/dataset"].contains(&package));
    }
}

/// Packages without which the thin client is built: its features bring them.
#[test]
fn a_thin_client_needs_no_hdf5_and_no_terminal() {
    let text = fs::read_to_string(root().join("client/Cargo.toml")).expect("a manifest");
    for name in ["hdf5", "ratatui", "wheelarm-dataset", "wheelarm-record"] {
        let line = format!("{name} = {{ workspace = true, optional = true }}");
        assert!(text.contains(&line), "{name} is not optional");
    }
    for package in ["client/link", "client/operate", "client/rig"] {
        for name in dependencies(package) {
            let heavy = ["hdf5", "ratatui", "clap", "wheelarm-dataset"];
            assert!(!heavy.contains(&name.as_str()), "{package} names {name}");
        }
    }
}

/// What `wheelarm-link` may be built with: proto, zenoh, and small crates.
const LINK: [&str; 10] = [
    "bytes",
    "parking_lot",
    "prost",
    "serde_json",
    "thiserror",
    "tokio",
    "tracing",
    "wheelarm-proto",
    "zenoh",
    "zenoh-ext",
];
/// Calls that only Unix has.
const UNIX: [&str; 7] = [
    "os::unix",
    "os::fd",
    "signal::unix",
    "libc",
    "rustix",
    "\"/proc",
    "\"/tmp",
];

#[test]
fn a_foreign_client_needs_proto_and_zenoh_alone_and_no_unix() {
    for name in dependencies("client/link") {
        assert!(LINK.contains(&name.as_str()), "wheelarm-link needs {name}");
    }
    let mut found = Vec::new();
    for path in list("client/link/src", ".rs") {
        for (line, text) in code(&path) {
            for call in UNIX.iter().filter(|call| text.contains(**call)) {
                found.push(format!("{}:{line} names {call}", path.display()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn every_message_field_says_its_unit() {
    let units = [
        "metres",
        "m/s",
        "rad",
        "N",
        "kg",
        "Hz",
        "pixels",
        "no unit",
        "ticks",
        "nanoseconds",
        " s.",
        " s,",
        "count",
        "bytes",
        "SI",
        "unit of the field",
        " J.",
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
                if !typed_parts && !units.iter().any(|u| comment.contains(u)) {
                    bare.push(format!("{}:{} {line}", path.display(), i + 1));
                }
            }
            comment.clear();
        }
    }
    assert!(bare.is_empty(), "fields without unit:\n{}", bare.join("\n"));
}

#[test]
fn nothing_names_a_path_of_one_machine() {
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

/// Words of the contract that happen to be names of the robot's links, too.
const COMMON: [&str; 5] = [
    "base_link",
    "wheelchair_root",
    "end_effector_link",
    "end_effector",
    "imu_link",
];

/// Where the robot that ships may be known by name: formats of others, and what
/// reads files that do not tell their robot.
const KNOW_THE_ROBOT: [&str; 2] = [
    "client/dataset/src/convert/wheelarm_sim.rs",
    "client/dataset/src/read/robot.rs",
];

/// Everything between two marks in a text.
fn between<'a>(text: &'a str, start: &str, end: &str) -> Vec<&'a str> {
    let parts = text.split(start).skip(1);
    parts.filter_map(|part| part.split(end).next()).collect()
}

/// Numbers with a point as they stand in code, without their underscores.
fn decimals(text: &str) -> impl Iterator<Item = String> {
    text.split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '_')))
        .filter(|word| word.contains('.') && word.starts_with(|c: char| c.is_ascii_digit()))
        .map(|word| word.replace('_', ""))
}

#[test]
fn the_robot_is_told_and_not_copied() {
    let folder = root().join("assets/robots/wheelarm");
    let read = |file: &str| fs::read_to_string(folder.join(file)).expect("a file of the robot");
    let (urdf, toml) = (read("wheelarm.urdf"), read("robot.toml"));
    let mut known: Vec<&str> = between(&urdf, "<link name=\"", "\"");
    known.extend(between(&urdf, "<joint name=\"", "\""));
    known.extend(between(&toml, "name = \"", "\""));
    known.retain(|name| !COMMON.contains(name) && *name != "wheelarm");
    assert!(known.len() > 50, "{} names", known.len());
    // Numbers of the gripper, of the chair and of the reach that could be nothing
    // else, as they stand in the folder.
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
    let told: Vec<String> = decimals(&urdf).chain(decimals(&toml)).collect();
    for size in sizes {
        assert!(
            told.iter().any(|number| number == size),
            "{size} is no number of the robot"
        );
    }
    let mut copied = Vec::new();
    for folder in ["proto", "server/src", "client"] {
        for path in list(folder, ".rs") {
            let path_text = path.strip_prefix(root()).expect("below the root");
            let place = path_text.to_string_lossy().into_owned();
            let exempt = KNOW_THE_ROBOT.iter().any(|known| place.starts_with(known));
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

/// Rooms and pairs below server/src whose files name each other, on purpose.
const CIRCLES: [(&str, &str); 3] = [
    // One world in files by what they do to it.
    ("world", "world"),
    // A parent with the type, a child with some of what it does.
    ("sim", "sim::guard"),
    ("robot::control", "robot::control::arm"),
];

/// Paths behind `crate::`, `super::` and `self::`, groups in braces taken apart.
fn named_paths(text: &str) -> Vec<String> {
    fn tree(text: &str, before: &str, found: &mut Vec<String>) -> usize {
        let word = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
        let end = text.find(|c| !word(c)).unwrap_or(text.len());
        let path = format!("{before}{}", &text[..end]);
        if !path.ends_with("::") || !text[end..].starts_with('{') {
            found.push(path);
            return end;
        }
        let mut at = end + 1;
        while at < text.len() && !text[at..].starts_with('}') {
            let gap = text[at..].find(|c: char| c != ',' && !c.is_whitespace());
            at += gap.unwrap_or(0);
            if text[at..].starts_with('}') {
                break;
            }
            at += tree(&text[at..], &path, found).max(1);
        }
        at + 1
    }
    let mut found = Vec::new();
    for start in ["crate::", "super::", "self::"] {
        for (at, _) in text.match_indices(start) {
            let inside = text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
            let middle = text[..at].ends_with("super::") || text[..at].ends_with("self::");
            // What is handed on is not used here; `pub(in crate::…)` is no use.
            let line = text[..at].rsplit(['\n', ';']).next().unwrap_or_default();
            let handed_on = line.trim_start().starts_with("pub") && line.ends_with("use ");
            let visibility = text[..at].ends_with("(in ");
            if !inside && !middle && !handed_on && !visibility {
                tree(&text[at..], "", &mut found);
            }
        }
    }
    found
}

/// The module that a path names from `from`: the longest one that there is.
fn module_named(path: &str, from: &str, modules: &BTreeSet<String>) -> String {
    let mut here: Vec<&str> = from.split("::").filter(|s| !s.is_empty()).collect();
    for (i, part) in path.split("::").enumerate() {
        match part {
            "crate" if i == 0 => here.clear(),
            "self" => {}
            "super" => {
                here.pop();
            }
            part => {
                let longer = [&here[..], &[part]].concat().join("::");
                if !modules.contains(&longer) {
                    break;
                }
                here.push(part);
            }
        }
    }
    here.join("::")
}

/// Paths that begin with a module's own child, as the module itself names it:
/// `child::Thing` without `self::`.
fn paths_of_children(text: &str, module: &str, modules: &BTreeSet<String>) -> Vec<String> {
    let mut found = Vec::new();
    for child in modules {
        let Some((parent, name)) = child.rsplit_once("::") else {
            continue;
        };
        if parent != module {
            continue;
        }
        for (at, _) in text.match_indices(&format!("{name}::")) {
            let inside = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            if !text[..at].ends_with(inside) {
                // Asked like any other path, so that what is handed on is not used.
                let line = text[..at].rsplit(['\n', ';']).next().unwrap_or_default();
                let rest = text[at..].split(';').next().unwrap_or_default();
                found.extend(named_paths(&format!("{line}self::{rest}")));
            }
        }
    }
    found
}

/// What each file below `folder` names of the other files there.
fn arrows(folder: &str) -> BTreeMap<String, BTreeSet<String>> {
    let source = root().join(folder);
    let texts: BTreeMap<String, String> = list(folder, ".rs")
        .into_iter()
        .filter_map(|path| {
            let place = path.strip_prefix(&source).expect("below src");
            let name = place
                .with_extension("")
                .to_string_lossy()
                .replace('/', "::");
            let lines: Vec<String> = run_code(&path).into_iter().map(|(_, line)| line).collect();
            let name = name.strip_suffix("::mod").unwrap_or(&name).to_owned();
            let top = ["main", "lib"].contains(&name.as_str());
            (!top).then(|| (name, lines.join("\n")))
        })
        .collect();
    let modules: BTreeSet<String> = texts.keys().cloned().collect();
    texts
        .iter()
        .map(|(name, text)| {
            let own = paths_of_children(text, name, &modules);
            let named = named_paths(text).into_iter().chain(own);
            let named = named.map(|path| module_named(&path, name, &modules));
            let others = named.filter(|other| !other.is_empty() && other != name);
            (name.clone(), others.collect())
        })
        .collect()
}

/// The first part of a module's path.
fn room(module: &str) -> &str {
    module.split("::").next().unwrap_or_default()
}

/// Leaves of the arrows only what is in a circle, or behind one.
fn circles(mut arrows: BTreeMap<String, BTreeSet<String>>) -> BTreeMap<String, BTreeSet<String>> {
    // Whoever names nobody who is left is in no circle.
    loop {
        let before = arrows.len();
        let left: BTreeSet<String> = arrows.keys().cloned().collect();
        arrows.retain(|_, named| named.iter().any(|other| left.contains(other)));
        if arrows.len() == before {
            break;
        }
    }
    let left: BTreeSet<String> = arrows.keys().cloned().collect();
    for named in arrows.values_mut() {
        named.retain(|other| left.contains(other));
    }
    arrows
}

/// Packages of the clients whose files name each other in one direction; those
/// of the dataset crate are held to an order below.
const STRAIGHT: [&str; 5] = [
    "client/link/src",
    "client/operate/src",
    "client/record/src",
    "client/rig/src",
    "client/src",
];

#[test]
fn files_of_the_clients_do_not_name_each_other_in_circles() {
    let rig = arrows("client/rig/src");
    assert!(
        rig["server"].contains("process"),
        "arrows are seen: {rig:?}"
    );
    let teleop = &arrows("client/src")["teleop"];
    assert!(
        teleop.contains("teleop::run"),
        "children are seen: {teleop:?}"
    );
    for folder in STRAIGHT {
        let left = circles(arrows(folder));
        assert!(left.is_empty(), "circles among or behind: {left:#?}");
    }
}

#[test]
fn files_of_a_room_of_the_server_do_not_name_each_other_in_circles() {
    let mut arrows = arrows("server/src");
    assert!(arrows.len() > 100, "{} files", arrows.len());
    for (name, named) in &mut arrows {
        named.retain(|other| room(other) == room(name));
    }
    for (first, second) in CIRCLES {
        let allowed = |name: &str| name.starts_with(first) && second == first || name == second;
        for (name, named) in &mut arrows {
            if name == first || allowed(name) {
                named.retain(|other| other != first && !allowed(other));
            }
        }
    }
    let left = circles(arrows);
    assert!(left.is_empty(), "circles among or behind: {left:#?}");
}

/// Rooms of the dataset crate, from the bottom up: each names only rooms below
/// it. So reading knows nothing of exports, and the table of columns nothing of
/// files.
const DATASET: [&str; 28] = [
    "pose",
    "coverage",
    "ending",
    "compress",
    "depth",
    "ids",
    "calibration",
    "publish",
    "scenario_text",
    "columns",
    "hdf",
    "urdf",
    "log",
    "account",
    "writer",
    "read",
    "finish",
    "info",
    "align",
    "label",
    "annotate",
    "sheet",
    "convert",
    "plot",
    "composition",
    "validate",
    "view",
    "commands",
];

/// Rooms of the dataset crate that may name HDF5.
const NAME_HDF5: [&str; 6] = ["hdf", "read", "finish", "align", "annotate", "convert"];

#[test]
fn files_of_the_dataset_crate_name_only_what_lies_below_them() {
    let arrows = arrows("client/dataset/src");
    assert!(arrows.len() > 80, "{} files", arrows.len());
    let height = |module: &str| {
        let found = DATASET.iter().position(|name| *name == room(module));
        found.unwrap_or_else(|| panic!("{module} is not in the list of rooms"))
    };
    for (name, named) in &arrows {
        for other in named.iter().filter(|other| room(other) != room(name)) {
            assert!(height(other) < height(name), "{name} names {other}");
        }
    }
    let left = circles(arrows);
    assert!(left.is_empty(), "circles among or behind: {left:#?}");
    let source = root().join("client/dataset/src");
    for path in list("client/dataset/src", ".rs") {
        let place = path.strip_prefix(&source).expect("below src");
        let room = place.components().next().expect("a room").as_os_str();
        let room = room.to_string_lossy();
        let room = room.trim_end_matches(".rs");
        for (line, text) in code(&path) {
            let inside = NAME_HDF5.contains(&room);
            let wrapped = names(&text, "hdf5_sys") && room != "hdf";
            assert!(
                (inside || !names(&text, "hdf5")) && !wrapped,
                "{}:{line} names HDF5",
                place.display()
            );
        }
    }
}

#[test]
fn paths_in_braces_are_taken_apart() {
    let text = "pub use self::c;\nuse crate::a::{self, b::{C, D}, e};\nsuper::f::g();";
    let mut found = named_paths(text);
    found.sort();
    assert_eq!(
        found,
        [
            "crate::a::b::C",
            "crate::a::b::D",
            "crate::a::e",
            "crate::a::self",
            "super::f::g"
        ]
    );
}
