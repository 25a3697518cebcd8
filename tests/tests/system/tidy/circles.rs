//! No circles: within a module of the server, within a client package and within the dataset
//! crate, files name each other in one direction only.

use std::collections::{BTreeMap, BTreeSet};

use super::{code, list, names, root, run_code};

/// Pairs of modules below server/src that may name each other; an equal pair is a parent and its
/// children.
const CIRCLES: [(&str, &str); 3] = [
    // The type of the world, with its methods in several files.
    ("world", "world"),
    // A parent with the type, a child with some of its methods.
    ("sim", "sim::guard"),
    ("robot::control", "robot::control::arm"),
];

/// Paths that start with `crate::`, `super::` or `self::`; groups in braces are expanded.
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
            // A re-export is not a use, and neither is `pub(in crate::…)`.
            let line = text[..at].rsplit(['\n', ';']).next().unwrap_or_default();
            let re_exported = line.trim_start().starts_with("pub") && line.ends_with("use ");
            let visibility = text[..at].ends_with("(in ");
            if !inside && !middle && !re_exported && !visibility {
                tree(&text[at..], "", &mut found);
            }
        }
    }
    found
}

/// The module that a path names from `from`: the longest existing one.
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
/// `child::Item` without `self::`.
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
                // Parsed like other paths, so that a re-export does not count.
                let line = text[..at].rsplit(['\n', ';']).next().unwrap_or_default();
                let rest = text[at..].split(';').next().unwrap_or_default();
                found.extend(named_paths(&format!("{line}self::{rest}")));
            }
        }
    }
    found
}

/// The other files below `folder` that each file there names.
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
fn top_module(module: &str) -> &str {
    module.split("::").next().unwrap_or_default()
}

/// Keeps only the arrows in a circle, or behind one.
fn circles(mut arrows: BTreeMap<String, BTreeSet<String>>) -> BTreeMap<String, BTreeSet<String>> {
    // A file that names no remaining file is not in a circle.
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
const STRAIGHT: [&str; 12] = [
    "client/campaign/src",
    "client/cli/src",
    "client/expert/src",
    "client/learn/src",
    "client/options/src",
    "client/policy/src",
    "client/recorder/src",
    "client/rollout/src",
    "client/rollout/worker/src",
    "client/sdk/src",
    "client/teleop/terminal/src",
    "client/teleop/web/src",
];

#[test]
fn files_of_client_packages_have_no_circles() {
    let rollout = arrows("client/rollout/src");
    assert!(
        rollout["launcher::server"].contains("launcher::process"),
        "missing arrow: {rollout:?}"
    );
    let evaluate = &arrows("client/campaign/src")["evaluate"];
    assert!(
        evaluate.contains("evaluate::report"),
        "missing child: {evaluate:?}"
    );
    for folder in STRAIGHT {
        let left = circles(arrows(folder));
        assert!(left.is_empty(), "circles among or behind: {left:#?}");
    }
}

#[test]
fn files_of_a_module_of_the_server_have_no_circles() {
    let mut arrows = arrows("server/src");
    assert!(arrows.len() > 100, "{} files", arrows.len());
    for (name, named) in &mut arrows {
        named.retain(|other| top_module(other) == top_module(name));
    }
    for (first, second) in CIRCLES {
        let child = format!("{first}::");
        let allowed = |name: &str| match second == first {
            true => name.starts_with(&child),
            false => name == second,
        };
        for (name, named) in &mut arrows {
            if name == first {
                named.retain(|other| !allowed(other));
            } else if allowed(name) {
                named.remove(first);
            }
        }
    }
    let left = circles(arrows);
    assert!(left.is_empty(), "circles among or behind: {left:#?}");
}

/// Modules of the dataset crate, from the bottom up: each may name only earlier ones. So the
/// readers are independent of exports, and the table of columns is independent of files.
const DATASET: [&str; 30] = [
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
    "credits",
    "convert",
    "plot",
    "composition",
    "validate",
    "view",
    "video",
    "commands",
];

/// Modules of the dataset crate that may name HDF5.
const NAME_HDF5: [&str; 6] = ["hdf", "read", "finish", "align", "annotate", "convert"];

#[test]
fn modules_of_the_dataset_crate_name_only_lower_ones() {
    let arrows = arrows("client/dataset/src");
    assert!(arrows.len() > 80, "{} files", arrows.len());
    let height = |module: &str| {
        let found = DATASET.iter().position(|name| *name == top_module(module));
        found.unwrap_or_else(|| panic!("{module} is not in the list of modules"))
    };
    for (name, named) in &arrows {
        for other in named
            .iter()
            .filter(|other| top_module(other) != top_module(name))
        {
            assert!(height(other) < height(name), "{name} names {other}");
        }
    }
    let left = circles(arrows);
    assert!(left.is_empty(), "circles among or behind: {left:#?}");
    let source = root().join("client/dataset/src");
    for path in list("client/dataset/src", ".rs") {
        let place = path.strip_prefix(&source).expect("below src");
        let top_module = place.components().next().expect("a room").as_os_str();
        let top_module = top_module.to_string_lossy();
        let top_module = top_module.trim_end_matches(".rs");
        for (line, text) in code(&path) {
            let inside = NAME_HDF5.contains(&top_module);
            let wrapped = names(&text, "hdf5_sys") && top_module != "hdf";
            assert!(
                (inside || !names(&text, "hdf5")) && !wrapped,
                "{}:{line} names HDF5",
                place.display()
            );
        }
    }
}

#[test]
fn paths_in_braces_are_expanded() {
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
