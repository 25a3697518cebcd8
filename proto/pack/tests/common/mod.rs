//! The pack of tests/data/flat: two rooms, a door, a window, a table with a drawer, a cabinet
//! with a hinged door, a task.

#![allow(dead_code, reason = "not every test uses every part")]

use std::collections::BTreeMap;

use wheelarm_pack::{Pack, PackError};

macro_rules! files {
    ($($path:literal),* $(,)?) => {
        [$(($path, include_str!(concat!("../../../../tests/data/flat/", $path)))),*]
    };
}

const FILES: [(&str, &str); 11] = files![
    "areas/flat_table.toml",
    "home.toml",
    "kinds/cabinet.toml",
    "kinds/door_leaf.toml",
    "kinds/drawer.toml",
    "kinds/table.toml",
    "materials/flat.toml",
    "meshes/leg.obj",
    "objects/jar.toml",
    "pack.toml",
    "tasks/pick_jar.toml",
];

/// Its files, by path.
pub fn files() -> BTreeMap<String, Vec<u8>> {
    FILES
        .map(|(path, text)| (path.to_owned(), text.as_bytes().to_vec()))
        .into()
}

/// The pack with the first appearance of a text replaced in one file.
pub fn changed(path: &str, from: &str, to: &str) -> Result<Pack, PackError> {
    let mut files = files();
    let text = String::from_utf8(files[path].clone()).expect("text");
    assert!(text.contains(from), "{path} has no {from:?}");
    files.insert(path.to_owned(), text.replacen(from, to, 1).into_bytes());
    Pack::from_files(files)
}

/// The pack.
pub fn flat() -> Pack {
    Pack::from_files(files()).unwrap_or_else(|error| panic!("{error}"))
}
