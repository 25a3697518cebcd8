//! The command line as a newcomer meets it: what the help lists, and mistakes whose answers name
//! the fix.

use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

use wheelarm_tests::{printed, program, root};

/// A mistake: command line, and parts of the answer. `FREE` and `BUSY` are ports.
type Mistake = (&'static str, &'static [&'static str]);

/// Commands and their options.
const WORDS: &[Mistake] = &[
    (
        "wheelarm",
        &["Usage: wheelarm", "Run a simulation:", "  demo"],
    ),
    ("wheelarm evalute", &["did you mean `wheelarm evaluate`?"]),
    (
        "wheelarm recrod --out data",
        &["did you mean `wheelarm record`?"],
    ),
    (
        "wheelarm import mug.glb",
        &[
            "`wheelarm object import MESH`",
            "`wheelarm home import FILE.sh3d`",
        ],
    ),
    (
        "wheelarm export --format lerobot data",
        &["use `wheelarm dataset export`"],
    ),
    ("wheelarm serve", &["use `wheelarm server`"]),
    (
        "wheelarm train --task pick_mustard",
        &["`wheelarm collect`", "`wheelarm evaluate --policy`"],
    ),
    (
        "wheelarm fly",
        &[
            "no command `wheelarm fly`",
            "`wheelarm --help` lists the commands",
        ],
    ),
    ("wheelarm home imprt flat.sh3d", &["'import'"]),
    ("wheelarm dataset exprt data", &["'export'"]),
    ("wheelarm demo --sead 3", &["'--seed'"]),
    ("wheelarm demo --seeds 5", &["write 0..5"]),
    ("wheelarm evaluate --seeds 5..2", &["write 2..5"]),
    (
        "wheelarm demo --seed three",
        &["--seed", "'three'", "invalid digit"],
    ),
    (
        "wheelarm demo --seed 3 --seeds 0..3",
        &["cannot be used with"],
    ),
    ("wheelarm demo --camera 640", &["NAME=WIDTHxHEIGHT@HZ"]),
    ("wheelarm episode start", &["--label"]),
    ("wheelarm new objct my_mug", &["'object'"]),
    ("wheelarm new object MyMug", &["lower-case"]),
    ("wheelarm completions tcsh", &["bash", "zsh", "fish"]),
    ("wheelarm watch --interval 0", &["from 0.1 to 1000000"]),
    ("wheelarm preview --page 7450", &["ADDRESS:PORT"]),
    (
        "wheelarm demo --connect tcp/127.0.0.1:FREE",
        &["starts its own servers: omit --connect"],
    ),
    (
        "wheelarm users add anna --role driver --keys keys",
        &["operator", "viewer"],
    ),
    ("wheelarm users list", &["--keys"]),
    (
        "wheelarm dataset export --format lerbot data --out x",
        &["'lerobot'"],
    ),
    ("wheelarm dataset export --format lerobot data", &["--out"]),
    (
        "wheelarm multiply data --task pick_mustard --episodes 3",
        &["--out"],
    ),
    (
        "wheelarm collect",
        &["wheelarm collect [OPTIONS] <PLAN>", "--merge"],
    ),
    ("wheelarm collect plan.toml --shard 3/2", &["0/N to N-1/N"]),
    (
        "wheelarm evaluate --policy openvla",
        &["exec:COMMAND", "lerobot:DIR"],
    ),
];

/// Servers and ports.
const SERVERS: &[Mistake] = &[
    (
        "wheelarm --connect tcp/127.0.0.1:FREE status",
        &["`wheelarm-server`", "--connect", "FREE"],
    ),
    (
        "wheelarm --connect tcp/127.0.0.1:FREE record --out data",
        &["start one with `wheelarm-server`"],
    ),
    (
        "wheelarm --connect tcp/127.0.0.1:FREE drive",
        &["start one with `wheelarm-server`"],
    ),
    (
        "wheelarm --connect tcp/127.0.0.1:FREE operate --task pick_mustard",
        &["start one with `wheelarm-server`"],
    ),
    (
        "wheelarm --connect 127.0.0.1:7447 status",
        &["tcp/HOST:PORT"],
    ),
    (
        "wheelarm --connect tls/sim-host:7447 --keys nowhere status",
        &["nowhere", "--keys"],
    ),
    (
        "wheelarm-server --no-cameras --listen tcp/127.0.0.1:BUSY",
        &["BUSY", "in use", "--listen"],
    ),
    (
        "wheelarm-server --no-cameras --listen tcp/0.0.0.0:0",
        &["--keys", "--insecure"],
    ),
    (
        "wheelarm-server --listen tcp/127.0.0.1:0 --adapter nosuch",
        &["nosuch", "available"],
    ),
];

/// Names of tasks, scenes, objects and homes.
const NAMES: &[Mistake] = &[
    (
        "wheelarm demo --task pick_mustrd",
        &["did you mean pick_mustard?"],
    ),
    ("wheelarm demo --scene hom", &["did you mean home?"]),
    ("wheelarm demo --robot wheelrm", &["available: wheelarm"]),
    (
        "wheelarm evaluate --task pick_mustrd --seeds 0..1 --out results",
        &["did you mean pick_mustard?"],
    ),
    (
        "wheelarm-server --no-cameras --listen tcp/127.0.0.1:0 --task pick_mustrd",
        &["did you mean pick_mustard?"],
    ),
    (
        "wheelarm-server --no-cameras --listen tcp/127.0.0.1:0 --scene hom",
        &["did you mean home?"],
    ),
    (
        "wheelarm collect task.toml",
        &["task.toml:", "did you mean pick_mustard?"],
    ),
    (
        "wheelarm collect key.toml",
        &["key.toml", "episode", "expected one of"],
    ),
    ("wheelarm home make studo", &["did you mean studio?"]),
    (
        "wheelarm home report nowhere",
        &["no pack \"nowhere\"", "wheelarm home import"],
    ),
    (
        "wheelarm object check mug",
        &["wheelarm object import", "--packs"],
    ),
    (
        "wheelarm object import mug.obj --category mugg",
        &["did you mean mug?"],
    ),
];

/// Files and folders.
const FILES: &[Mistake] = &[
    (
        "wheelarm collect nowhere.toml",
        &["nowhere.toml", "assets/campaigns/small.toml"],
    ),
    (
        "wheelarm replay nowhere.h5",
        &["nowhere.h5", "the file does not exist"],
    ),
    (
        "wheelarm replay notes.h5",
        &["notes.h5", "not a WheelArm episode"],
    ),
    (
        "wheelarm dataset info nowhere.h5",
        &["nowhere.h5", "does not exist"],
    ),
    (
        "wheelarm dataset validate empty",
        &["empty", "name recordings, or a folder with some"],
    ),
    (
        "wheelarm multiply empty --task pick_mustard --episodes 1 --out more",
        &["empty", "record some that succeed"],
    ),
    (
        "wheelarm evaluate --policy act:nowhere.safetensors --seeds 0..1 --out results",
        &["nowhere.safetensors does not exist"],
    ),
    (
        "wheelarm evaluate compare empty empty",
        &["empty", "wheelarm evaluate"],
    ),
    ("wheelarm demo --out notes.h5/demo", &["--out DIR"]),
    ("wheelarm demo --assets empty", &["empty", "--assets"]),
    (
        "wheelarm object import nowhere.glb --category mug",
        &["nowhere.glb"],
    ),
    (
        "wheelarm object import mug.ply --category mug",
        &["export it as GLB"],
    ),
    (
        "wheelarm home import notes.h5",
        &["notes.h5", "Sweet Home 3D"],
    ),
    ("wheelarm pack check empty", &["empty", "pack.toml"]),
    ("wheelarm new object taken", &["taken", "exists"]),
];

/// Files that the mistakes use.
fn prepare(folder: &Path) {
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("a file");
    let plan = std::fs::read_to_string(root().join("assets/campaigns/small.toml"));
    let plan = plan.expect("the plan");
    assert!(
        plan.contains("\"pick_mustard\"") && plan.contains("\nepisodes"),
        "{plan}"
    );
    write("plan.toml", &plan);
    write(
        "task.toml",
        &plan.replacen("\"pick_mustard\"", "\"pick_mustrd\"", 1),
    );
    write("key.toml", &plan.replacen("\nepisodes", "\nepisode", 1));
    write("notes.h5", "notes\n");
    write("mug.ply", "ply\n");
    write("mug.obj", "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n");
    for name in ["empty", "taken", "packs"] {
        std::fs::create_dir(folder.join(name)).expect("a folder");
    }
}

fn run(folder: &Path, line: &str) -> Output {
    let mut words = line.split_whitespace();
    let name = words.next().expect("a program");
    let mut command = Command::new(program(name).expect("the program"));
    for (variable, _) in std::env::vars().filter(|(name, _)| name.starts_with("WHEELARM_")) {
        command.env_remove(variable);
    }
    command.args(words).current_dir(folder);
    command.env("WHEELARM_ASSETS", root().join("assets"));
    command.env("WHEELARM_PACKS", folder.join("packs"));
    command.output().expect("a process")
}

/// What is wrong with the answer to a mistake; empty when it names the fix.
fn judge(folder: &Path, line: &str, fix: &[String]) -> String {
    let output = run(folder, line);
    let text = printed(&output);
    let missing: Vec<&String> = fix.iter().filter(|part| !text.contains(*part)).collect();
    let inner = ["/registry/", "panicked", ".rs:", "Traceback"];
    let inner: Vec<&str> = inner
        .into_iter()
        .filter(|part| text.contains(part))
        .collect();
    match output.status.code() {
        Some(1 | 2) if missing.is_empty() && inner.is_empty() => String::new(),
        code => format!("{line}\n  exit {code:?}, lacks {missing:?}, shows {inner:?}\n{text}\n"),
    }
}

/// Texts of all entries, joined; three threads, because processes wait for files.
fn in_parallel<T: Sync>(all: &[T], work: impl Fn(&T) -> String + Sync) -> String {
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        let some = || {
            let entries = std::iter::from_fn(|| all.get(next.fetch_add(1, Ordering::Relaxed)));
            entries.map(&work).collect::<String>()
        };
        let workers = [(); 3].map(|()| scope.spawn(some));
        workers
            .map(|worker| worker.join().expect("a worker"))
            .concat()
    })
}

