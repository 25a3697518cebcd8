//! Files of `assets/people` and their names.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::setting::SampledPerson;
use crate::scene::{Place, SceneError, parse};

/// Folder of all people, below the assets.
pub(super) const FOLDER: &str = "people";

/// An asset as its file type.
pub(super) fn read<T: DeserializeOwned>(assets: &Path, path: &str) -> Result<T, SceneError> {
    parse(assets, path)
}

/// Available bodies, sorted.
pub(super) fn bodies(assets: &Path) -> Result<Vec<String>, SceneError> {
    let folder = assets.join(FOLDER);
    let unreadable = |source| SceneError::Read {
        path: folder.clone(),
        source,
        cure: "start from the folder that contains `assets`, or name it".to_owned(),
    };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let name = path.file_name().and_then(|name| name.to_str());
        if let (Some(name), true) = (name, path.join("person.toml").is_file()) {
            names.push(name.to_owned());
        }
    }
    names.sort();
    Ok(names)
}

/// A name that must be an available one.
pub(super) fn find_known<'a>(
    what: &str,
    name: &'a str,
    names: &[&str],
) -> Result<&'a str, SceneError> {
    match names.contains(&name) {
        true => Ok(name),
        false => Err(Place::file("scenario").key(what).wrong(
            format!("{:?}", wheelarm_proto::check::beginning(name)),
            format!("one of {}", names.join(", ")),
            "name one of them, or leave it out to sample it (`any` for a body)",
        )),
    }
}

/// Text files of a person, below the assets folder, sorted.
#[must_use]
pub fn files(of: &SampledPerson) -> Vec<String> {
    vec![
        format!("{FOLDER}/{}/person.toml", of.body),
        format!("{FOLDER}/{}/postures.toml", of.body),
        format!("{FOLDER}/looks.toml"),
        format!("{FOLDER}/postures.toml"),
    ]
}
