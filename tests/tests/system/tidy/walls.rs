//! Dependencies: crates that a module of the server may name, packages that a package may name,
//! and functions whose bits differ between machines.

use std::fs;
use std::path::PathBuf;

use super::{code, list, names, root, run_code};

/// `(crate, the only places below server/src that may name it)`.
const WALLS: [(&str, &[&str]); 5] = [
    ("rapier3d", &["world/"]),
    ("wgpu", &["sensors/camera/"]),
    ("zenoh", &["service/", "main.rs"]),
    ("zenoh_ext", &["service/", "main.rs"]),
    ("tokio", &["service/", "main.rs"]),
];

#[test]
fn modules_of_the_server_name_only_their_crates() {
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

/// Functions of the C library, whose bits differ between machines.
const INEXACT: [&str; 22] = [
    "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp",
    "exp2", "exp_m1", "ln", "ln_1p", "log", "log2", "log10", "powf", "cbrt", "hypot",
];

/// Folders whose code computes states, sampled values or commands.
const EXACT: [&str; 17] = [
    "server/src/world",
    "server/src/appearance",
    "server/src/robot",
    "server/src/sensors",
    "server/src/sim",
    "server/src/tasks",
    "server/src/scene",
    "server/src/geometry",
    "server/src/service",
    "client/expert/src",
    "client/import/src",
    "proto/homes/src",
    "proto/pack/src",
    "proto/planning/src",
    "proto/language/src",
    "server/sensor-models/src",
    "client/policy/src",
];

#[test]
fn code_of_states_and_commands_calls_no_inexact_function() {
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

/// `clamp` panics when a limit is NaN or when limits cross, which a broken state can cause.
#[test]
fn computed_limits_are_not_used_with_clamp() {
    let mut found = Vec::new();
    for path in ["server/src/world", "server/src/robot"]
        .iter()
        .flat_map(|folder| list(folder, ".rs"))
    {
        for (line, text) in run_code(&path) {
            for call in text.split(".clamp(").skip(1) {
                let limits = call.split(')').next().unwrap_or_default();
                let constant = limits.split(',').all(|l| l.trim().parse::<f64>().is_ok());
                // Our own `clamp` methods have one argument.
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

/// The program that runs server and clients in one process.
const WORKER: &str = "client/rollout/worker/Cargo.toml";

#[test]
fn no_client_depends_on_the_server() {
    for manifest in list("client", "Cargo.toml") {
        if manifest.ends_with(WORKER) {
            continue;
        }
        let text = fs::read_to_string(&manifest).expect("a manifest");
        assert!(
            !text.contains("wheelarm-server"),
            "{} names the server",
            manifest.display()
        );
    }
}

/// Cargo ignores a patched crate of another version, with a warning only.
#[test]
fn tls_links_use_the_patched_crate() {
    let lock = fs::read_to_string(root().join("Cargo.lock")).expect("a lock");
    let packages: Vec<&str> = lock.split("[[package]]").collect();
    let links = packages
        .iter()
        .filter(|package| package.contains("name = \"zenoh-link-tls\""));
    let links: Vec<_> = links.collect();
    assert_eq!(links.len(), 1);
    assert!(!links[0].contains("source ="), "{}", links[0]);
    assert!(!lock.contains("[[patch.unused]]"));
}

/// Only the worker depends on both server and clients; only tests name it.
#[test]
fn no_package_depends_on_the_worker() {
    for folder in ["server", "client", "proto"] {
        for manifest in list(folder, "Cargo.toml") {
            if manifest.ends_with(WORKER) {
                continue;
            }
            let text = fs::read_to_string(&manifest).expect("a manifest");
            assert!(!text.contains("wheelarm-worker"), "{}", manifest.display());
        }
    }
    let below = dependencies("client/rollout/worker");
    for name in ["wheelarm-server", "wheelarm-recorder", "wheelarm-expert"] {
        assert!(below.iter().any(|below| below == name), "{below:?}");
    }
    assert!(
        below
            .iter()
            .all(|name| name != "wheelarm-cli" && name != "wheelarm-campaign")
    );
}

/// Packages below `client/`, and the packages of this workspace that each may name. Each names
/// only lower ones, which prevents circles.
const CLIENTS: [(&str, &[&str]); 14] = [
    ("client/sdk", &["proto"]),
    ("client/policy", &["proto"]),
    ("client/options", &["proto", "sdk"]),
    (
        "client/dataset",
        &["codec", "language", "pack", "policy", "proto"],
    ),
    ("client/expert", &["planning", "proto", "sdk"]),
    ("client/import", &["homes", "pack", "planning", "proto"]),
    ("client/learn", &["policy", "proto", "sdk"]),
    ("client/recorder", &["dataset", "proto", "sdk"]),
    ("client/rollout", &["expert", "policy", "proto", "sdk"]),
    (
        "client/rollout/worker",
        &[
            "dataset", "expert", "pack", "proto", "recorder", "rollout", "sdk", "server",
        ],
    ),
    (
        "client/teleop/web",
        &["access", "expert", "planning", "proto", "sdk"],
    ),
    (
        "client/teleop/terminal",
        &["options", "proto", "sdk", "teleop-web"],
    ),
    (
        "client/campaign",
        &[
            "dataset", "expert", "homes", "options", "pack", "policy", "proto", "rollout", "sdk",
        ],
    ),
    (
        "client/cli",
        &[
            "access",
            "campaign",
            "expert",
            "homes",
            "import",
            "options",
            "pack",
            "proto",
            "recorder",
            "rollout",
            "sdk",
            "teleop-terminal",
            "teleop-web",
        ],
    ),
];

/// Users and keys are below server and clients and open no connection.
#[test]
fn access_opens_no_connection() {
    for name in dependencies("proto/access") {
        let ours = name.strip_prefix("wheelarm-");
        let foreign = ["rapier3d", "wgpu", "tokio", "zenoh"].contains(&name.as_str());
        let allowed = ours.is_none_or(|ours| ours == "proto") && !foreign;
        assert!(allowed, "proto/access names {name}");
    }
}

/// Packages of pure functions name neither server nor clients, no message, no transport and no
/// renderer.
#[test]
fn pure_packages_are_below_server_and_clients() {
    for (folder, lower) in [
        ("proto/codec", &[][..]),
        ("proto/homes", &["pack", "planning"]),
        ("proto/pack", &[]),
        ("proto/planning", &[]),
        ("proto/language", &[]),
        ("server/sensor-models", &[]),
    ] {
        for name in dependencies(folder) {
            let ours = name.strip_prefix("wheelarm-");
            let foreign = ["zenoh", "wgpu", "tokio"].contains(&name.as_str());
            assert!(
                ours.is_none_or(|ours| ours == "proto" || lower.contains(&ours)) && !foreign,
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
fn client_packages_name_only_lower_ones() {
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

/// `make unit-suites` names the programs with tests of their own; the others declare that they
/// have none.
#[test]
fn unit_suites_name_every_program_with_tests() {
    let make = fs::read_to_string(root().join("Makefile")).expect("a Makefile");
    let suites = make.split("\nunit-suites:\n").nth(1).expect("a target");
    let suites = suites.split("\n\n").next().unwrap_or_default();
    let words: Vec<&str> = suites.split_whitespace().collect();
    let mut named = 0;
    for folder in ["server", "client", "proto", "tests"] {
        for manifest in list(folder, "Cargo.toml") {
            let is_separate = ["client/learn", "tests/fuzz"]
                .iter()
                .any(|other| manifest.starts_with(root().join(other)));
            let text = fs::read_to_string(&manifest).expect("a manifest");
            let table: toml::Table = text.parse().expect("TOML");
            let programs = table.get("bin").and_then(toml::Value::as_array);
            let declared = programs.map_or(&[][..], Vec::as_slice);
            let package = manifest.parent().expect("a folder");
            let is_implicit = declared.is_empty() && package.join("src/main.rs").exists();
            assert!(!is_implicit, "{} declares no [[bin]]", manifest.display());
            for program in declared.iter().filter(|_| !is_separate) {
                let is_tested = program.get("test").and_then(toml::Value::as_bool) != Some(false);
                let name = program["name"].as_str().expect("a name");
                let is_named = words.windows(2).any(|pair| pair == ["--bin", name]);
                assert_eq!(is_tested, is_named, "{name} in `make unit-suites`");
                named += usize::from(is_named);
            }
        }
    }
    assert!(named > 0, "no program with tests");
}

/// The default members are the programs of `make demo`, without tests.
#[test]
fn default_members_are_the_programs_of_the_demo() {
    let text = fs::read_to_string(root().join("Cargo.toml")).expect("a manifest");
    let line = text
        .lines()
        .find_map(|l| l.strip_prefix("default-members = "));
    assert_eq!(
        line,
        Some(r#"["server", "client/cli", "client/dataset", "client/rollout/worker"]"#)
    );
    let make = fs::read_to_string(root().join("Makefile")).expect("a Makefile");
    let build = make.split("\nbuild:\n").nth(1).expect("a target");
    let build = build.split("\n\n").next().unwrap_or_default();
    assert!(!build.contains("--workspace"), "{build}");
    // Each of them has a program, and of the other client packages only `client/learn`, which is
    // built separately.
    for package in [
        "server",
        "client/cli",
        "client/dataset",
        "client/rollout/worker",
    ] {
        assert!(
            root().join(package).join("src/main.rs").is_file(),
            "{package}"
        );
    }
    for (package, _) in CLIENTS {
        let is_program = root().join(package).join("src/main.rs").is_file();
        let programs = [
            "client/cli",
            "client/dataset",
            "client/learn",
            "client/rollout/worker",
        ];
        assert_eq!(is_program, programs.contains(&package));
    }
}

/// The thin client is built without these packages: they belong to optional features.
#[test]
fn thin_client_needs_neither_hdf5_nor_a_terminal() {
    let text = fs::read_to_string(root().join("client/cli/Cargo.toml")).expect("a manifest");
    for name in [
        "hdf5",
        "wheelarm-campaign",
        "wheelarm-recorder",
        "wheelarm-teleop-terminal",
    ] {
        let line = format!("{name} = {{ workspace = true, optional = true }}");
        assert!(text.contains(&line), "{name} is not optional");
    }
    for package in ["client/sdk", "client/expert", "client/rollout"] {
        for name in dependencies(package) {
            let heavy = ["hdf5", "ratatui", "clap", "wheelarm-dataset"];
            assert!(!heavy.contains(&name.as_str()), "{package} names {name}");
        }
    }
}

/// Crates that `wheelarm-sdk` may depend on: proto, zenoh, and small crates.
const SDK: [&str; 10] = [
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
/// Interfaces that only Unix has.
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
fn sdk_depends_on_proto_and_zenoh_and_not_on_unix() {
    for name in dependencies("client/sdk") {
        assert!(SDK.contains(&name.as_str()), "wheelarm-sdk needs {name}");
    }
    let mut found = Vec::new();
    for path in list("client/sdk/src", ".rs") {
        for (line, text) in code(&path) {
            for call in UNIX.iter().filter(|call| text.contains(**call)) {
                found.push(format!("{}:{line} names {call}", path.display()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// A name has one meaning: no command module shares its name with a crate.
#[test]
fn no_command_module_has_the_name_of_a_crate() {
    let crates: Vec<String> = ["proto", "server", "client"]
        .iter()
        .flat_map(|folder| list(folder, "Cargo.toml"))
        .filter_map(|path| fs::read_to_string(path).ok())
        .filter_map(|text| {
            let name = text.split("name = \"wheelarm-").nth(1)?;
            Some(name.split('"').next()?.replace('-', "_"))
        })
        .collect();
    assert!(crates.len() > 15, "{crates:?}");
    for folder in ["client/cli/src", "client/campaign/src"] {
        for path in list(folder, ".rs") {
            let place = path.strip_prefix(root().join(folder)).expect("below src");
            let first = place.components().next().expect("a file").as_os_str();
            let first = first.to_string_lossy();
            let module = first.trim_end_matches(".rs");
            assert!(
                !crates.iter().any(|name| name == module),
                "{folder}/{first} has the name of the crate wheelarm-{module}; rename the module"
            );
        }
    }
}