#[test]
fn answers_to_mistakes_name_the_fix() {
    let folder = tempfile::tempdir().expect("a folder");
    prepare(folder.path());
    let port = |listener: &TcpListener| listener.local_addr().expect("an address").port();
    let busy = TcpListener::bind("127.0.0.1:0").expect("a port");
    let free = TcpListener::bind("127.0.0.1:0").map(|one| port(&one));
    let ports = [("FREE", free.expect("a port")), ("BUSY", port(&busy))];
    let filled = |text: &str| {
        let fill = |text: String, (word, port): (&str, u16)| text.replace(word, &port.to_string());
        ports.into_iter().fold(text.to_owned(), fill)
    };
    let all: Vec<&Mistake> = [WORDS, SERVERS, NAMES, FILES]
        .into_iter()
        .flatten()
        .collect();
    let wrong = in_parallel(&all, |(line, fix)| {
        let fix: Vec<String> = fix.iter().map(|part| filled(part)).collect();
        judge(folder.path(), &filled(line), &fix)
    });
    assert!(wrong.is_empty(), "{wrong}");
}

/// Commands that a help lists below the headings of its groups.
fn listed(help: &str) -> Vec<String> {
    let mut inside = false;
    let mut names = Vec::new();
    for line in help.lines() {
        match line.strip_prefix("  ") {
            Some(entry) if inside => {
                let name = entry.split_whitespace().next().unwrap_or_default();
                let is_name = !entry.starts_with(' ') && name.starts_with(char::is_alphabetic);
                names.extend((is_name && name != "help").then(|| name.to_owned()));
            }
            Some(_) => {}
            None if line.is_empty() => inside = false,
            None => inside = line.ends_with(':') && !line.contains("ptions"),
        }
    }
    names
}

/// Problems of the help of a command and of the commands below it.
fn check_help(folder: &Path, words: &str, problems: &mut Vec<String>) {
    let [short, long] = ["-h", "--help"].map(|option| {
        let output = run(folder, &format!("{words} {option}"));
        assert!(
            output.status.success(),
            "{words} {option}: {}",
            printed(&output)
        );
        printed(&output)
    });
    if short.len() > long.len() {
        problems.push(format!("{words} -h is longer than --help"));
    }
    let below = listed(&short);
    let is_server = words == "wheelarm server";
    if !long.contains("Example") && below.is_empty() && !is_server {
        problems.push(format!("{words} --help has no example"));
    }
    for option in ["--connect <", "--sim <", "--connect-timeout <", "--user <"] {
        if long.contains(&format!("  {option}")) && !is_server {
            problems.push(format!("{words} --help lists {option} again"));
        }
    }
    let former = [
        "--workers",
        "--adapters",
        "--pictures",
        "--licence",
        "<FOLDER>",
        "<OUT>",
    ];
    for name in former.into_iter().filter(|name| long.contains(name)) {
        problems.push(format!("{words} --help names {name}"));
    }
    for name in below {
        check_help(folder, &format!("{words} {name}"), problems);
    }
}

#[test]
fn help_lists_every_command_once_with_an_example_and_connection_options_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let help = printed(&run(folder.path(), "wheelarm --help"));
    for option in [
        "--connect ",
        "--sim ",
        "--connect-timeout ",
        "--keys ",
        "--user ",
    ] {
        assert_eq!(
            help.matches(&format!("  {option}")).count(),
            1,
            "{option}{help}"
        );
    }
    let names = listed(&printed(&run(folder.path(), "wheelarm -h")));
    let script = printed(&run(folder.path(), "wheelarm completions bash"));
    let mut built_in: Vec<&str> = script
        .split("wheelarm,")
        .skip(1)
        .filter_map(|rest| rest.split(')').next())
        .filter(|name| *name != "help")
        .collect();
    built_in.push("server");
    built_in.sort_unstable();
    let mut listed = names.clone();
    listed.sort_unstable();
    assert_eq!(listed, built_in, "commands in groups, and all commands");
    let mut problems = Vec::new();
    for name in names {
        check_help(folder.path(), &format!("wheelarm {name}"), &mut problems);
    }
    assert!(problems.is_empty(), "{problems:#?}");
}

/// Words of a shell command up to a comment, a pipe or the next command.
fn shell_words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
    for c in line.chars() {
        match (quote, c) {
            (Some(open), _) if c == open => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, '#' | '|' | '&' | ';' | '>') if word.is_empty() => break,
            (None, ' ') if word.is_empty() => {}
            (None, ' ') => words.push(std::mem::take(&mut word)),
            (None, ';' | '>' | ')') => break,
            _ => word.push(c),
        }
    }
    words.extend((!word.is_empty()).then_some(word));
    words
}

/// Commands of this project in the shell blocks of a guide.
fn commands(guide: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let blocks = guide.split("\n```sh\n").skip(1);
    for block in blocks.filter_map(|rest| rest.split("\n```").next()) {
        for line in block.replace("\\\n", " ").lines() {
            let words = shell_words(line.trim());
            let is_ours = words.first().is_some_and(|word| {
                ["wheelarm", "wheelarm-server", "wheelarm-dataset"].contains(&word.as_str())
            });
            found.extend(is_ours.then_some(words));
        }
    }
    found
}

/// With `--help` at the end a command does nothing, but its options and their values are read.
#[test]
fn commands_of_the_guides_are_accepted() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut guides = vec![root().join("README.md")];
    for group in [
        "start",
        "drive-and-record",
        "train-and-evaluate",
        "integrate-and-operate",
        "add-your-own",
    ] {
        let entries = std::fs::read_dir(root().join("docs").join(group)).expect("a group");
        guides.extend(entries.map(|entry| entry.expect("an entry").path()));
    }
    let text = |guide: &Path| std::fs::read_to_string(guide).expect("a guide");
    let all = guides.iter().map(|guide| (guide, commands(&text(guide))));
    let all: Vec<(&std::path::PathBuf, Vec<Vec<String>>)> = all.collect();
    let count: usize = all.iter().map(|(_, commands)| commands.len()).sum();
    assert!(count >= 100, "only {count} commands were found");
    let wrong = in_parallel(&all, |(guide, commands)| {
        let rejected = commands.iter().filter_map(|words| {
            let mut command = Command::new(program(&words[0]).expect("the program"));
            let output = command
                .args(&words[1..])
                .arg("--help")
                .current_dir(folder.path());
            let output = output.output().expect("a process");
            let name = guide.display();
            (!output.status.success()).then(|| format!("{name}: {words:?}: {}\n", printed(&output)))
        });
        rejected.collect()
    });
    assert!(wrong.is_empty(), "{wrong}");
}
